"""Files of coefficients: equal digits from JSON, TOML and CSV, and one sentence for unreadable files."""

from __future__ import annotations

import pytest

from nearharmonic.errors import TableauError
from nearharmonic.exchange.files import read
from nearharmonic.exchange.method import step_of

KICK, DRIFT = ("0.10", "0.8000000000000000000000001", "0.0999999999999999999999999"), ("0.5", "0.5")
TEXTS = {
    "strings.json": (
        '{"name": "mine", "order": 2, "harmonic_order": null, "requires": null, "first": "kick", "digits": 25,'
        f'"kick": ["{KICK[0]}", "{KICK[1]}", "{KICK[2]}"], "drift": ["0.5", "0.5"]}}'
    ),
    "numbers.json": (
        f'{{"name": "mine", "order": 2, "first": "kick", "digits": 25, "kick": [{", ".join(KICK)}],'
        ' "drift": [0.5, 0.5]}'
    ),
    "strings.toml": (
        'name = "mine"\norder = 2\nfirst = "kick"\ndigits = 25\n'
        f'kick = ["{KICK[0]}", "{KICK[1]}", "{KICK[2]}"]\ndrift = ["0.5", "0.5"]\n'
    ),
    "numbers.toml": (
        f'name = "mine"\norder = 2\nfirst = "kick"\ndigits = 25\nkick = [{", ".join(KICK)}]\ndrift = [0.5, 0.5]\n'
    ),
    "rows.csv": f"# a comment\nname,mine\norder,2\nfirst,kick\ndigits,25\n\nkick,{','.join(KICK)}\ndrift,0.5,0.5,\n",
}


def written(folder, name, text):
    (folder / name).write_text(text, encoding="utf-8")
    return str(folder / name)


@pytest.mark.parametrize("name", TEXTS)
def test_every_digit_is_kept_whatever_the_format(tmp_path, name):
    file = read(written(tmp_path, name, TEXTS[name]))
    assert (file.kick, file.drift, file.first) == (KICK, DRIFT, "kick")
    assert (file.name, file.label, file.order, file.digits) == ("mine", "mine", 2, 25)
    assert (file.harmonic_order, file.requires, file.symmetric) == (None, None, None)


@pytest.mark.parametrize("header", ["kick,drift", "drift, kick"])
def test_table_of_two_columns_is_named_by_file_without_claims(tmp_path, header):
    cells = [("0.25", "0.5"), ("0.5", "0.5"), ("0.25", "")]
    lines = [",".join(pair if header.startswith("kick") else pair[::-1]) for pair in cells]
    file = read(written(tmp_path, "table.csv", "\n".join([header, *lines])))
    assert (file.kick, file.drift) == (("0.25", "0.5", "0.25"), ("0.5", "0.5"))
    assert (file.name, file.first, file.order) == ("table", "kick", None)


@pytest.mark.parametrize("requires", ["quadratic_kinetic_energy", "quadratic kinetic energy"])
def test_a_requirement_has_one_spelling_inside(tmp_path, requires):
    text = f'{{"kick": ["0.5", "0.5"], "drift": ["1"], "requires": "{requires}"}}'
    assert read(written(tmp_path, "a.json", text)).requires == "quadratic kinetic energy"


def test_end_zeros_are_removed_and_equal_neighbours_joined():
    step = step_of(("0", "0.25", "0.25", "0.5"), ("0.5", "0", "0.5", "0"), "kick", 3)
    assert [(letter, float(c), c.place) for letter, c in step] == [
        ("A", 0.5, "drift[0]"),
        ("B", 0.5, "kick[1] + kick[2]"),
        ("A", 0.5, "drift[2]"),
        ("B", 0.5, "kick[3]"),
    ]
    assert [float(c.uncertainty) for _, c in step] == pytest.approx([3e-3, 6e-3, 3e-3, 3e-3])


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.txt", "", "a file of coefficients ends with .json, .toml, .csv"),
        ("a.json", "[1, 2", "cannot be read as JSON: Expecting ',' delimiter"),
        ("a.toml", "kick = [", "cannot be read as TOML: "),
        ("a.csv", "kick,1\nkick,1\n", "cannot be read as CSV: there are two lines 'kick'"),
        ("a.json", "[1, 2]", "holds no keys and values: expected at least kick and drift"),
        ("a.csv", "", "the key 'kick' is missing, the list of the kick coefficients"),
        ("a.json", '{"kick": ["1"]}', "the key 'drift' is missing"),
        ("a.json", '{"kick": "1", "drift": ["1"]}', "kick = '1' is not allowed: a list of 1 to 100 decimal numbers"),
        ("a.json", '{"kick": ["1/2", "0.5"], "drift": ["1"]}', r"kick\[0\] = '1/2' is not allowed: a decimal number"),
        ("a.json", '{"kick": ["0.5", NaN], "drift": ["1"]}', r"kick\[1\] = nan is not allowed: a decimal number"),
        ("a.json", '{"kick": ["0.5", true], "drift": ["1"]}', r"kick\[1\] = True is not allowed: a decimal number"),
        ("a.json", '{"kick": ["0.5", "1e4"], "drift": ["1"]}', r"kick\[1\] = '1e4' is not .* from -1000 to 1000"),
        ("a.json", '{"kick": ["0", "0.0"], "drift": ["1"]}', "every kick coefficient is 0"),
        ("a.json", '{"kick": ["1"], "drift": ["1"]}', "with 1 kick and 1 drift, the key 'first' has to say which"),
        (
            "a.json",
            '{"kick": ["1"], "drift": ["1"], "first": "kik"}',
            "first = 'kik' is not allowed: 'kick' or 'drift'",
        ),
        ("a.csv", "kick,1,2,3\ndrift,1\n", "3 kicks and 1 drift cannot alternate with the kick first"),
        ("a.csv", "kick,1\ndrift,.5,.5\nfirst,kick\n", "1 kick and 2 drifts cannot alternate with the kick first"),
        ("a.csv", "kick,1\ndrift,.5,.5\nordr,2\n", "unknown key 'ordr'. Did you mean 'order'\\? Known: name, label"),
        ("a.csv", "kick,1\ndrift,.5,.5\norder,11\n", "order = 11 is not allowed: an integer from 1 to 10"),
        ("a.csv", "kick,1\ndrift,.5,.5\norder,true\n", "order = True is not allowed"),
        ("a.csv", "kick,1\ndrift,.5,.5\nsymmetric,maybe\n", "symmetric = 'maybe' is not allowed: true or false"),
        (
            "a.csv",
            "kick,1\ndrift,.5,.5\nrequires,mass\n",
            "requires = 'mass' is not allowed: 'quadratic kinetic energy'",
        ),
        ("a.json", '{"kick": ["1"], "drift": [".5", ".5"], "label": 3}', "label = 3 is not allowed: a text"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_sentence(tmp_path, name, text, message):
    with pytest.raises(TableauError, match=message) as caught:
        read(written(tmp_path, name, text))
    assert "\n" not in str(caught.value)


def test_a_file_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(TableauError, match=r"none.json: there is no such file"):
        read(str(tmp_path / "none.json"))
