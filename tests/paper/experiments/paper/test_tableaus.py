"""The paper's tables, the table of all methods, and methods with modified potentials."""

from math import inf, sqrt

import matplotlib.pyplot as plt
import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.errors import SettingError
from nearharmonic.integrators import integrators
from nearharmonic.output.store import write
from nearharmonic_paper.config import load
from nearharmonic_paper.experiments.paper.figures import fig2_decomposition
from nearharmonic_paper.experiments.paper.reductions import reduce
from nearharmonic_paper.experiments.paper.run import integrate, shards_of
from nearharmonic_paper.experiments.paper.tableaus import decompose, even_orders, overview, recursion_values, structure
from support.oracles.reference_solutions import oscillator_step

# --- The paper's tables: cells of each against numbers found by hand, or by products of matrices in multiprecision.


def row_of(name):
    header, (row,) = overview(name)
    assert len(row) == len(header)
    return dict(zip(header, row, strict=True))


def test_the_overview_of_the_leapfrog_is_that_of_textbooks():
    """Its error is tau^3 ([A,[A,B]]/12 and [[A,B],B]/24). On the oscillator K12 errs by tau^3/6 and K21 by tau^3/12;
    K12 + K21 = tau^3/4; the trace is 2 - tau^2."""
    norm = sqrt(1 / 12**2 + 1 / 24**2)
    assert row_of("leapfrog") == {
        "integrator": "leapfrog",
        "label": "Leapfrog",
        "composition": "BAB",
        "symmetric": "yes",
        "stages": 1,
        "order": 2,
        "Nystrom order": 2,
        "order for quartic V": 2,
        "order for cubic V": 2,
        "generalised order": "(2)",
        "Nystrom generalised order": "(2)",
        "harmonic order of position": 2,
        "harmonic order of momentum": 2,
        "harmonic order of energy": 2,
        "sum of absolute values": 2.0,
        "negative coefficients": 0,
        "leading error": 3,
        "leading error norm": pytest.approx(norm, rel=1e-14),
        "effective error": pytest.approx(norm**0.5, rel=1e-14),
        "Nystrom leading error": 3,
        "Nystrom leading error norm": pytest.approx(norm, rel=1e-14),
        "Nystrom effective error": pytest.approx(norm**0.5, rel=1e-14),
        "harmonic leading error": 3,
        "harmonic leading error norm": pytest.approx(sqrt(1 / 6**2 + 1 / 12**2), rel=1e-14),
        "stability limit": "2.000000000000",
        "stability limit per stage": "2.000000000000",
        "first gap closes": "inf",
        "unstable for good from": "2.000000000000",
        "guaranteed digits": 80,
    }


def test_ruth_sums_and_signs_follow_from_closed_form():
    """w = 1/(2 - 2^(1/3)): drifts w/2, (1 - w)/2 twice each, kicks w, 1 - 2w, w; three of seven are negative."""
    row, w = row_of("ruth"), 1 / (2 - 2 ** (1 / 3))
    assert row["sum of absolute values"] == pytest.approx(w + (w - 1) + 2 * w + (2 * w - 1), rel=1e-15)
    assert (row["composition"], row["stages"], row["order"], row["negative coefficients"]) == ("ABA", 3, 4, 3)
    assert row["effective error"] == pytest.approx(3 * row["leading error norm"] ** (1 / 4), rel=1e-14)
    assert row["Nystrom effective error"] == pytest.approx(3 * row["Nystrom leading error norm"] ** (1 / 4), rel=1e-14)
    assert row["leading error"] == row["Nystrom leading error"] == row["harmonic leading error"] == 5
    assert row["Nystrom leading error norm"] < row["leading error norm"]


def half_trace(tableau, tau):
    step = oscillator_step(tableau, tau)
    return (step[0, 0] + step[1, 1]) / 2


@pytest.mark.parametrize("name", ["ruth", "aba864", "babps9o7h"])
def test_edges_of_stability_are_where_trace_of_step_passes_two(name):
    row, tableau, near = row_of(name), integrators[name], mpf(10) ** -11
    edges = [mpf(row[key]) for key in ("stability limit", "first gap closes", "unstable for good from")]
    opens, closes, last = edges
    for edge, outwards in ((opens, 1), (closes, -1), (last, 1)):
        if edge != inf:
            inside, outside = (abs(half_trace(tableau, edge + way * near)) for way in (-outwards, outwards))
            assert inside < 1 < outside
    assert opens <= last
    assert (closes == inf) == (opens == last)
    assert abs(mpf(row["stability limit per stage"]) - opens / tableau.stages) < mpf(10) ** -12
    assert all(abs(half_trace(tableau, opens * i / 40)) < 1 for i in range(1, 40))


def test_table_1_has_the_value_beside_each_symbol():
    """Ruth, drift first: drifts c1 c2 c2 c1, kicks d1 d2 d1 and a padding 0; kick first the rows are exchanged."""
    header, rows = structure("ruth")
    columns = dict(zip(header, zip(*rows, strict=True), strict=True))
    ruth = integrators["ruth"]
    assert columns["ABA c"] == ("c_1 = c_4", "c_2 = c_3", "c_3 = c_2", "c_4 = c_1")
    assert columns["ABA d"] == ("d_1 = d_3", "d_2", "d_3 = d_1", "d_4 = 0")
    assert columns["ABA c value"] == columns["BAB d value"] == ruth.drift
    assert columns["ABA d value"] == columns["BAB c value"] == (*ruth.kick, "0")


