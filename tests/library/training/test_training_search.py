"""Searches: where they begin, what descents end at, and that one seed gives one result."""

from dataclasses import replace

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.theory.order import order_of
from nearharmonic.training import search as searching
from nearharmonic.training.family import Family
from nearharmonic.training.objective import OUTSIDE, Objective, tableau_of
from nearharmonic_studies.trained.problems import random_ensemble, with_exact_oscillators
from support.methods.family_members import members

# --- The search: where it begins, what it finds, and that one seed gives one result.

EFFORT = searching.Effort(trials=100, random=2, refinements=1)
FAMILY = Family(stages=6, first="kick")


class Distance:
    """An objective with a known minimum: the distance to a point, or the logarithm of it.

    It keeps its parts, and all points that it is asked for.
    """

    def __init__(self, family, target, *, plain=False):
        self.family, self.target, self.plain, self.trials, self.parts, self.asked = family, target, plain, 0, [], []

    def part(self, share):
        self.parts.append((share, Distance(self.family, self.target)))
        return self.parts[-1][1]

    def __call__(self, points):
        x, inside = self.family.project(points)
        self.trials += len(x)
        self.asked.append(points)
        with np.errstate(all="ignore"):
            squares = ((x - self.target) ** 2).sum(axis=1)
            found = np.sqrt(squares) if self.plain else np.log10(squares + 1e-12)
        return np.where(inside, found, OUTSIDE)


def found(value, unknowns, family=FAMILY):
    return searching.Found(family=family, value=value, unknowns=np.array(unknowns), origin="here", trials=1)


def names(starts):
    return [start.origin for start in starts]


def test_methods_of_equal_shape_start_and_shorter_ones_are_extended():
    # In turn: too many stages, two that fit, the other role, a stage less, both wrong, not symmetric.
    all_names = "babs7o7h babs6o7h srkn_b6 abas5o6h mclachlan_s5 aba864 mclachlan_atela_5"
    known = [nh.integrators[name] for name in all_names.split()]
    starts = list(searching.starts_in(FAMILY, known, [], replace(EFFORT, random=3)))
    assert names(starts) == ["babs6o7h"] * 2 + ["srkn_b6"] * 2 + ["mclachlan_s5, grown"] + ["random"] * 3
    assert [start.spread for start in starts[:4]] == [0.01, 0.003] * 2
    for start in starts[:5]:
        assert len(start.point) == FAMILY.unknowns
    assert starts[0].point == pytest.approx(FAMILY.unknowns_of(nh.integrators["babs6o7h"]))
    kicks, drifts, _ = FAMILY.rows(starts[4].point)
    smaller = nh.integrators["mclachlan_s5"]
    assert sum(map(abs, kicks)) == pytest.approx(sum(abs(float(c)) for c in smaller.kick))
    assert sum(map(abs, drifts)) == pytest.approx(sum(abs(float(c)) for c in smaller.drift))
    assert [start.point for start in starts[5:]] == [None] * 3


def test_best_shorter_method_is_extended_only_in_its_family():
    smaller = replace(FAMILY, stages=5)
    x = members(smaller, 1)[0]
    before = [
        found(-9.0, [0.1] * 3, replace(FAMILY, stages=4)), found(-2.0, x, smaller),
        found(-9.0, x, replace(smaller, harmonic_order=5)), found(-9.0, x, replace(smaller, first="drift")),
    ]  # fmt: skip
    starts = list(searching.starts_in(FAMILY, [], before, replace(EFFORT, random=0)))
    assert names(starts) == ["grown"] * 3
    assert [start.spread for start in starts] == [0.003, 0.01, 0.03]
    for start in starts:
        assert start.point == pytest.approx(smaller.grown(x)[1])
    assert list(searching.starts_in(FAMILY, [], [], replace(EFFORT, random=0))) == []


def test_methods_with_squares_start_families_with_these_squares():
    known = [nh.modified_integrators["omelyan_g5o6"], nh.integrators["mclachlan_s5"]]
    no_random = replace(EFFORT, random=0)
    for squares, wanted in (((), False), ((0, 1, 2), True), ((0, 1), False)):
        family = Family(stages=5, first=known[0].first, squares=squares)
        assert ("omelyan_g5o6" in names(searching.starts_in(family, known, [], no_random))) == wanted
    family = Family(stages=5, first="kick", squares=(0, 1, 2))
    start = next(s for s in searching.starts_in(family, known, [], no_random) if s.origin == "mclachlan_s5")
    assert start.point[4:].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.slow
