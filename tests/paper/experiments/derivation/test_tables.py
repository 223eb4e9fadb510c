"""Each cell of the tables of the derivation, from handwritten results with different numbers."""

from types import SimpleNamespace as Made

import pytest
from mpmath import mpf

from nearharmonic_paper.experiments.derivation import run as tables

ROOT = Made(
    outer=("0.125", "0.375", "0.375", "0.125"), inner=("0.3", "0.4", "0.3"), sum_of_absolute_values=2.5, hits=11,
    proved=True, distance=mpf("1.23e-100"), residual=mpf("4.56e-120"), eliminated=False,
)  # fmt: skip
OTHER = Made(**(vars(ROOT) | {"hits": 3, "proved": False, "residual": mpf("7.89e-110"), "eliminated": True}))
CASE = Made(
    equations=Made(stages=5, harmonic_order=6), roots=(ROOT, OTHER), complex_solutions=10, real_solutions=4,
    complete=False, starts=300, converged=210,
)  # fmt: skip


def test_root_has_its_halves_and_how_well_it_is_known():
    first, second = tables.solutions([CASE]).records()
    assert first == {
        "stages": 5, "harmonic order": 6, "solution": 1, "half of the outer row": "0.12500000 0.37500000",
        "half of the inner row": "0.30000000 0.40000000", "sum of absolute values": 2.5, "hits": 11,
        "proved to exist": "yes", "within": "1.2e-100", "residual": "4.6e-120", "found by elimination": "no",
    }  # fmt: skip
    assert (second["solution"], second["hits"], second["proved to exist"], second["found by elimination"]) == (
        2, 3, "no", "yes",
    )  # fmt: skip


def test_counts_are_those_of_the_case_and_of_its_proofs():
    uncounted = Made(**(vars(CASE) | {"complex_solutions": None, "real_solutions": None, "complete": True}))
    first, second = tables.counts([CASE, uncounted]).records()
    assert first == {
        "stages": 5, "harmonic order": 6, "complex solutions": 10, "real solutions by Sturm": 4, "proved to exist": 1,
        "complete": "no", "starts": 300, "converged": 210,
    }  # fmt: skip
    assert (second["complex solutions"], second["real solutions by Sturm"]) == ("not counted", "not counted")
    assert second["complete"] == "yes"


def test_the_reach_of_stages_is_that_found():
    reach = Made(stages=6, lambda_max=12, harmonic_order=7, solutions=3, starts=50, proved_largest=True)
    (row,) = tables.reach_of_stages([reach]).records()
    assert row == {
        "stages": 6, "lambda_max": 12, "harmonic order reached": 7, "solutions at order s + 1": 3, "starts": 50,
        "proved largest": "yes",
    }  # fmt: skip


def test_printed_set_has_its_own_rank_whatever_order_of_ranking():
    def point(name, decimals):
        return Made(
            name=name, equations=Made(stages=7, harmonic_order=7), free_parameters=1, printed_residual=mpf("1.5e-75"),
            decimals=decimals, continued=Made(residual=mpf("2.5e-130")), proof=Made(proved=True),
        )  # fmt: skip

    def rank(name, members):
        return Made(
            name=name, members=members, sum_of_absolute_values=3.25, smaller_sum=0.4, smaller_higher=(0.6, 0.7),
            better_in_all=2, smallest_sum=2.75, nearest=0.01,
        )  # fmt: skip

    printed = point("babs7o7h", 75), point("babps8o7h", 70)
    rankings = rank("babps8o7h", 9), rank("babs7o7h", 8)
    first, second = tables.families(printed, rankings).records()
    assert first == {
        "set": "BABs7o7H", "stages": 7, "harmonic order": 7, "free parameters": 1, "printed residual": "1.5e-75",
        "decimals after continuation": 75, "residual after continuation": "2.5e-130", "proved": "yes",
        "members found": 8, "sum of absolute values": 3.25, "members with a smaller sum": 0.4,
        "members with a smaller next kappa": 0.6, "members better in all": 2, "smallest sum met": 2.75,
        "distance of the nearest": 0.01,
    }  # fmt: skip
    assert (second["set"], second["members found"], second["decimals after continuation"]) == ("BAB's8o7H", 9, 70)


@pytest.mark.parametrize("reached", [1, None])
def test_both_routes_list_worst_residual_and_their_seconds(reached):
    outcome = Made(kappa_max=mpf("3.3e-600"), evaluations=25000, restarts=4, seconds=1.5)
    run = Made(
        stages=5, starts=1500, promising=6, outcome=outcome, reached=reached,
        distance=None if reached is None else mpf("6.6e-590"),
    )  # fmt: skip
    ours, theirs = tables.routes([CASE], [run], {"isolated_5": 12.5, "isolated_6": 99.0}).records()
    assert (ours["stages"], ours["start"], ours["reached"], ours["largest kappa"], ours["seconds"]) == (
        5, "300 random", "all 2", "7.9e-110", 12.5,
    )  # fmt: skip
    assert theirs == {
        "route": "adaptive simplex, 2048 bits", "stages": 5, "start": "random, one of 6 in 1500",
        "reached": "not converged" if reached is None else "solution 2", "largest kappa": "3.3e-600",
        "agrees to": "" if reached is None else "6.6e-590", "evaluations": 25000, "restarts": 4, "seconds": 1.5,
    }  # fmt: skip