def test_table_2_of_the_leapfrog_is_its_step():
    """Kick first, q = q_a + tau p_a - tau^2/2 q_a and p = p_a - tau q_a - tau^2/2 p_a + tau^3/4 q_a."""
    header, rows = recursion_values("leapfrog")
    assert header == ("h", "tau^0", "tau^1", "tau^2", "tau^3")
    assert rows == [(0, 1.0, "", "", ""), (1, 1.0, 1.0, -0.5, ""), ("p_b", 1.0, -1.0, -0.5, 0.25)]


def test_table_3_of_the_leapfrog_has_its_even_orders():
    header, rows = even_orders("leapfrog")
    cells = dict(zip(header, rows[-1], strict=True))
    assert [cells[key] for key in ("h", "tau^0", "tau^2", "tau^4", "tau^2 of Table 2")] == [1, 1.0, -0.5, 0.0, -0.5]


# --- Methods with kicks of a modified potential, and processed ones, in a config: from the plan to the figures.


METHODS = ("ruth", "rowlands", "chin_4a", "trained_modified")
GRID = {"lowest": 0.04, "highest": 0.4, "points_per_decade": 3}
CONFIG = {
    "name": "modified",
    "integrators": list(METHODS),
    "systems": {
        "sho": {"t_end": 20, "tau_per_stage": GRID},
        "henon_heiles": {"t_end": 20, "tau_per_stage": GRID, "precision": ["double", "extended"]},
    },
    "samples": 11,
}


@pytest.fixture(scope="module")
def cubes(tmp_path_factory):
    config, folder, found = load(CONFIG), tmp_path_factory.mktemp("modified"), {}
    for sweep in config.sweeps:
        files = {name: [] for name in config.methods}
        for name in config.methods:
            for index in range(shards_of(sweep, name)):
                made = integrate(sweep, name, index)["run"]
                files[name].append(folder / f"{sweep.system}_{name}_{index}.h5")
                write(files[name][-1], made.variables, made.attributes, made.groups, coordinates=made.coordinates)
        found[sweep.system] = reduce(sweep, config.methods, **files)["cube"]
    return found


@pytest.mark.filterwarnings("ignore:tau = .* runs as")
@pytest.mark.parametrize("system", ["sho", "henon_heiles"])
@pytest.mark.parametrize("name", METHODS)
def test_a_cube_has_the_errors_and_evaluations_of_single_runs(cubes, system, name):
    precision = str(cubes[system].precision.values[-1])
    runs = cubes[system].sel(integrator=name, precision=precision)
    for tau in runs.tau_per_stage.values.tolist():
        one = nh.integrate(system, name, tau * nh.integrators[name].stages, t_end=20, samples=11, precision=precision)
        same = runs.sel(tau_per_stage=tau)
        assert same.max_energy_error == one.max_energy_error
        assert same.evaluations == one.evaluations
        # Blocks of a run have one step more or less; the mean of blocks is one over steps.
        assert float(same.mean_energy_error) == pytest.approx(float(one.mean_energy_error), rel=0.1)


def test_role_that_modified_kick_does_not_have_has_no_terms():
    terms = decompose(METHODS)["cube"]
    drawn = fig2_decomposition(terms)
    assert drawn.legends
    plt.close("all")
    there = np.isfinite(terms.kappa).any("order").to_series()
    assert [bool(there["ruth", first]) for first in ("drift", "kick")] == [True, True]
    for name in METHODS[1:]:
        first = nh.integrators[name].first
        assert all(bool(there[name, role]) == (role == first) for role in ("drift", "kick"))


def test_table_of_all_methods_omits_entries_for_any_kinetic_energy():
    header, rows = overview("chin_4a", "ruth")
    chin, ruth = (dict(zip(header, row, strict=True)) for row in rows)
    empty = {"generalised order", "leading error", "leading error norm", "effective error"}
    assert {name for name in header if chin[name] == ""} == empty
    assert not any(ruth[name] == "" for name in header)
    assert (chin["order"], chin["Nystrom order"], chin["Nystrom leading error"]) == (4, 4, 5)


def test_config_with_system_without_modified_kicks_is_refused():
    systems = {"relativistic_oscillator": {"tau_per_stage": GRID}}
    with pytest.raises(SettingError, match="it requires a quadratic kinetic energy") as refused:
        load(CONFIG | {"integrators": ["ruth", "chin_4a"], "systems": systems})
    assert "integrator = 'chin_4a' is not allowed" in str(refused.value)
    with pytest.raises(SettingError, match=r"integrator = 'rowlands' .* oscillators solved exactly"):
        load(CONFIG | {"exact_oscillator": {"integrators": ["aba864", "rowlands"]}})


def test_what_measures_energy_at_every_step_leaves_processed_methods_out():
    config = load(CONFIG)
    assert config.methods == METHODS
    assert config.stepwise == ("ruth", "chin_4a", "trained_modified")
    assert "chin_4a" not in load(CONFIG | {"integrators": ["ruth"]}).compared
