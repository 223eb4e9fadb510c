"""Bad command lines: each ends with one sentence, exit status 2, and nothing written."""

import shlex
from time import process_time

import pytest

from nearharmonic.cli import main
from support.bad_input import LIMIT, check_message

KIND = "E. bad command lines"
#: Command lines, as in a shell, and words of the message.
LINES = """
| a command is missing
lst | Did you mean 'list'?
--frob | unrecognized arguments: --frob
"" | unknown command ''
list system | Did you mean 'systems'?
list systems planets | unrecognized arguments: planets
list --formt json | Did you mean '--format'?
list --format yaml | format = 'yaml'
list --format | expected one argument
list ٣ | kind =
export | required
export ruth | required: --to
export ruht --to c | Did you mean 'ruth'?
export ruth --to cc | to = 'cc'
export ruth --to c --digits ten | digits = 'ten'
export ruth --to c --digits -1 | digits
export ruth --to c --digits 0 | digits = 0
export ruth --to c --digits 80 | digits = 80 is not allowed: an integer from 1 to 79, the digits to which ruth is known
export gauss16 --to c | it is implicit, and no sequence of kicks and drifts
export ruth --to c --digits 1e999999999 | digits = '1e999999999'
export ruth --to c --digits ٣ | digits =
export ruth --to c --digits 1_0 | digits = '1_0'
export ruth --to c --digits 999999999999999999999999 | digits =
export none.py --to c | none.py
export none.py:x --to json | none.py
export ../x --to json | no such file
new | required
new planet x | kind = 'planet'
new system | required
new system ../x | '../x'
new system "a b" | 'a b'
new system class | NAME = 'class'
new system kepler | a registered system has this name
new integrator ruth | a registered integrator has this name
new system numpy | choose another
new system random | scripts beside random.py would import it in place of the module random
new system mine -o random.py | -o = 'random.py'
new system mine -o 'a"b.py' | of printable letters other than quotes
new integrator substeps | the workflow uses this name itself
new system 2body | a letter, then letters, digits and '_', at most 60
new system é | NAME
new system "" | is not allowed
new system mine -o mine.txt | the ending .py
recommend | required
recommend kepler | required: --error
recommend keplr --error 1e-9 | Did you mean 'kepler'?
recommend kepler --error small | error = 'small'
recommend kepler --error 0 | error = '0'
recommend kepler --error nan | error = 'nan'
recommend kepler --error 1e999999999 | error = '1e999999999'
recommend kepler --error ٣ | error =
recommend kepler --error 1e-9 --measure mx | measure = 'mx'
recommend kepler --error 1e-9 --t-end nan | t_end = 'nan'
recommend kepler --error 1e-9 --t-end=-5 | t_end = '-5'
recommend kepler --error 1e-9 --t-end 1e999999999 | t_end = '1e999999999'
recommend kepler --error 1e-9 --method ruth | Did you mean '--methods'?
recommend kepler --error 1e-9 --methods ruht | Did you mean 'ruth'?
recommend kepler --error 1e-9 --methods "" | unknown integrator ''
recommend kepler --error 1e-9 --budget 0 | budget = 0
recommend kepler --error 1e-9 --budget many | budget = 'many'
recommend kepler --error 1e-9 --budget 99999999999999 | budget = 99999999999999
recommend kepler --error 1e-9 --config none.yaml | none.yaml cannot be read as a config
recommend kepler --error 1e-9 --config / | cannot be read as a config
recommend kepler --error 1e-9 --config /dev/zero | not a regular file
recommend none.py --error 1e-9 | none.py
verify-tableau | required
verify-tableau none.json | there is no such file
verify-tableau none.txt | ends with .json, .toml, .csv, .py
verify-tableau / | ends with
tailor | required
tailor keplr | Did you mean 'kepler'?
tailor sho --stages 3 | stages = '3'
tailor sho --stages 10:6 | stages = '10:6'
tailor sho --stages 1e999999999 | stages = '1e999999999'
tailor sho --stages ٨ | stages =
tailor sho --window 1 | window = '1'
tailor sho --window 2:1 | window = '2:1'
tailor sho --window 0.1:0.2 --error 1e-6 | give one of the two
tailor sho --error 2 | error = '2'
tailor sho --seconds 0 | seconds = '0'
tailor sho --seconds nan | seconds = 'nan'
tailor sho --trials 0 | trials = 0
tailor sho --trials 1e9 | trials = '1e9'
tailor sho --seed x | seed = 'x'
tailor sho --energy x | energy = 'x'
tailor sho --output ruth.py | a registered integrator has the name ruth
tailor sho --output my-method.py | output = 'my-method.py' is not allowed: a file NAME.py
tailor sho --starts none.csv | starts = 'none.csv'
history nothing | nothing
history ../.. | ../..
show | required
show nothing kepler ruth 1 | nothing
runs | required
runs nothing | nothing
runs nothing --limit x | limit = 'x'
compare nothing | required
compare nothing nobody | nothing
verify nothing | nothing
verify nothing --rerun x | rerun = 'x'
adopt nothing | nothing
archive nothing | nothing
"""
CASES = [line.rpartition(" | ") if " | " in line else ("", "", line[2:]) for line in LINES.strip().splitlines()]


def test_a_bad_command_line_ends_with_one_sentence(trials, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    bad = trials(KIND)
    for line, _, says in CASES:
        with bad.case(line):
            begin = process_time()
            status = main(shlex.split(line))
            out, err = capsys.readouterr()
            assert process_time() - begin < LIMIT
            assert (status, out) == (2, ""), err
            assert err.startswith("nearharmonic: ")
            check_message(err.removeprefix("nearharmonic: ").removesuffix("\n"), says)
            assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("word", ["x" * 10**5, "\x1b[31m", "a\nb"], ids=["long", "escape", "two lines"])
def test_an_odd_word_is_shown_in_one_short_line(word, trials, capsys):
    bad = trials(KIND)
    for words in ([word], ["list", word], ["export", word, "--to", "c"], ["recommend", "sho", "--error", word]):
        with bad.case(words):
            assert main(words) == 2
            check_message(capsys.readouterr().err.removeprefix("nearharmonic: ").removesuffix("\n"))
