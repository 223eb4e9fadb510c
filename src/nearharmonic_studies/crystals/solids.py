"""Crystals as mechanical systems: masses, gradients of V, phonons at rest, and the loops over their steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import log, nan, sqrt
from typing import Any, NamedTuple

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.compiled import compiled, exponential
from nearharmonic.numerics.portable import Floats

# --- A crystal as a mechanical system: masses, the gradient of V in displacements, and its phonons at rest.

#: Boltzmann constant in eV/K (exact in the SI of 2019), and the unit of time, Angstrom (u/eV)^(1/2), in femtoseconds.
BOLTZMANN, FEMTOSECONDS = 8.617333262e-5, 10.180505710

#: Displacement of the difference of gradients that gives the Hessian, in units of length: truncation ~ 1e-6 of it.
DIFFERENCE = 1e-4


@dataclass(frozen=True)
class Solid:
    """A crystal.

    ``name``, ``label``, ``source``: name, name in figures, and origin of the potential. ``masses`` (n,): mass
    of each coordinate. ``gradient(u, out)``: numba function that writes dV/du (n,) into ``out`` and
    returns V. ``melting``: k_B T at the melting point, in units of energy. ``unit``: unit of time in femtoseconds; NaN
    for a model without units.
    """

    name: str
    label: str
    masses: Floats
    gradient: Callable[[Floats, Floats], float]
    melting: float
    unit: float
    source: str

    @property
    def coordinates(self) -> int:
        """Number of coordinates, n."""
        return len(self.masses)

    def hessian(self, u: Floats) -> Floats:
        """Return the Hessian (n, n) of V at u with inverse masses, whose eigenvalues are squares of frequencies."""
        n, columns = self.coordinates, []
        above, below, moved = np.empty(n), np.empty(n), u.copy()
        for k in range(n):
            for sign, out in ((1.0, above), (-1.0, below)):
                moved[k] = u[k] + sign * DIFFERENCE
                self.gradient(moved, out)
            moved[k] = u[k]
            columns.append((above - below) / (2 * DIFFERENCE))
        weights = 1 / np.sqrt(self.masses)
        found = np.array(columns) * weights[:, None] * weights[None, :]
        return (found + found.T) / 2

    @cached_property
    def frequencies(self) -> Floats:
        """Angular frequencies (n,) of the phonons at rest, ascending, to six digits; translations have 0.

        LAPACK rounds differently on other processors, by much less than the last of six digits.
        """
        squares = np.linalg.eigvalsh(self.hessian(np.zeros(self.coordinates)))
        kept = np.where(squares > 1e-6 * squares[-1], squares, 0.0)
        return np.array([float(f"{one:.6g}") for one in np.sqrt(kept)])

    @cached_property
    def loops(self) -> Loops:
        """Loops over steps, compiled for its gradient."""
        return loops_for(self.gradient)

    @property
    def period(self) -> float:
        """Period of the fastest phonon."""
        return 2 * np.pi / float(self.frequencies[-1])


# --- Sites of crystals, and pairs of neighbours as fixed vectors between sites.
#
# Forces depend on displacements u from the sites: the vector between two neighbours is a fixed vector plus the
# difference of their displacements. The lists are made once, because atoms of a crystal do not leave their sites.

FCC = ((0.0, 0.0, 0.0), (0.0, 0.5, 0.5), (0.5, 0.0, 0.5), (0.5, 0.5, 0.0))
DIAMOND = (*FCC, *((x + 0.25, y + 0.25, z + 0.25) for x, y, z in FCC))


class Pairs(NamedTuple):
    """Pairs of neighbours: their first coordinates 3i and 3j, and the vectors from site i to site j."""

    i: np.ndarray
    j: np.ndarray
    vector: Floats


def cubic(basis: tuple[tuple[float, float, float], ...], constant: float, cells: int) -> Floats:
    """Return the sites (N, 3) of cells^3 cubic cells with an edge ``constant``."""
    corners = np.array(list(product(range(cells), repeat=3)), float)
    sites: Floats = (corners[:, None, :] + np.array(basis)).reshape(-1, 3) * constant
    return sites


def pairs_within(sites: Floats, edge: float, reach: float, *, both: bool = False) -> Pairs:
    """Return the pairs of sites in a periodic cube whose distance is at most ``reach``, images included.

    Each pair is listed once, or once for each of its sites if ``both``.
    """
    images = range(-int(reach / edge) - 1, int(reach / edge) + 2)
    found = []
    for image in product(images, repeat=3):
        vector = sites[None, :, :] + edge * np.array(image) - sites[:, None, :]
        square = vector[..., 0] ** 2 + vector[..., 1] ** 2 + vector[..., 2] ** 2
        for i, j in zip(*np.nonzero((square <= reach * reach) & (square > 0)), strict=True):
            if both or i < j or (i == j and image > (0, 0, 0)):
                found.append((3 * i, 3 * j, *vector[i, j]))
    found.sort()
    rows = np.array(found)
    # Unsigned, or each access would first ask whether an index counts from the end.
    first, second = (rows[:, c].astype(np.uint64) for c in (0, 1))
    return Pairs(first, second, np.ascontiguousarray(rows[:, 2:]))


@compiled
def pull(out, i, j, slope, vectors, k):  # type: ignore[no-untyped-def]
    """Add the gradient of pair k: ``slope`` times ``vectors[:, k]`` at j, and the opposite at i."""
    for c in range(3):
        out[j + c] += slope * vectors[c, k]
        out[i + c] -= slope * vectors[c, k]


#: Depth in eV (119.8 K) and diameter in Angstrom: Rahman (1964), Phys. Rev. 136, A405.
DEPTH, DIAMETER = 119.8 * BOLTZMANN, 3.405
#: The potential is switched off from the first to the second distance, in diameters. Forces act between neighbours
#: whose sites are nearer than the third: four shells, 54 neighbours.
SWITCH, CUTOFF, REACH = 2.0, 2.25, 2.3
#: Edge of the cubic cell without pressure at 0 K, with this cut-off, in diameters.
EDGE = 1.5519


# --- Argon: the Lennard-Jones potential with a switched cut-off on a face-centred cubic lattice.
@compiled
def pair(square):  # type: ignore[no-untyped-def]
    """Return the energy of a pair at a squared distance, in units of depth and diameter, and its derivative by it."""
    inverse = 1.0 / square
    s6 = inverse * inverse * inverse
    energy, slope = 4.0 * s6 * (s6 - 1.0), -12.0 * s6 * (2.0 * s6 - 1.0) * inverse
    distance = sqrt(square)
    x = (distance - SWITCH) / (CUTOFF - SWITCH)
    left = 1.0 + x * x * x * (-10.0 + x * (15.0 - 6.0 * x))
    falls = -30.0 * x * x * (1.0 - x) * (1.0 - x) / (CUTOFF - SWITCH)
    near, far = square <= SWITCH * SWITCH, square >= CUTOFF * CUTOFF
    switched = 0.0 if far else slope * left + energy * falls / (2.0 * distance)
    slope = slope if near else switched
    energy *= 1.0 if near else (0.0 if far else left)
    return energy, slope


def gradient_of(pairs: Pairs) -> Any:
    """Return the gradient of the energy, compiled, for a list of pairs in Angstrom; energies in eV."""
    first, second, scale = pairs.i, pairs.j, 1.0 / DIAMETER
    between = np.ascontiguousarray(pairs.vector.T) / DIAMETER
    count = len(first)

    @compiled
    def gradient(u, out):  # type: ignore[no-untyped-def]
        out[:] = 0.0
        d, slopes, energies = np.empty((3, count)), np.empty(count), np.empty(count)
        for k in range(count):
            i, j = first[k], second[k]
            for c in range(3):
                d[c, k] = between[c, k] + (u[j + c] - u[i + c]) * scale
        # Several pairs in a vector.
        for k in range(count):
            energies[k], slopes[k] = pair(d[0, k] * d[0, k] + d[1, k] * d[1, k] + d[2, k] * d[2, k])
            slopes[k] *= 2.0 * DEPTH * scale
        total = 0.0
        for k in range(count):
            i, j = first[k], second[k]
            total += energies[k]
            pull(out, i, j, slopes[k], d, k)
        return DEPTH * total

    return gradient


def argon(cells: int) -> Solid:
    """Return a crystal of 4 cells^3 atoms."""
    edge = EDGE * DIAMETER
    sites = cubic(FCC, edge, cells)
    return Solid(
        name="argon",
        label="argon (Lennard-Jones)",
        masses=np.full(sites.size, 39.948),
        gradient=gradient_of(pairs_within(sites, cells * edge, REACH * DIAMETER)),
        melting=83.8 * BOLTZMANN,
        unit=FEMTOSECONDS,
        source="Rahman (1964), Phys. Rev. 136, A405, doi:10.1103/PhysRev.136.A405",
    )


# --- A chain of two masses in turns, whose neighbours are bound by Morse's potential.

#: Masses in turns, and the inverse width of the bond; its depth is 1.
LIGHT, HEAVY, WIDTH = 1.0, 3.0, 1.0
#: k_B T in place of a melting point, which a chain does not have: a tenth of the depth of a bond.
HIGHEST = 0.1


def chain_gradient_of(sites: int) -> Any:
    """Return the gradient of V = sum (1 - exp(-a d))^2 over the bonds of a ring, compiled."""

    @compiled
    def gradient(u, out):  # type: ignore[no-untyped-def]
        left = np.empty(sites)
        for i in range(sites - 1):
            left[i] = exponential(-WIDTH * (u[i + 1] - u[i]))
        left[sites - 1] = exponential(-WIDTH * (u[0] - u[sites - 1]))
        before, total = 0.0, 0.0
        for i in range(sites):
            total += (1.0 - left[i]) * (1.0 - left[i])
            slope = 2.0 * WIDTH * left[i] * (1.0 - left[i])
            out[i] = before - slope
            before = slope
        out[0] += before
        return total

    return gradient


def chain(cells: int) -> Solid:
    """Return a ring of 2 ``cells`` masses."""
    return Solid(
        name="chain",
        label="diatomic chain (Morse)",
        masses=np.array([LIGHT, HEAVY] * cells),
        gradient=chain_gradient_of(2 * cells),
        melting=HIGHEST,
        unit=nan,
        source="Morse (1929), Phys. Rev. 34, 57, doi:10.1103/PhysRev.34.57",
    )


# --- Copper: effective medium theory on a face-centred cubic lattice.

BOHR = 0.529177210903
#: Parameters of Jacobsen, Stoltze and Norskov (1996): eV, Angstrom, 1/Angstrom; beta is (16 pi / 3)^(1/3) / sqrt 2.
E0, S0, V0, ETA, KAPPA, LAMBDA = -3.51, 2.67 * BOHR, 2.476, 1.652 / BOHR, 2.740 / BOHR, 1.906 / BOHR
BETA = 1.809399790563555
#: Centre of the smooth cut-off, between the third and the fourth shell, and its inverse width.
MIDDLE = BETA * S0 * 0.5 * (sqrt(3) + sqrt(4))
STEEP = log(9999.0) / (MIDDLE * 2 * sqrt(4) / (sqrt(3) + sqrt(4)) - MIDDLE)
COPPER_REACH = MIDDLE + 0.5
#: Edge of the cubic cell at the minimum of the energy, in Angstrom.
COPPER_EDGE = 3.5937


def _shells(decay: float) -> float:
    """Sum over the first three shells at the equilibrium distance: it makes the sum over neighbours 12 there."""
    distances = [BETA * S0 * sqrt(n) for n in (1, 2, 3)]
    counts = (12, 6, 24)
    return sum(
        count / 12 / (1 + float(np.exp(STEEP * (one - MIDDLE)))) * float(np.exp(-decay * (one - BETA * S0)))
        for count, one in zip(counts, distances, strict=True)
    )


GAMMA_1, GAMMA_2 = _shells(ETA), _shells(KAPPA / BETA)


def copper_gradient_of(atoms: int, pairs: Pairs) -> Any:
    """Return the gradient of the energy, compiled, for a list of pairs in Angstrom; energies in eV."""
    first, second, between, count = pairs.i, pairs.j, np.ascontiguousarray(pairs.vector.T), len(pairs.i)
    atom_i, atom_j = first // 3, second // 3

    @compiled
    def gradient(u, out):  # type: ignore[no-untyped-def]
        out[:] = 0.0
        d, density = np.empty((3, count)), np.zeros(atoms)
        sigma, pair, slopes, pulls = np.empty(count), np.empty(count), np.empty(count), np.empty(count)
        for k in range(count):
            i, j = first[k], second[k]
            for c in range(3):
                d[c, k] = between[c, k] + u[j + c] - u[i + c]
        # Several pairs in a vector.
        for k in range(count):
            r = sqrt(d[0, k] * d[0, k] + d[1, k] * d[1, k] + d[2, k] * d[2, k])
            rise = exponential(STEEP * (r - MIDDLE))
            kept = 1.0 / (1.0 + rise)
            falls = -STEEP * rise * kept
            sigma[k] = exponential(-ETA * (r - BETA * S0)) * kept / GAMMA_1
            pair[k] = V0 * exponential(-KAPPA * (r / BETA - S0)) * kept / GAMMA_2
            slopes[k], pulls[k] = sigma[k] * (falls - ETA), -pair[k] * (falls - KAPPA / BETA)
            d[0, k], d[1, k], d[2, k] = d[0, k] / r, d[1, k] / r, d[2, k] / r
        total = 0.0
        for k in range(count):
            i, j = first[k], second[k]
            density[atom_i[k]] += sigma[k]
            density[atom_j[k]] += sigma[k]
            total -= pair[k]
            pull(out, i, j, pulls[k], d, k)
        for atom in range(atoms):
            scale = -logarithm(density[atom] / 12.0) / (BETA * ETA)
            x = LAMBDA * scale
            fall, repelled = exponential(-x), 6.0 * V0 * exponential(-KAPPA * scale)
            total += E0 * ((1.0 + x) * fall - 1.0) + repelled
            density[atom] = -(-E0 * x * fall * LAMBDA - KAPPA * repelled) / (BETA * ETA * density[atom])
        for k in range(count):
            i, j = first[k], second[k]
            pull(out, i, j, (density[atom_i[k]] + density[atom_j[k]]) * slopes[k], d, k)
        return total

    return gradient


@compiled
def logarithm(x):  # type: ignore[no-untyped-def]
    """Return the logarithm of a number near 1 by Newton's method on :func:`exponential`, equal on every processor."""
    y = (x - 1.0) / (0.5 * (x + 1.0))
    for _ in range(4):
        left = exponential(y)
        y += 2.0 * (x - left) / (x + left)
    return y


