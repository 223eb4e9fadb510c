"""docs/results/ranking.md: comparison with runs, and of its text with its tables."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import nearharmonic as nh
from nearharmonic.integrators import plain_integrators
from nearharmonic_paper.pages import ranking

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/results/ranking.md").read_text(encoding="utf-8")
ERRORS = ("1e-03", "1e-06", "1e-09", "1e-12")


def rows():
    """(system, error) -> ([(label, evaluations)], the same of published methods, [labels by time])."""
    found = {}
    for title, text in re.findall(r"## (.*?), t = .*?\n\n(.*?)(?=\n\n|\n<!-- end)", PAGE, flags=re.DOTALL):
        for line in text.splitlines()[2:]:
            _, error, *cheap, fast, _ = (cell.strip() for cell in line.split("|"))
            pairs = [[piece.rsplit(" ", 1) for piece in re.split(r"(?<=\d), (?=\D|\d\D)", cell)] for cell in cheap]
            found[title.partition(",")[0], error] = (
                *([(name, int(count)) for name, count in cell] for cell in pairs),
                re.findall(r"(\S.*?) \d+ µs", fast.replace("µs, ", "µs\n")),
            )
    return found


def leaders(system, error, of=1):
    """Leaders of the published methods, or of all methods with ``of=0``."""
    return [name for name, _ in rows()[system, error][of]]


def by_label(label):
    return next(name for name, one in nh.integrators.items() if one.label == label)


@pytest.mark.parametrize(
    ("number", "error"),
    [(0, "1e-06"), pytest.param(4, "1e-06", marks=pytest.mark.slow), pytest.param(2, "1e-09", marks=pytest.mark.long)],
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
        assert names | set(fast) <= {one.label for one in nh.integrators.values()}
        assert not any(name.startswith("trained ") for name, _ in published)


def test_what_page_says_of_leaders_is_what_its_tables_say():
    paper = {one.label for one in plain_integrators.values() if one.source.startswith("Nielsen")}
    for system, errors in (("Hénon-Heiles", ERRORS[:2]), ("quartic pair", ERRORS[:2]), ("FPUT-8", ERRORS[1:2])):
        assert all(leaders(system, error)[0] in paper for error in errors), system
    nystrom = {one.label for one in plain_integrators.values() if one.requires}
    for system in ("Hénon-Heiles", "Kepler", "pendulum", "quartic pair", "FPUT-8"):
        for error in ERRORS[2:]:
            composition = leaders(system, error)[0].startswith("s35o10")
            assert leaders(system, error)[0] in nystrom or composition, (system, error)
            assert composition is ((system, error) == ("Kepler", "1e-12"))
    ahead = {(system, error) for system, error in rows() if leaders(system, error, 0)[0].startswith("trained ")}
    assert {system for system, error in ahead if error == "1e-06"} == {system for system, _ in rows()}
    assert {system for system, _ in rows()} - {system for system, error in ahead if error == "1e-09"} == {"pendulum"}
    assert {system for system, error in ahead if error == "1e-12"} == {system for system, _ in rows()} - {"pendulum"}
    implicit = {place for place in rows() if leaders(*place, 0)[0] == "Gauss 16"}
    assert implicit == {("pendulum", "1e-12")}
    fastest = {place for place, (*_, fast) in rows().items() if fast[0] == "Gauss 16"}
    at_twelve = {(system, "1e-12") for system, _ in rows() if system != "FPUT-8"}
    assert fastest == {*at_twelve, ("Kepler", "1e-09"), ("pendulum", "1e-09")}
    assert rows()["Hénon-Heiles", "1e-12"][2][1] == "trained cubic precise"
    for error in ERRORS[2:]:
        trained, published, _ = rows()["Kepler", error]
        assert trained[0][0] == "trained orbits"
        assert f"{trained[0][1] / published[0][1]:.2f}" in re.search(r"`trained_orbits` takes (.*?)\n- ", PAGE, re.S)[1]
    assert {"6A8"} <= set(leaders("Hénon-Heiles", "1e-06")) & set(leaders("quartic pair", "1e-06"))
    assert not paper & {name for error in ERRORS[1:] for name in leaders("Kepler", error)}
    assert leaders("pendulum", "1e-06")[0] == leaders("pendulum", "1e-09")[0] == "SRKN 11b"


def test_decision_table_names_the_methods_with_fewest_evaluations():
    """The best of all, and the best published one if that is another."""
    page = (ROOT / "docs/start/choosing.md").read_text(encoding="utf-8")
    lines = re.search(r"\| motion .*?(?=\n\n)", page, flags=re.DOTALL)[0].splitlines()[2:]
    table = {cells[2]: cells[3:-1] for cells in ([cell.strip() for cell in line.split("|")] for line in lines)}
    systems = dict.fromkeys(system for system, _ in rows())
    assert table.keys() == systems.keys()
    for system, cells in table.items():
        for error, cell in zip(ERRORS, cells, strict=True):
            best, published = (by_label(leaders(system, error, of)[0]) for of in (0, 1))
            assert cell == (f"`{best}`" if best == published else f"`{best}`, `{published}`"), (system, error)
