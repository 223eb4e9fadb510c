"""docs/how_to/tailor.md: its text and tables, its options and the command, its numbers and searches."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import nearharmonic as nh
from nearharmonic.cli import main
from nearharmonic.training import question
from nearharmonic.training import question as starts
from nearharmonic.training import tailor as tailoring
from nearharmonic.training import tailor_search as budget
from nearharmonic.training import tailor_search as search
from nearharmonic_paper.pages.how_to import tailor as made

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/how_to/tailor.md").read_text(encoding="utf-8")
GAIN = re.compile(r"(-?\d\.\d\d) \((-?\d\.\d\d) to (-?\d\.\d\d)\)")


def part(name):
    """Text between the marks of a table."""
    return re.search(rf"<!-- {name} -->\n(.*?)<!-- end -->", PAGE, flags=re.DOTALL)[1]


def rows(name):
    lines = [line for line in part(name).splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_the_options_of_the_page_are_those_of_the_command(capsys):
    assert main(["tailor", "--help"]) == 0
    told = set(re.findall(r"--[a-z]+", capsys.readouterr().out)) - {"--help", "--format"}
    assert told == set(re.findall(r"^\| `(--[a-z]+)", PAGE, flags=re.MULTILINE))


def test_defaults_and_bounds_are_those_of_the_code():
    flat = " ".join(PAGE.split())
    assert f"HIGH is {question.NARROWEST:g} to {question.WIDEST:g} times LOW" in flat
    assert f"{question.FEWEST_STAGES} to {question.MOST_STAGES}, or `6:12`" in flat
    assert f"| {question.SECONDS:g} |" in PAGE
    assert question.ERROR == 1e-6
    assert f"more than {question.MOST_COORDINATES} coordinates" in flat
    assert f"{starts.LEAST} to {starts.MOST} in all" in flat
    assert starts.HALF_EDGE == 0.1  # a tenth of the amplitude
    assert search.Rounds().third == 3  # the best third
    assert tailoring.LONGER == 4  # runs four times as long
    assert budget.Budget(None, 1).trials == 0


def test_bold_gains_are_those_whose_interval_is_above_zero():
    found = rows("gains")
    assert len(found) == len(made.SYSTEMS)
    for *_, cell in found:
        (numbers,) = GAIN.findall(cell)
        mean, low, high = map(float, numbers)
        assert low <= mean <= high
        assert cell.startswith("**") == (low > 0)


def test_gains_are_counted_and_their_range_is_stated():
    bold = [float(GAIN.findall(row[-1])[0][0]) for row in rows("gains") if row[-1].startswith("**")]
    words = {6: "six", 7: "seven", 5: "five"}
    page = " ".join(PAGE.split())
    assert f"On {words[len(bold)]} of ten systems the new method is ahead" in page
    assert f"by {min(bold):.2f} to {max(bold):.2f} decades" in page


def test_every_published_method_of_the_page_is_registered():
    for _, _, names, stages, *_ in rows("gains"):
        assert all(name.strip("` ") in nh.integrators for name in names.split(","))
        assert 6 <= int(stages) <= 12


def test_over_fitting_differences_follow_from_columns_and_words():
    found = rows("over-fitting")
    assert len(found) == len(made.OVER) * len(made.STARTS)
    by_count = {}
    for _, count, own, others, difference in found:
        assert float(difference) == pytest.approx(float(own) - float(others), abs=0.011)  # three roundings
        by_count.setdefault(int(count), []).append(float(difference))
    words = r"too large by up to (\S+)\. With .* is up to (\S+); .* at most (\d\.\d\d)\."
    (one, few, many) = re.search(words, " ".join(PAGE.split())).groups()
    assert all(x > 0 for x in by_count[1])
    assert f"{max(by_count[1]):.2f}" == one
    assert f"{max(abs(x) for n in (2, 4) for x in by_count[n]):.2f}" == few
    assert max(abs(x) for n in (8, 16, 32) for x in by_count[n]) <= float(many)


def test_the_method_loses_where_the_page_says_so():
    (steps, at_steps), (energies, at_energies) = (
        [[float(cell) for cell in line.strip("|").split("|")[1:]] for line in (head, row)]
        for head, row in re.findall(r"^(\| (?:tau/s|H) \|.*)\n.*\n(.*)$", part("elsewhere"), flags=re.MULTILINE)
    )
    gains = dict(zip(steps, at_steps, strict=True))
    assert max(gain for tau, gain in gains.items() if not 0.08 <= tau <= 0.12) < 0
    assert all(gains[tau] > 0.2 for tau in (0.1, 0.12))
    there = dict(zip(energies, at_energies, strict=True))
    assert max(there[energy] for energy in (0.001, 0.01, 0.04)) < 0
    assert all(there[energy] > 0.15 for energy in (0.08, 0.125, 0.15))


@pytest.mark.slow
def test_example_is_what_command_prints_but_for_time(capsys):
    """Searches of 6000 trials on other processors end nearby: gains to a tenth."""
    assert main(["tailor", *made.EXAMPLE]) == 0
    stated, found = (text.splitlines() for text in (part("example").strip("`\n"), capsys.readouterr().out))
    assert [line.split()[:2] for line in found[1:7]] == [line.split()[:2] for line in stated[1:7]]
    for a, b in zip(found, stated, strict=True):
        assert [float(x) for x in sum(GAIN.findall(a), ())] == pytest.approx(
            [float(x) for x in sum(GAIN.findall(b), ())], abs=0.1
        )


@pytest.mark.long
def test_a_row_of_gains_is_found_again():
    number = made.SYSTEMS.index("kepler")
    (stated,) = GAIN.findall(rows("gains")[number][-1])
    found = made.gain_of(nh.systems["kepler"])
    assert found.test.gain.mean == pytest.approx(float(stated[0]), abs=0.3)
