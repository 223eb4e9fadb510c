"""Models of crystals: energies, forces and phonons against published numbers, closed forms and other programs."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from nearharmonic_studies.crystals import solids
from nearharmonic_studies.crystals.run import SOLIDS
from nearharmonic_studies.crystals.solids import FCC, cubic

pytestmark = pytest.mark.slow  # numba compiles each force

SIZES = {"argon": 2, "copper": 2, "silicon": 1, "chain": 8}


def displaced(solid, size):
    return size * np.random.default_rng(7).normal(size=solid.coordinates)


def energy(solid, u):
    return solid.gradient(u, np.empty(solid.coordinates))


@pytest.mark.parametrize("name", SIZES)
def test_forces_are_the_derivative_of_the_energy(name):
    """Central differences of V along a random direction: (g h)^2 / 24 of truncation, and rounding 1e-16 V / h."""
    solid = SOLIDS[name](SIZES[name])
    u, step = displaced(solid, 0.1), displaced(solid, 1e-4)[::-1].copy()
    out = np.empty(solid.coordinates)
    solid.gradient(u, out)
    slope = (energy(solid, u + step) - energy(solid, u - step)) / 2
    assert slope == pytest.approx(float(out @ step), rel=1e-5)


@pytest.mark.parametrize("name", SIZES)
def test_a_crystal_at_rest_has_no_force_and_real_phonons(name):
    solid = SOLIDS[name](SIZES[name])
    out = np.empty(solid.coordinates)
    solid.gradient(np.zeros(solid.coordinates), out)
    assert np.abs(out).max() < 1e-12
    translations = 1 if name == "chain" else 3
    assert np.count_nonzero(solid.frequencies == 0) == translations


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


def test_silicon_has_the_published_energy_and_bulk_modulus(monkeypatch):
    """-4.3366 eV an atom (Stillinger & Weber 1985), 101.4 GPa (Balamane et al. 1992, doi:10.1103/PhysRevB.46.2250)."""
    assert energy(solids.silicon(1), np.zeros(24)) / 8 == pytest.approx(-4.3366, abs=1e-4)
    edge, values = solids.SILICON_EDGE, []
    for factor in (0.999, 1.0, 1.001):
        monkeypatch.setattr(solids, "SILICON_EDGE", factor * edge)
        values.append(energy(solids.silicon(1), np.zeros(24)))
    curvature = (values[0] - 2 * values[1] + values[2]) / (0.001 * edge) ** 2  # d2E/da2 = 9 V B / a^2
    assert curvature / (9 * edge) * 160.2177 == pytest.approx(101.4, rel=0.005)


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


def test_phonons_of_the_chain_are_those_of_the_closed_form():
    """omega^2 = k (1/m + 1/M +- sqrt((1/m + 1/M)^2 - 4 sin^2(x/2) / (m M))), Born & Huang; six digits are kept."""
    cells, k = 8, 2 * solids.WIDTH**2
    total, product_ = 1 / solids.LIGHT + 1 / solids.HEAVY, solids.LIGHT * solids.HEAVY
    wave = 2 * np.pi * np.arange(cells) / cells
    root = np.sqrt(total**2 - 4 * np.sin(wave / 2) ** 2 / product_)
    squares = np.sort(np.concatenate([k * (total - root), k * (total + root)]))
    assert solids.chain(cells).frequencies == pytest.approx(np.sqrt(np.maximum(squares, 0)), rel=6e-6, abs=1e-6)


def test_logarithm_is_the_inverse_of_the_exponential():
    for x in (0.3, 0.7, 1.0, 1.5, 2.5):
        assert solids.logarithm(x) == pytest.approx(np.log(x), abs=3e-16)
