"""No character of a file controls the terminal, forges a line of an answer, or changes what JSON says."""

from __future__ import annotations

import json
import shlex
import sys
import unicodedata

import pytest

from nearharmonic.output.store import command_for
from nearharmonic.output.table import FORMATS, Answer, Table, in_one_line, printable, printed

HARMFUL = {"Cc", "Cf", "Cs", "Zl", "Zp"}
#: Format characters of scripts, such as Arabic and Kaithi, stay as well.
KEPT = {"\t", "\n"}


@pytest.mark.slow
def test_every_control_and_direction_mark_is_escaped():
    signs = [chr(code) for code in range(sys.maxunicode + 1)]
    left = [s for s in signs if unicodedata.category(s) in HARMFUL - {"Cf"} and printable(s) == s and s not in KEPT]
    assert left == []
    turning = {"LRE", "LRO", "RLE", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}
    assert [s for s in signs if unicodedata.bidirectional(s) in turning and printable(s) == s] == []


def test_letters_of_labels_stay():
    text = "BAB's9o7H, Hénon-Heiles τ/s = 10⁻³, |ΔH| ≤ 1\u202f%, \u00a05 \u2009µs\n\t∂V"
    assert printable(text) == text
    assert in_one_line("a\n\tb") == r"a\n\tb"


@pytest.mark.parametrize("form", FORMATS)
def test_printed_answer_holds_no_escape_sequence(form):
    """The command prints what :func:`printable` leaves; JSON means the same before and after."""
    evil = "\x1b]0;title\x07\x9b2J\x7f\r\u202e"
    answer = Answer(header=["name"], rows=[[evil]], caption=evil, notes=[evil])
    shown = printable(printed(answer, form))
    assert not {*evil} - {*"]0;title2J"} & {*shown}
    if form == "json":
        assert json.loads(shown) == [{"name": evil}]


def test_line_feed_in_cell_or_note_makes_no_line():
    answer = Answer(header=["name"], rows=[["a\nno fault"]], notes=["b\nno fault"])
    assert printed(answer, "table").splitlines() == ["name", r"a\nno fault", r"b\nno fault"]


def test_label_makes_no_cell_tag_or_link_in_markdown():
    label = "a|b\n| c <script>alert(1)</script> [x](javascript:y)"
    lines = Table(header=["label", "|H|"], rows=[[label, 1.5]], caption="one\n# two").markdown().splitlines()
    assert lines[0] == "one # two"
    assert len(lines) == 5
    assert [line.replace(r"\|", "").count("|") for line in lines[2:]] == [3, 3, 3]
    assert r"a\|b \| c &lt;script>alert(1)&lt;/script> [x]\(javascript:y)" in lines[4]


@pytest.mark.parametrize("name", ["a b.h5", "$(touch ran).h5", "`x`.h5", "a;b.h5", "a'b.h5", "a\nb.h5"])
def test_names_of_files_are_one_word_of_the_printed_command(name):
    words = shlex.split(command_for(f"results/paper/cubes/{name}"))
    assert words == ["snakemake", "-j2", "--force", f"results/paper/cubes/{name}"]


@pytest.mark.parametrize(
    ("recorded", "words"),
    [
        (["config/my own.yaml", "b.yaml"], ["config/my own.yaml", "b.yaml"]),
        (["config/own.yaml; rm -r ~"], ["config/own.yaml; rm -r ~"]),
        (["results/mine/evil.yaml"], ["config/mine.yaml"]),
        (["config/../results/other/evil.yaml"], ["config/mine.yaml"]),
        (["--snakefile=evil"], ["config/mine.yaml"]),
        ([1], ["config/mine.yaml"]),
        ("config/own.yaml", ["config/mine.yaml"]),
        ({}, ["config/mine.yaml"]),
    ],
)
def test_recorded_configs_are_words_and_never_options_or_results(tmp_path, monkeypatch, recorded, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results/mine").mkdir(parents=True)
    (tmp_path / "results/mine/manifest.json").write_text(json.dumps({"configfiles": recorded}))
    command = shlex.split(command_for("results/mine/report.html"))
    assert command == ["snakemake", "-j2", "--configfile", *words, "--force", "results/mine/report.html"]