def copper(cells: int) -> Solid:
    """Return a crystal of 4 cells^3 atoms."""
    sites = cubic(FCC, COPPER_EDGE, cells)
    return Solid(
        name="copper",
        label="copper (effective medium theory)",
        masses=np.full(sites.size, 63.546),
        gradient=copper_gradient_of(len(sites), pairs_within(sites, cells * COPPER_EDGE, COPPER_REACH)),
        melting=1358 * BOLTZMANN,
        unit=FEMTOSECONDS,
        source="Jacobsen, Stoltze & Norskov (1996), Surf. Sci. 366, 394, doi:10.1016/0039-6028(96)00816-3",
    )


# --- Silicon: the potential of Stillinger and Weber on a diamond lattice.

#: Depth in eV and length in Angstrom; cut-off, and coefficients of pairs and triplets, in these units.
SILICON_DEPTH, LENGTH, SILICON_CUTOFF = 2.16826, 2.0951, 1.80
A, B, TRIPLETS, DECAY = 7.049556277, 0.6022245584, 21.0, 1.20
#: Edge of the cubic cell at the minimum of the energy, in Angstrom, and the distance to which neighbours are listed.
SILICON_EDGE, SILICON_REACH = 5.43095, 4.5


def silicon_gradient_of(atoms: int, pairs: Pairs) -> Any:
    """Return the gradient of the energy, compiled, for the neighbours of each atom in Angstrom; energies in eV."""
    _, second, vector = pairs
    each = len(second) // atoms

    @compiled
    def gradient(u, out):  # type: ignore[no-untyped-def]
        out[:] = 0.0
        total = 0.0
        near, d, r, factor = np.empty(each, np.int64), np.empty((each, 3)), np.empty(each), np.empty(each)
        for atom in range(atoms):
            i, count = 3 * atom, 0
            for k in range(atom * each, (atom + 1) * each):
                j, square = second[k], 0.0
                for c in range(3):
                    d[count, c] = (vector[k, c] + u[j + c] - u[i + c]) / LENGTH
                    square += d[count, c] * d[count, c]
                if square < SILICON_CUTOFF * SILICON_CUTOFF:
                    r[count], near[count] = sqrt(square), j
                    count += 1
            for a in range(count):
                left, j = 1.0 / (r[a] - SILICON_CUTOFF), near[a]
                tail, fourth = exponential(left), B / (r[a] * r[a] * r[a] * r[a])
                # Each pair is met at both of its atoms: half of its energy here, half of its force on each.
                total += 0.5 * A * (fourth - 1.0) * tail
                slope = 0.5 * A * tail * (-4.0 * fourth / r[a] - (fourth - 1.0) * left * left) / r[a]
                for c in range(3):
                    out[j + c] += slope * d[a, c]
                    out[i + c] -= slope * d[a, c]
                factor[a] = exponential(DECAY * left)
            for a in range(count):
                for b in range(a):
                    cosine = (d[a, 0] * d[b, 0] + d[a, 1] * d[b, 1] + d[a, 2] * d[b, 2]) / (r[a] * r[b])
                    angle = cosine + 1.0 / 3.0
                    size = TRIPLETS * factor[a] * factor[b]
                    total += size * angle * angle
                    bend, left_a, left_b = (
                        2.0 * size * angle,
                        1.0 / (r[a] - SILICON_CUTOFF),
                        1.0 / (r[b] - SILICON_CUTOFF),
                    )
                    along_a = -size * angle * angle * DECAY * left_a * left_a / r[a] - bend * cosine / (r[a] * r[a])
                    along_b = -size * angle * angle * DECAY * left_b * left_b / r[b] - bend * cosine / (r[b] * r[b])
                    across = bend / (r[a] * r[b])
                    for c in range(3):
                        on_a = along_a * d[a, c] + across * d[b, c]
                        on_b = along_b * d[b, c] + across * d[a, c]
                        out[near[a] + c] += on_a
                        out[near[b] + c] += on_b
                        out[i + c] -= on_a + on_b
        for k in range(len(out)):
            out[k] *= SILICON_DEPTH / LENGTH
        return SILICON_DEPTH * total

    return gradient


