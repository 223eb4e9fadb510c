"""docs/ranking.md: comparison with runs, and of its text with its tables."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import nearharmonic as nh
from nearharmonic.integrators import plain_integrators
from nearharmonic.reproduction.pages import ranking

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/ranking.md").read_text(encoding="utf-8")
ERRORS = ("1e-03", "1e-06", "1e-09", "1e-12")


def rows():
    """(system, error) -> ([(label, evaluations)], the same of published methods, [labels by time])."""
    found = {}
    for title, text in re.findall(r"### (.*?), t = .*?\n\n(.*?)(?=\n\n|\n<!-- end)", PAGE, flags=re.DOTALL):
        for line in text.splitlines()[2:]:
            _, error, *cheap, fast, _ = (cell.strip() for cell in line.split("|"))
            pairs = [[piece.rsplit(" ", 1) for piece in re.split(r"(?<=\d), (?=\D|\d\D)", cell)] for cell in cheap]
            found[title.partition(",")[0], error] = (
                *([(name, int(count)) for name, count in cell] for cell in pairs),
                re.findall(r"(\S.*?) \d+ µs", fast.replace("µs, ", "µs\n")),
            )
    return found


def by_label(label):
    return next(name for name, one in plain_integrators.items() if one.label == label)


@pytest.mark.parametrize(
    ("number", "error"),
    [(0, "1e-06"), *(pytest.param(*row, marks=pytest.mark.slow) for row in [(2, "1e-09"), (4, "1e-06")])],
)
def test_evaluations_are_those_of_runs(number, error):
    contest = ranking.contests()[number]
    stated, *_ = rows()[contest.name.partition(",")[0], error]
    curves = [ranking.curve(contest, by_label(label)) for label, _ in stated]
    found = ranking.by_evaluations(curves, float(error))
    assert [round(evaluations) for evaluations, _, _ in found] == [count for _, count in stated]
    for _, steps, one in found:
        tau = float(contest.t_end) / steps
        run = nh.integrate(contest.system, one.method, tau, t_end=contest.t_end, samples=2)
        assert run.max_energy_error <= float(error)


def test_every_system_has_every_error_with_three_ordered_methods():
    table = rows()
    assert len(table) == 5 * len(ERRORS)
    for cheap, published, fast in table.values():
        for one in (cheap, published):
            counts = [count for _, count in one]
            assert len(one) == len(fast) == 3
            assert counts == sorted(counts)
        names = {name for name, _ in cheap + published}
        assert names | set(fast) <= {one.label for one in plain_integrators.values()}
        assert not any(name.startswith("trained ") for name, _ in published)
