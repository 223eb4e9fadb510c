"""Tables in their forms, answers of commands, and generated parts of pages."""

import json
import shlex
import sys
import unicodedata
from types import SimpleNamespace

import pytest
import tabulate

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.store import command_for
from nearharmonic.output.table import FORMATS, Answer, Table, filled, from_csv, in_one_line, pipes, printable, printed

TABLE = Table(header=["name", "size"], rows=[["a, b", 0.1234567], ["c", 2]], caption="Sizes.")


def test_each_form_holds_the_digits_that_its_readers_see():
    assert TABLE.csv() == 'name,size\n"a, b",0.1234567\nc,2\n'
    assert TABLE.markdown().splitlines()[0::4] == ["Sizes.", "| a, b   | 0.1235 |"]
    assert TABLE.latex().startswith("% Sizes.\n\\begin{tabular}")
    assert [line.split() for line in TABLE.lines(digits=2)] == [
        ["Sizes."],
        ["name", "size"],
        ["a,", "b", "0.12"],
        ["c", "2"],
    ]
    assert TABLE.records()[1] == {"name": "c", "size": 2}


def test_latex_has_formulas_and_numbers_in_math_mode():
    rows = [
        ["Q[1,0] Cbar_2 - C_2 Q[0,0]", -0.5], ["babps8o7h & bcss_s2, 5 %", 1e-5], ["d_1 = d_3", 87660],
        ["h", "0.1234567"],
    ]  # fmt: skip
    lines = Table(header=["tau^2 of Table 2", "d(1)"], rows=rows).latex().splitlines()[3:]
    assert [line for line in lines if "&" in line] == [
        r"$\tau^{2}$ of Table 2 & $d(1)$ \\",
        r"$Q_{1,0} \bar C_2 - C_2 Q_{0,0}$ & $-0.5$ \\",
        r"babps8o7h \& bcss\_s2, 5 \% & $1 \times 10^{-5}$ \\",
        r"$d_1 = d_3$ & $87\,660$ \\",
        r"h & $0.12345\,67$ \\",
    ]


def test_bar_in_a_cell_ends_no_cell_of_markdown():
    table = Table(header=["x"], rows=[["|q| < 1"]], caption="Sizes.")
    assert table.markdown().splitlines()[-1] == r"| \|q\| < 1 |"


def test_bytes_are_the_same_with_and_without_wcwidth(monkeypatch):
    """Each cell is padded to its number of characters: a combining accent counts, a Chinese character counts once."""
    odd = Table(header=["name", "size"], rows=[["He\u0301non", 1], ["\u7cfb", 2], ["plain", 3]], caption="Odd.")
    found = []
    for library in (SimpleNamespace(wcswidth=lambda text: 2 * len(text)), None):
        monkeypatch.setattr(tabulate, "wcwidth", library)
        monkeypatch.setattr(tabulate, "WIDE_CHARS_MODE", library is not None)
        found.append((odd.markdown(), odd.latex(), odd.lines()))
        assert (library is not None) is tabulate.WIDE_CHARS_MODE
    assert found[0] == found[1]
    assert len({len(line) for line in found[0][0].splitlines()[2:]}) == 1


def test_table_read_from_its_csv_has_same_cells_as_texts():
    again = from_csv(TABLE.csv())
    assert (again.header, again.rows) == (["name", "size"], [["a, b", "0.1234567"], ["c", "2"]])


@pytest.mark.parametrize(
    ("text", "says"), [("", "no table"), ("a,b\n1\n", "row 0 has 1 cells under 2 names"), ("a\nb,c\n", "row 0")]
)
def test_a_text_that_is_no_table_is_refused(text, says):
    with pytest.raises(NearharmonicError, match=says):
        from_csv(text)


# --- no character of a file controls the terminal, forges a line, or changes what JSON says ---------------------------


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


# --- generated parts of Markdown pages --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("align", "marks"), [("l", "|---|---|---|"), ("lr", "|---|---:|---:|"), ("rrl", "|---:|---:|---|")]
)
def test_last_letter_of_alignment_holds_for_all_further_columns(align, marks):
    assert pipes(["a", "b", "c"], [[1, "x", 2.5]], align) == ["| a | b | c |", marks, "| 1 | x | 2.5 |"]


def test_each_part_stands_between_its_marks_and_nothing_else_changes():
    page = "a\n<!-- one -->\nold\n<!-- end -->\nb\n<!-- two -->\n<!-- end -->\nc\n"
    expected = "a\n<!-- one -->\n1 \\1\n<!-- end -->\nb\n<!-- two -->\n2\n<!-- end -->\nc\n"
    assert filled(page, {"one": "1 \\1", "two": "2"}) == expected
    assert filled(expected, {"one": "1 \\1"}) == expected


@pytest.mark.parametrize("page", ["", "<!-- one -->\n", "<!-- one -->\n<!-- end -->\n<!-- one -->\n<!-- end -->\n"])
def test_page_without_exactly_one_place_for_part_is_refused(page):
    with pytest.raises(NearharmonicError, match="places for one"):
        filled(page, {"one": "1"})