def silicon(cells: int) -> Solid:
    """Return a crystal of 8 cells^3 atoms."""
    sites = cubic(DIAMOND, SILICON_EDGE, cells)
    return Solid(
        name="silicon",
        label="silicon (Stillinger-Weber)",
        masses=np.full(sites.size, 28.085),
        gradient=silicon_gradient_of(len(sites), pairs_within(sites, cells * SILICON_EDGE, SILICON_REACH, both=True)),
        melting=1687 * BOLTZMANN,
        unit=FEMTOSECONDS,
        source="Stillinger & Weber (1985), Phys. Rev. B 31, 5262, doi:10.1103/PhysRevB.31.5262",
    )


# --- Loops over steps of a crystal, compiled for its gradient, with and without friction and noise.
#
# The force at the end of a step serves the next first kick, and its evaluation also gives V there: the energy after
# each step costs nothing if a step begins with a kick.


class Loops(NamedTuple):
    """Compiled loops of one crystal.

    ``run(u, p, masses, kicks_first, outer, inner, steps, every, energies)``: steps without thermostat from (u,
    p), which hold the state at the end. ``energies`` (k, 2) takes kinetic and potential energy at the start and after
    each ``every`` steps. ``thermostatted(u, p, masses, moves, kicks, ends, keep, noise, average)``:
    symmetric steps with friction and noise, which multiply p by ``keep`` and add a row of ``noise``. ``moves`` and
    ``kicks`` are the first half of a step. The bath acts in the middle of each step, with one row, or at both ends,
    with two. ``average`` (2,) gains the sums of V and of K after each step.
    """

    run: Callable[..., None]
    thermostatted: Callable[..., None]


