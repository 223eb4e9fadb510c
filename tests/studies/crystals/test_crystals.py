"""Crystals: energies, forces and phonons against published numbers, loops against independent ones, leaders."""

from itertools import product

import numpy as np
import pytest
import xarray as xr

import nearharmonic as nh
from nearharmonic.errors import NearharmonicError
from nearharmonic.math import exp
from nearharmonic.numerics.compiled import Normal
from nearharmonic_studies.crystals import solids
from nearharmonic_studies.crystals.results import kind_of, reduction, trend, window_of
from nearharmonic_studies.crystals.run import SOLIDS, Start, delta, energies, energy_errors, start_of
from nearharmonic_studies.crystals.settings import CrystalsSettings
from nearharmonic_studies.crystals.solids import FCC, chain, cubic, halves

# --- Models of crystals: energies, forces and phonons against published numbers, closed forms and other programs.

SIZES = {"argon": 2, "copper": 2, "silicon": 1, "chain": 8}


def displaced(solid, size):
    return size * np.random.default_rng(7).normal(size=solid.coordinates)


def energy(solid, u):
    return solid.gradient(u, np.empty(solid.coordinates))


@pytest.mark.slow
@pytest.mark.parametrize("name", SIZES)
def test_forces_are_the_derivative_of_the_energy(name):
    """Central differences of V along a random direction: (g h)^2 / 24 of truncation, and rounding 1e-16 V / h."""
    solid = SOLIDS[name](SIZES[name])
    u, step = displaced(solid, 0.1), displaced(solid, 1e-4)[::-1].copy()
    out = np.empty(solid.coordinates)
    solid.gradient(u, out)
    slope = (energy(solid, u + step) - energy(solid, u - step)) / 2
    assert slope == pytest.approx(float(out @ step), rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("name", SIZES)
def test_a_crystal_at_rest_has_no_force_and_real_phonons(name):
    solid = SOLIDS[name](SIZES[name])
    out = np.empty(solid.coordinates)
    solid.gradient(np.zeros(solid.coordinates), out)
    assert np.abs(out).max() < 1e-12
    translations = 1 if name == "chain" else 3
    assert np.count_nonzero(solid.frequencies == 0) == translations


@pytest.mark.slow
@pytest.mark.parametrize(("name", "edge"), [("argon", "EDGE"), ("copper", "COPPER_EDGE"), ("silicon", "SILICON_EDGE")])
def test_edge_of_the_cell_minimises_the_energy(name, edge, monkeypatch):
    """Energies at edges 0.3 % apart, through which a parabola has its lowest point within 0.1 % of the edge."""
    energies, published = [], getattr(solids, edge)
    for factor in (0.997, 1.0, 1.003):
        monkeypatch.setattr(solids, edge, factor * published)
        solid = SOLIDS[name](SIZES[name])
        energies.append(energy(solid, np.zeros(solid.coordinates)))
    low, middle, high = energies
    assert abs(0.003 * (low - high) / (2 * (low - 2 * middle + high))) < 1e-3


@pytest.mark.slow
def test_energy_of_argon_is_that_of_all_pairs():
    """The pairs of four shells by a plain double loop over images, with the formula of the switched potential."""
    solid, edge = solids.argon(2), solids.EDGE * solids.DIAMETER
    u = displaced(solid, 0.15)
    sites = cubic(FCC, edge, 2)
    places, total = sites + u.reshape(-1, 3), 0.0
    for i, j, *image in product(range(32), range(32), *[(-2, -1, 0, 1, 2)] * 3):
        shift = 2 * edge * np.array(image)
        reach = np.linalg.norm(sites[j] + shift - sites[i]) / solids.DIAMETER
        r = np.linalg.norm(places[j] + shift - places[i]) / solids.DIAMETER
        if 0 < reach <= solids.REACH and r < solids.CUTOFF:
            x = max(0.0, (r - solids.SWITCH) / (solids.CUTOFF - solids.SWITCH))
            total += 2 * solids.DEPTH * (r**-12 - r**-6) * (1 - 10 * x**3 + 15 * x**4 - 6 * x**5)
    assert energy(solid, u) == pytest.approx(total, rel=1e-12)


@pytest.mark.slow
def test_silicon_has_the_published_energy_and_bulk_modulus(monkeypatch):
    """-4.3366 eV an atom (Stillinger & Weber 1985), 101.4 GPa (Balamane et al. 1992, doi:10.1103/PhysRevB.46.2250)."""
    assert energy(solids.silicon(1), np.zeros(24)) / 8 == pytest.approx(-4.3366, abs=1e-4)
    edge, values = solids.SILICON_EDGE, []
    for factor in (0.999, 1.0, 1.001):
        monkeypatch.setattr(solids, "SILICON_EDGE", factor * edge)
        values.append(energy(solids.silicon(1), np.zeros(24)))
    curvature = (values[0] - 2 * values[1] + values[2]) / (0.001 * edge) ** 2  # d2E/da2 = 9 V B / a^2
    assert curvature / (9 * edge) * 160.2177 == pytest.approx(101.4, rel=0.005)


@pytest.mark.slow
def test_copper_is_that_of_ase(monkeypatch):
    """Energies and forces of a displaced crystal; ASE's Bohr radius differs by 4e-10, and exponents are tens of it."""
    ase = pytest.importorskip("ase", reason="the oracle is the extra [ase]")
    from ase.calculators import emt

    class WithList(emt.EMT):
        """ASE's calculator, with the list of our model: four shells."""

        def _calc_cutoff(self, atoms):
            middle, _, steepness = super()._calc_cutoff(atoms)
            return middle, solids.COPPER_REACH, steepness

    monkeypatch.setattr(emt, "beta", solids.BETA)  # ASE rounds it to three decimals
    solid = solids.copper(2)
    sites, u = cubic(FCC, solids.COPPER_EDGE, 2), displaced(solid, 0.05)
    atoms = ase.Atoms("Cu32", positions=sites + u.reshape(-1, 3), cell=[2 * solids.COPPER_EDGE] * 3, pbc=True)
    atoms.calc = WithList(asap_cutoff=True)
    out = np.empty(solid.coordinates)
    assert solid.gradient(u, out) == pytest.approx(atoms.get_potential_energy(), rel=5e-8)
    assert np.abs(out + atoms.get_forces().ravel()).max() < 5e-8


@pytest.mark.slow
def test_phonons_of_the_chain_are_those_of_the_closed_form():
    """omega^2 = k (1/m + 1/M +- sqrt((1/m + 1/M)^2 - 4 sin^2(x/2) / (m M))), Born & Huang; six digits are kept."""
    cells, k = 8, 2 * solids.WIDTH**2
    total, product_ = 1 / solids.LIGHT + 1 / solids.HEAVY, solids.LIGHT * solids.HEAVY
    wave = 2 * np.pi * np.arange(cells) / cells
    root = np.sqrt(total**2 - 4 * np.sin(wave / 2) ** 2 / product_)
    squares = np.sort(np.concatenate([k * (total - root), k * (total + root)]))
    assert solids.chain(cells).frequencies == pytest.approx(np.sqrt(np.maximum(squares, 0)), rel=6e-6, abs=1e-6)


@pytest.mark.slow
def test_logarithm_is_the_inverse_of_the_exponential():
    for x in (0.3, 0.7, 1.0, 1.5, 2.5):
        assert solids.logarithm(x) == pytest.approx(np.log(x), abs=3e-16)


# --- Runs on crystals: loops against independent ones, harmonic limits, leaders and the cube.

CELLS = 4
SOLID = chain(CELLS)


def ring(q):
    """The chain as a formula of the package, which derives and compiles its force by itself."""
    n = 2 * CELLS
    return sum((1 - exp(-(q[(i + 1) % n] - q[i]))) ** 2 for i in range(n))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["leapfrog", "babs7o7h", "bcss_s4"])