@pytest.mark.parametrize("family", [FAMILY, Family(stages=4, first="drift", squares=(0, 1))], ids=str)
def test_descent_finds_minimum_and_returns_member_that_has_it(family):
    target = members(family, 1)[0]
    objective = Distance(family, target)
    near = target + 0.02 * np.random.default_rng(1).normal(size=family.unknowns)
    value, x = searching.descend(
        objective, searching.Start(origin="near", point=near, spread=0.01), replace(EFFORT, trials=2000), 5
    )
    assert value < -8
    assert np.abs(x - target).max() < 1e-4
    assert family.project(x[None])[1][0]
    assert value == pytest.approx(objective(x[None])[0], abs=1e-6)


@pytest.mark.slow
def test_a_search_finds_again_what_it_found_and_counts_it():
    objective = Distance(FAMILY, members(FAMILY, 1)[0])
    starts = [searching.Start(origin=str(i), point=objective.target + 0.01 * (i + 1), spread=0.01) for i in range(3)]
    findings = searching.search(objective, iter(starts), searching.Effort(trials=1500, random=0, refinements=2), 1)
    assert [one.origin for one in findings.found] == ["0", "1", "2", "refined", "refined"]
    assert findings.trials == objective.trials == sum(one.trials for one in findings.found)
    assert findings.best.value == min(one.value for one in findings.found)
    near = [np.abs(one.unknowns - findings.best.unknowns).max() < 0.02 for one in findings.found]
    low = [one.value < findings.best.value + 0.02 for one in findings.found]
    assert findings.again == sum(a and b for a, b in zip(near, low, strict=True)) >= 2


@pytest.mark.slow
def test_screened_starts_continue_if_short_descents_end_near_best():
    objective = Distance(FAMILY, members(FAMILY, 1)[0])
    offsets = {"near": 0.01, "far": 0.3, "nearer": 0.005}
    starts = [searching.Start(origin=name, point=objective.target + x, spread=0.003) for name, x in offsets.items()]
    effort = searching.Effort(trials=400, screened=4, behind=2.0)
    findings = searching.search(objective, iter(starts), effort, 1)
    assert names(findings.found) == ["near", "nearer"]
    ((share, part),) = objective.parts
    assert share == 4
    # Each of the three had a quarter of the trials on a quarter of the problems.
    assert 3 * 100 <= part.trials <= 3 * 120
    # A trial counts as one on all problems.
    assert objective.trials - findings.trials == pytest.approx(part.trials / 4, abs=3)


def test_centres_of_refinements_are_different_members_in_turns():
    findings = searching.Searcher(searching.Effort(trials=1, bases=2), 1)
    findings.found = [
        found(-1.0, [0.1, 0.2]),
        found(-0.99, [0.11, 0.2]),
        found(-0.5, [0.3, 0.2]),
        found(-0.1, [0.5, 0.2]),
    ]
    assert [findings.centre(turn).value for turn in range(4)] == [-1.0, -0.5, -1.0, -0.5]
    assert searching.Searcher(searching.Effort(trials=1), 1).effort.bases == 1


def test_equal_minimum_elsewhere_and_worse_one_here_are_different():
    findings = searching.Searcher(EFFORT, 1)
    findings.found = [
        found(-1.0, [0.1, 0.2]), found(-0.99, [0.11, 0.19]), found(-0.99, [0.1, 0.3]), found(-0.9, [0.1, 0.2]),
        found(25.0, [np.nan, 0.2]), found(-1.0, [0.1, 0.2], replace(FAMILY, harmonic_order=5)),
    ]  # fmt: skip
    assert findings.again == 2
    assert findings.trials == 6
    assert findings.best is findings.found[0]


@pytest.mark.slow
def test_one_seed_gives_the_same_bits_and_another_seed_others():
    target = members(FAMILY, 1)[0]

    def run(seed):
        starts = searching.starts_in(FAMILY, [nh.integrators["babs6o7h"]], [], EFFORT)
        return searching.search(Distance(FAMILY, target), starts, EFFORT, seed)

    one, again, other = run(1), run(1), run(2)
    assert [a.unknowns.tobytes() for a in one.found] == [b.unknowns.tobytes() for b in again.found]
    assert [a.value for a in one.found] == [b.value for b in again.found]
    assert all((a.unknowns != b.unknowns).any() for a, b in zip(one.found, other.found, strict=True))