@compiled
def _kinetic(p, masses):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(len(p)):
        total += p[k] * p[k] / masses[k]
    return total / 2


@compiled
def _drift(u, p, masses, time):  # type: ignore[no-untyped-def]
    for k in range(len(u)):
        u[k] += time * p[k] / masses[k]


@compiled
def _kick(p, slopes, time):  # type: ignore[no-untyped-def]
    for k in range(len(p)):
        p[k] -= time * slopes[k]


@compiled
def _bath(p, keep, noise):  # type: ignore[no-untyped-def]
    for k in range(len(p)):
        p[k] = keep * p[k] + noise[k]


def loops_for(gradient: Any) -> Loops:
    """Compile both loops for a gradient."""

    @compiled
    def run(u, p, masses, kicks_first, outer, inner, steps, every, energies):  # type: ignore[no-untyped-def]
        slopes = np.empty(len(u))
        potential = gradient(u, slopes)
        energies[0, 0], energies[0, 1] = _kinetic(p, masses), potential
        for step in range(1, steps + 1):
            for m in range(len(inner)):
                if kicks_first:
                    _kick(p, slopes, outer[m])
                    _drift(u, p, masses, inner[m])
                else:
                    _drift(u, p, masses, outer[m])
                potential = gradient(u, slopes)
                if not kicks_first:
                    _kick(p, slopes, inner[m])
            if kicks_first:
                _kick(p, slopes, outer[-1])
            else:
                _drift(u, p, masses, outer[-1])
            if step % every == 0:
                if not kicks_first:
                    potential = gradient(u, slopes)
                energies[step // every, 0], energies[step // every, 1] = _kinetic(p, masses), potential

    @compiled
    def thermostatted(u, p, masses, moves, kicks, ends, keep, noise, average):  # type: ignore[no-untyped-def]
        slopes = np.empty(len(u))
        stale = True
        half, rows = len(moves), 2 if ends else 1
        for step in range(len(noise) // rows):
            if ends:
                _bath(p, keep, noise[2 * step])
            for m in range(2 * half):
                if m == half and not ends:
                    _bath(p, keep, noise[step])
                k = min(m, 2 * half - 1 - m)
                if kicks[k]:
                    if stale:
                        gradient(u, slopes)
                        stale = False
                    _kick(p, slopes, moves[k])
                else:
                    _drift(u, p, masses, moves[k])
                    stale = True
            if ends:
                _bath(p, keep, noise[2 * step + 1])
            average[0] += gradient(u, slopes)
            average[1] += _kinetic(p, masses)
            stale = False

    return Loops(run, thermostatted)


def halves(tableau: Tableau, tau: float) -> tuple[Floats, np.ndarray]:
    """Return the moves of the first half of a symmetric step, the middle one cut in two, and which of them kick."""
    outer, inner = tableau.rows_double()
    row = [c for pair in zip(outer, (*inner, 0.0), strict=True) for c in pair][:-1]
    half = row[: len(row) // 2 + 1]
    half[-1] /= 2
    kicks = [(k % 2 == 0) == (tableau.first == "kick") for k in range(len(half))]
    return tau * np.array(half), np.array(kicks)


def at_rest(p: Floats, masses: Floats) -> Floats:
    """Remove the motion of the centre of mass: three components, or one for the masses of a chain."""
    dimension = 3 if np.array_equal(masses[::3], masses[1::3][: len(masses[::3])]) else 1
    momenta, weights = p.reshape(-1, dimension), masses.reshape(-1, dimension)
    found: Floats = momenta - weights * (momenta.sum(axis=0) / weights.sum(axis=0))
    return found.ravel()