def test_a_run_is_that_of_the_package(name):
    """Both round about ten times a force; 200 forces of a stable run lose three digits at most."""
    start, steps, tau = start_of(SOLID, 0.3, [1]), 50, 0.3
    system = nh.System(
        name="ring", V=ring, q0=[0.0] * 8, p0=[0.0] * 8, t_end=steps * tau, masses=[float(m) for m in SOLID.masses]
    )
    found = nh.integrate(system, name, tau, q0=start.u, p0=start.p, t_end=steps * tau, summation="plain")
    kinetic, potential = energies(SOLID, nh.integrators[name], tau, steps, start)[-1]
    q, p = found.q.values[-1], found.p.values[-1]
    assert kinetic == pytest.approx(sum(p * p / SOLID.masses) / 2, rel=1e-12)
    assert potential == pytest.approx(float(ring(tuple(q))), rel=1e-12)


@pytest.mark.slow
def test_without_friction_the_thermostatted_loop_is_the_other():
    start = start_of(SOLID, 0.3, [2])
    for name in ("leapfrog", "bcss_s4", "babs7o7h"):
        moves, kicks = halves(nh.integrators[name], 0.2)
        u, p, average = start.u.copy(), start.p.copy(), np.zeros(2)
        SOLID.loops.thermostatted(u, p, SOLID.masses, moves, kicks, False, 1.0, np.zeros((40, 8)), average)
        both = energies(SOLID, nh.integrators[name], 0.2, 40, start)
        assert average == pytest.approx(both[1:, ::-1].sum(axis=0), rel=1e-12)
        u, p, average = start.u.copy(), start.p.copy(), np.zeros(2)
        SOLID.loops.thermostatted(u, p, SOLID.masses, moves, kicks, True, 1.0, np.zeros((80, 8)), average)
        assert average == pytest.approx(both[1:, ::-1].sum(axis=0), rel=1e-12)