# --- Gauss-Newton descents: they end at minima that scans find, within the family and within their trials.

WINDOW = (0.06, 0.09)
ENSEMBLES = (
    random_ensemble(2, 12, 1, band=(0.05, 0.4), t_end=15.0),
    random_ensemble(3, 8, 2, band=(0.05, 0.4), t_end=15),
)
REFERENCES = (np.array([-6.0, -5.0]), np.array([-5.5, -4.5]))


def objective_of(family, ensembles=ENSEMBLES, **more):
    return Objective(family, ensembles, WINDOW, REFERENCES[: len(ensembles)], size=21, **more)


@pytest.mark.slow
@pytest.mark.parametrize("exact", [False, True], ids=["kinetic_potential", "exact_oscillator"])
@pytest.mark.parametrize("first", ["drift", "kick"])
def test_descent_ends_at_minima_of_scans_along_members(first, exact):
    family = Family(stages=7, first=first)  # six unknowns, two conditions
    objective = objective_of(family, tuple(map(with_exact_oscillators, ENSEMBLES)) if exact else ENSEMBLES)
    starts = members(family, 3)
    ends = np.array([searching.Descent(objective).minimise(start, 1000, 1e-4) for start in starts])
    at_ends = objective(ends)
    assert (objective(starts) - at_ends).min() > 0.3
    for end, value in zip(ends, at_ends, strict=True):
        for direction in np.linalg.svd(family.slopes(end))[2][2:]:
            scan, inside = family.project(end + np.linspace(-0.02, 0.02, 21)[:, None] * direction)
            # The rms over samples is minimised, and the minima of both differ by some hundredths of a decade.
            assert value < objective(scan)[inside].min() + 0.1