@pytest.mark.slow
def test_leapfrog_with_friction_samples_a_cold_crystal_exactly():
    """BAOAB has the exact mean potential energy for harmonic V at every step size; 6 standard errors of blocks."""
    energy, tau, normal = 1e-6, 0.25 * SOLID.period, Normal([3])
    keep = float(exp(-0.5 * tau))
    width = np.sqrt((1 - keep * keep) * energy * SOLID.masses)
    u, p = np.zeros(8), np.sqrt(energy * SOLID.masses) * normal.rows(1, 8)[0]
    moves, kicks = halves(nh.integrators["leapfrog"], tau)
    blocks = np.zeros((40, 2))
    for block in blocks:
        SOLID.loops.thermostatted(u, p, SOLID.masses, moves, kicks, False, keep, width * normal.rows(4000, 8), block)
    potential = blocks[2:, 0] / (4000 * 7 * energy / 2)  # seven modes; the eighth moves the chain as a whole
    assert abs(potential.mean() - 1) < 6 * potential.std(ddof=1) / np.sqrt(len(potential))
    assert potential.std(ddof=1) / np.sqrt(len(potential)) < 0.01


@pytest.mark.slow
def test_starts_have_the_temperature_and_rest():
    """Means over 300 starts of seven modes: a relative error of sqrt(2 / 2100) = 3 %, five times that."""
    found = [start_of(SOLID, 1e-6 / SOLID.melting, [4, k]) for k in range(300)]
    kinetic = np.mean([np.sum(p * p / SOLID.masses) / 2 for _, p in found])
    potential = np.mean([SOLID.gradient(u, np.empty(8)) for u, _ in found])
    assert kinetic == pytest.approx(7 * 1e-6 / 2, rel=0.15)
    assert potential == pytest.approx(7 * 1e-6 / 2, rel=0.15)
    assert max(abs(p.sum()) for _, p in found) < 1e-15


@pytest.mark.slow
def test_leapfrog_loses_energy_as_on_an_oscillator():
    """A cold chain is harmonic: a quarter of the step has a sixteenth of the error, to 10 % at these steps."""
    start = [start_of(SOLID, 1e-6, [6])]
    leapfrog = nh.integrators["leapfrog"]
    (coarse,), (fine,) = (energy_errors(SOLID, leapfrog, forces, 30, start)[0] for forces in (25, 100))
    assert coarse / fine == pytest.approx(16, rel=0.1)


def test_hessian_varies_in_proportion_to_the_amplitude():
    cold, warm = (delta(SOLID, start_of(SOLID, t, [7]), 1) for t in (1e-6, 1e-4))
    assert warm / cold == pytest.approx(10, rel=0.2)
    assert delta(SOLID, Start(np.zeros(8), np.zeros(8)), 1) < 1e-9


def made_runs():
    errors = np.array(
        [[[1e-3, 2e-3, 3e-3], [1e-4, 1e-4, 1e-4], [2e-5, 1e-5, 4e-5]], [[0.5] * 3, [np.inf] * 3, [0.7] * 3]]
    )
    return xr.Dataset(
        {
            "max_energy_error": (
                ("temperature", "integrator", "forces", "start"),
                errors[:, :, None, :],
                {"long_name": "e"},
            )
        },
        coords={"temperature": [0.1, 1], "integrator": ["leapfrog", "babs7o7h", "trained_light"], "forces": [10.0]},
    )


def test_leader_has_the_smallest_median_and_leads_another_kind():
    found = reduction.of(made_runs(), over="start")
    assert found.leader.values.ravel().tolist() == ["trained_light", ""]
    assert found.lead.values[0, 0] == pytest.approx(np.log10(1e-4 / 2e-5))
    assert np.isnan(found.lead.values[1, 0])
    assert found.max_energy_error.sel(quantile=0.5).values[0, :, 0].tolist() == [2e-3, 1e-4, 2e-5]


def test_method_that_is_not_registered_leads_nowhere():
    runs = made_runs()
    more = (runs.isel(integrator=[2]) * 0.1).assign_coords(integrator=["trained_on_crystals"])
    found = reduction.of(xr.concat([runs, more], "integrator", combine_attrs="override"), over="start")
    assert found.leader.values.ravel().tolist() == ["trained_light", ""]
    assert found.max_energy_error.sel(quantile=0.5).values[0, 3, 0] == pytest.approx(2e-6)
    assert kind_of("trained_on_crystals") == "trained on crystals"


def test_kinds_and_windows_come_from_the_registered_methods():
    assert [kind_of(one) for one in ("bcss_s4", "babps8o7h", "babs8o6_7h", "trained_fine")] == [
        "general", "paper", "paper", "trained",
    ]  # fmt: skip
    assert window_of("trained_coarse") == (0.15, 0.235)
    assert np.isnan(window_of("leapfrog")).all()


def test_trend_of_a_straight_line_is_its_rise():
    look = np.arange(0, 101, 5)
    lines = xr.DataArray([0.3 * look + 2, -0.1 * look], dims=("run", "look"), coords={"look": look})
    assert trend(lines).values == pytest.approx([30, -10])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"integrators": ("leapfrog", "rnia12", "takahashi")}, "takahashi"),
        ({"integrators": ("leapfrog", "rowlands")}, "without modified potentials"),
        ({"crystals": ("argn",)}, "Did you mean 'argon'"),
    ],
)
def test_settings_that_cannot_run_are_named(changes, words):
    with pytest.raises(NearharmonicError, match=words):
        CrystalsSettings(**changes).check((), ())