@pytest.mark.slow
def test_part_of_objective_has_its_first_problems_at_same_cost():
    family = Family(stages=6, first="kick", squares=(0,))
    x = members(family, 3)
    whole = objective_of(family, charge=0.7)
    parts = [one.part(slice(-(-one.size // 4))) for one in ENSEMBLES]
    wanted = objective_of(family, parts, charge=0.7)(x)
    assert whole.part(4)(x).tobytes() == wanted.tobytes()
    assert whole.trials == 0


@pytest.mark.slow
def test_trials_of_a_descent_are_counted_and_bounded():
    family = Family(stages=7, first="drift")
    objective, start = objective_of(family), members(family, 1)[0]
    found = [searching.Descent(objective).minimise(start, trials, 0.0) for trials in (0, 30, 100)]
    assert found[0].tobytes() == family.project(start[None])[0][0].tobytes()
    values = objective(np.array(found))
    assert values[2] < values[1] < values[0]
    before = objective.trials
    descent = searching.Descent(objective)
    descent.minimise(start, 100, 0.0)
    assert 100 <= objective.trials - before < 100 + 2 * descent.size


def test_start_outside_and_family_of_one_member_stay():
    only = Family(stages=3, first="kick")  # two unknowns, two conditions
    member = members(only, 1)[0]
    assert searching.Descent(objective_of(only)).minimise(member, 100, 1e-3) == pytest.approx(member, abs=1e-12)
    family = Family(stages=6, first="kick")
    objective = objective_of(family)
    for far in (300.0, np.nan):
        start = searching.Start(origin="far", point=np.full(family.unknowns, far), spread=0.01)
        value, _ = searching.descend(objective, start, searching.Effort(trials=50, descent="gauss_newton"), 1)
        assert value >= OUTSIDE


def test_bound_of_the_coefficients_holds_on_the_way():
    family = Family(stages=7, first="drift")
    start = members(family, 1)[0]
    total = sum(np.abs(row).sum() for row in family.rows(start)[:2])
    end = searching.Descent(objective_of(family, largest_sum=total + 0.01)).minimise(start, 200, 1e-3)
    assert sum(np.abs(row).sum() for row in family.rows(end)[:2]) < total + 0.01


# --- Evolution in the tangent space of a family: what it ends at, what it costs, where it looks.

#: Eight unknowns, two equations of order four, and two of a harmonic order of six.
CURVED = Family(stages=9, first="drift", harmonic_order=6)


def descended(objective, point, descent, trials, spread=0.02, **effort):
    start = searching.Start(origin="here", point=point, spread=spread)
    return searching.descend(
        objective, start, searching.Effort(trials=trials, descent=descent, small_value=1e-12, **effort), 3
    )


@pytest.mark.slow
def test_it_ends_where_no_member_nearby_is_closer():
    """At the nearest member the way to the target is normal to the members, a combination of the slopes."""
    x = members(CURVED, 1)[0]
    objective = Distance(CURVED, x + 0.1 * np.random.default_rng(2).normal(size=len(x)), plain=True)
    value, end = descended(objective, x, "tangent_evolution", 1200)
    assert CURVED.met(end[None])[0]
    assert value == pytest.approx(objective(end[None])[0], abs=1e-12)
    way, slopes = objective.target - end, CURVED.slopes(end)
    rest = way - np.linalg.lstsq(slopes.T, way, rcond=None)[0] @ slopes
    # Strategies end with steps of 1e-6 or so, at which the distance changes by its rounding.
    assert np.linalg.norm(rest) < 1e-4 * np.linalg.norm(way)


def test_all_its_points_lie_in_a_tangent_space():
    objective = Distance(CURVED, members(CURVED, 2)[1], plain=True)
    start = members(CURVED, 1)[0]
    descended(objective, start, "tangent_evolution", 60, tangents=1)
    steps = np.concatenate(objective.asked[1:-1]) - start
    assert np.abs(steps).max() > 1e-3
    assert np.abs(CURVED.slopes(start) @ steps.T).max() < 1e-10


def test_family_without_freedom_returns_the_projected_start():
    isolated = Family(stages=6, first="kick", order=6, potential_degree=3)
    x = np.array([0.1] * 5)
    objective = Distance(isolated, x, plain=True)
    value, end = descended(objective, x, "tangent_evolution", 40)
    assert value == OUTSIDE
    assert np.array_equal(end, isolated.project(x[None])[0][0])


def test_it_is_refined_around_the_best_itself():
    best = searching.Found(family=CURVED, value=0.0, unknowns=members(CURVED, 1)[0], origin="here", trials=1)
    start = searching.Searcher(searching.Effort(trials=1, descent="tangent_evolution"), 1).near(best, 0, "refined")
    assert np.array_equal(start.point, best.unknowns)


# --- Members near random points: of families with few members, proved by the order of their tableaus.

#: Five equations of order six for five unknowns: members are isolated.
ISOLATED = Family(stages=6, first="kick", order=6, potential_degree=3)


def found_members(family, count, seed=1, **settings):
    return searching.random_members(family, count, np.random.default_rng(seed), searching.Pursuit(**settings))


def proved(family, x):
    return order_of(tableau_of(family, x.tolist(), nearest=1e-5, name="one", source="here"), potential_degree=3)


@pytest.mark.slow
def test_isolated_members_of_order_six_are_found_again_and_again():
    x = found_members(ISOLATED, 1500, batch=500)
    # Of the points 1 to 3 % lead to a member, which is one of a few.
    assert len(x) > 15
    assert ISOLATED.met(x).all()
    different = {tuple(one) for one in np.round(x, 6).tolist()}
    assert len(different) < len(x) / 3
    assert {proved(ISOLATED, np.array(one)) for one in list(different)[:2]} == {6}


@pytest.mark.slow
def test_fifteen_stages_have_order_eight_for_cubic_potentials():
    family = Family(stages=15, first="drift", order=8, potential_degree=3)
    x = found_members(family, 4000)
    assert family.met(x).all()
    assert proved(family, x[0]) == 8


def test_random_points_without_a_member_give_none():
    assert found_members(ISOLATED, 0).shape == (0, 5)
    assert found_members(ISOLATED, 100, steps=1, kept=()).shape == (0, 5)


@pytest.mark.slow
def test_search_begins_at_the_best_members():
    effort, every = searching.Effort(trials=40, members=1500, member_starts=2), np.random.default_rng([3, 2])
    every, origin = searching.random_members(ISOLATED, 1500, every), np.zeros(5)
    searcher = searching.search(Distance(ISOLATED, origin, plain=True), iter(()), effort, 3)
    assert [one.origin for one in searcher.found] == ["random member"] * 2
    # The members are isolated, so that a descent stays at its start.
    assert searcher.best.value == pytest.approx(np.linalg.norm(every, axis=1).min(), rel=1e-6)
    assert not searching.search(Distance(ISOLATED, origin), iter(()), replace(effort, members=0), 3).found
