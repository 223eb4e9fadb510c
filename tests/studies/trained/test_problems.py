"""Problems of training and of the comparison: potentials, starts, units, and the distributions of draws."""

from math import cos, erf, exp, pi, sin, sqrt

import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.optimize import minimize
from scipy.stats import kstest, norm

from nearharmonic.training.objective import Ensemble
from nearharmonic_studies.trained import problems
from nearharmonic_studies.trained import problems as made

# --- Systems with a name: their formulas against closed forms and published numbers, their starts, their units.

BY_NAME = {one.name: one for one in problems.NAMED}


def potential(name, q):
    """V by the formulas of textbooks, in numpy."""
    wall = np.diff(np.concatenate([[0], q, [0]]))
    r6 = (1 + wall) ** -6.0
    return {
        "pendulum": 1 - cos(q[0]),
        "morse": 1 - 2 * exp(-q[0]) + exp(-2 * q[0]),
        "quartic_well": (q @ q) / 2 + problems.WELL * (q @ q) ** 2,
        "henon_heiles": (q @ q) / 2 + q[0] ** 2 * q[-1] - q[-1] ** 3 / 3,
        "toda": (np.exp(q - np.roll(q, -1)) - 1).sum(),
        "lennard_jones": (r6 * r6 - 2 * r6 + 1).sum() / 72,
        "fput_alpha": (wall**2 / 2 + problems.ALPHA * wall**3 / 3).sum(),
        "fput_beta": (wall**2 / 2 + problems.BETA * wall**4 / 4).sum(),
    }[name]


#: The largest frequency of small oscillations: of springs between fixed ends 2 cos(pi / (2 n + 2)), of a ring 2.
FASTEST = {
    "pendulum": 1.0, "morse": sqrt(2), "quartic_well": 1.0, "henon_heiles": 1.0, "toda": 2.0,
    "lennard_jones": 2 * cos(pi / (2 * problems.ATOMS + 2)), "fput_alpha": 2 * cos(pi / (2 * problems.CHAIN_SITES + 2)),
    "fput_beta": 2 * cos(pi / (2 * problems.CHAIN_SITES + 2)),
}  # fmt: skip


@pytest.mark.parametrize("name", BY_NAME)
def test_potentials_are_those_of_textbooks_and_rest_at_0(name):
    one = BY_NAME[name]
    random = np.random.default_rng(3)
    for scale in (0.0, 0.05, 0.2):
        q = random.normal(size=one.dimension) * scale
        assert one.system().V(tuple(q)) == pytest.approx(potential(name, q), rel=1e-9, abs=1e-15)
    here = np.zeros(one.dimension)
    h = 1e-5
    for i in range(one.dimension):
        step = h * np.eye(one.dimension)[i]
        assert abs(potential(name, here + step) - potential(name, here - step)) < 1e-14


@pytest.mark.parametrize("name", BY_NAME)
def test_hessians_are_second_differences_of_the_potential(name):
    """Error of fourth order in the spacing, h^4 times sixth derivatives, and rounding of V over h^2: 1e-6."""
    one = BY_NAME[name]
    q = np.random.default_rng(4).normal(size=one.dimension) * 0.05
    found, h = problems.hessians(one.system(), q[None, :])[0], 2e-3
    unit = np.eye(one.dimension) * h
    for i in range(one.dimension):
        for j in range(one.dimension):
            shifted = [
                a * b * potential(name, q + a * unit[i] * s + b * unit[j] * s)
                for s in (1, 2) for a in (1, -1) for b in (1, -1)
            ]  # fmt: skip
            near, far = sum(shifted[:4]) / (4 * h * h), sum(shifted[4:]) / (16 * h * h)
            assert found[i, j] == pytest.approx((4 * near - far) / 3, abs=2e-5), (i, j)


@pytest.mark.slow
@pytest.mark.parametrize("name", BY_NAME)
def test_unit_of_time_is_radian_of_fastest_small_oscillation(name):
    ensemble = problems.named_ensemble(BY_NAME[name], 4, 1, 100.0)
    assert ensemble.unit * FASTEST[name] == pytest.approx(1, rel=1e-12)
    assert ensemble.t_end == pytest.approx(100 / FASTEST[name], rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", BY_NAME)
def test_starts_have_energies_that_are_log_uniform_in_stated_range(name):
    """The largest distance of 400 sorted uniform numbers from the diagonal exceeds 0.08 once in a hundred draws."""
    one, count = BY_NAME[name], 400
    ensemble = problems.named_ensemble(one, count, 5, 100.0)
    start = ensemble.start.reshape(count, 4, -1)
    assert not start[:, [1, 3]].any()
    energy = np.array([potential(name, q) + (p @ p) / 2 for q, p in zip(start[:, 0], start[:, 2], strict=True)])
    low, high = np.log(one.energies)
    share = np.sort((np.log(energy) - low) / (high - low))
    assert share[0] >= -1e-9
    assert share[-1] <= 1 + 1e-9
    assert np.abs(share - (np.arange(count) + 0.5) / count).max() < 0.08


@pytest.mark.slow
def test_starts_are_first_places_on_their_ray_with_their_energy():
    """On the way there H is below: beyond the saddles of Henon-Heiles are places with the same energy."""
    for name in ("henon_heiles", "morse", "lennard_jones"):
        ensemble = problems.named_ensemble(BY_NAME[name], 50, 6, 100.0)
        for row in ensemble.start.reshape(50, 4, -1):
            q, p = row[0], row[2]
            rays = [potential(name, s * q) + s * s * (p @ p) / 2 for s in np.linspace(0, 1, 200)]
            assert (np.diff(rays) > 0).all(), name


def test_directions_fill_the_energy_surface_of_small_oscillations_evenly():
    """Each of the 2 d squares of normalised coordinates is 1/2d in the mean, to 4 deviations of 2000 draws."""
    one = BY_NAME["fput_alpha"]
    ensemble = problems.named_ensemble(one, 2000, 7, 100.0)
    start = ensemble.start.reshape(2000, 4, -1)
    modes = np.array(
        [
            [sin(pi * i * k / (problems.CHAIN_SITES + 1)) for i in range(1, problems.CHAIN_SITES + 1)]
            for k in range(1, problems.CHAIN_SITES + 1)
        ]
    )
    modes *= sqrt(2 / (problems.CHAIN_SITES + 1))
    frequencies = 2 * np.sin(pi * np.arange(1, problems.CHAIN_SITES + 1) / (2 * problems.CHAIN_SITES + 2))
    parts = np.concatenate([(start[:, 0] @ modes.T * frequencies) ** 2, (start[:, 2] @ modes.T) ** 2], axis=1)
    share = (parts / parts.sum(axis=1, keepdims=True)).mean(axis=0)
    expected = 1 / (2 * problems.CHAIN_SITES)
    assert share == pytest.approx(expected, abs=4 * sqrt(2) * expected / sqrt(2000))


def test_ring_of_toda_has_neither_momentum_nor_displacement_of_whole():
    start = problems.named_ensemble(BY_NAME["toda"], 20, 8, 100.0).start.reshape(20, 4, problems.RING)
    assert np.abs(start.sum(axis=2)).max() < 1e-13


def single(system, q0):
    """delta of a run from rest over 100 periods."""
    start = np.zeros((1, 4))
    start[0, 0] = q0
    given = np.empty((1, 0))
    return problems.anharmonicities(Ensemble(name="", system=system, start=start, parameters=given, t_end=400.0))[0]


@pytest.mark.slow
def test_anharmonicity_of_small_oscillation_follows_from_its_fourth_derivative():
    """V'' = 1 - q^2/2 on q = a cos t: rms of a^2 cos(2 t)/4 over 1, to the relative order a^2."""
    assert single(BY_NAME["pendulum"].system(), 0.05) == pytest.approx(0.05**2 / 4 / sqrt(2), rel=5e-3)


# --- Random near-harmonic systems: their potential, its lower bound, and the distributions that they are drawn from.

BAND = (0.01, 0.5)


def potentials(dimension, count=2000, seed=1, band=BAND):
    return problems.random_ensemble(dimension, count, seed, band=band, t_end=100.0)


def coefficients(ensemble):
    """Values of all problems, by name."""
    values = ensemble.parameters.reshape(ensemble.size, -1, 2)
    assert (values[:, :, 1] == 0).all()
    return dict(zip(ensemble.system.parameters, values[:, :, 0].T, strict=True))


def polynomial(of, q):
    """V as the docstring writes it, for q (d, ...) and coefficients of one problem or of all of them."""
    d = len(q)
    total = 0.0
    for i in range(d):
        inner = of[f"a{i}"] / 2
        for j in range(d):
            inner = inner + of[f"c{i}{j}"] * q[j]
        for j in range(i, d):
            inner = inner + of[f"e{i}{j}"] * q[j] ** 2
        total = total + q[i] ** 2 * inner
    if d == 3:
        total = total + of["c012"] * q[0] * q[1] * q[2]
    return total


def normal(x):
    return (1 + np.vectorize(erf)(x / sqrt(2))) / 2


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_potential_is_the_one_that_the_docstring_writes(dimension):
    ensemble = potentials(dimension, 5)
    of = coefficients(ensemble)
    random = np.random.default_rng(2)
    for m in range(5):
        one = {name: values[m] for name, values in of.items()}
        q = random.normal(size=dimension)
        wanted = polynomial(one, q)
        assert ensemble.system.V(tuple(q), *one.values()) == pytest.approx(wanted, rel=1e-13)
        slope = ensemble.system.grad_V(tuple(q), *one.values())
        for i, e in enumerate(np.eye(dimension)):
            # An imaginary step differentiates to all digits.
            assert slope[i] == pytest.approx(polynomial(one, q + 1e-40j * e).imag / 1e-40, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("dimension", [2, 3])
def test_every_potential_is_bounded_from_below(dimension):
    ensemble = potentials(dimension, 500, band=(1e-3, 2.0))
    of = coefficients(ensemble)
    directions = np.random.default_rng(3).normal(size=(200, dimension))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for u in [*directions, *np.eye(dimension)]:
        quartic = sum(of[f"e{i}{j}"] * u[i] ** 2 * u[j] ** 2 for i in range(dimension) for j in range(i, dimension))
        # Along a ray V = a r^2 + c r^3 + e r^4 >= (a - c^2 / 4 e) r^2: e is at least s/10 times sum_i u_i^4.
        assert (quartic >= 0.1 * ensemble.strength * (u**4).sum() * (1 - 1e-12)).all()
        far = polynomial(of, u[:, None] * 1e4)
        assert (far > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_strengths_are_uniform_in_their_logarithm(dimension):
    strength = potentials(dimension).strength
    assert BAND[0] <= strength.min()
    assert strength.max() <= BAND[1]
    assert kstest(np.log(strength), "uniform", args=(np.log(BAND[0]), np.log(BAND[1] / BAND[0]))).pvalue > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_one_frequency_is_one_and_the_others_are_uniform(dimension):
    of = coefficients(potentials(dimension))
    w = np.sqrt([of[f"a{i}"] for i in range(dimension)])
    assert ((w == 1).sum(axis=0) == 1).all()
    which = np.bincount((w == 1).argmax(axis=0), minlength=dimension) / 2000
    assert which == pytest.approx(1 / dimension, abs=0.05)  # more than four standard deviations
    others = w[w != 1]
    assert kstest(others, "uniform", args=(0.2, 0.8)).pvalue > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_cubic_and_quartic_coefficients_are_normal_times_the_strength(dimension):
    ensemble = potentials(dimension)
    for name, values in coefficients(ensemble).items():
        scaled = values / ensemble.strength
        if name[0] == "c":
            assert kstest(scaled / 0.4, normal).pvalue > 1e-4, name
        if name[0] == "e":
            assert scaled.min() > 0.1 * (1 - 1e-12)
            assert kstest((scaled - 0.1) / 0.4, lambda x: 2 * normal(x) - 1).pvalue > 1e-4, name


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_amplitudes_phases_and_simplex_shares_are_uniform(dimension):
    ensemble = potentials(dimension)
    of = coefficients(ensemble)
    start = ensemble.start.reshape(-1, 4, dimension)
    assert (start[:, [1, 3]] == 0).all()
    w = np.sqrt([of[f"a{i}"] for i in range(dimension)]).T
    q, p = start[:, 0] * np.maximum(w, 0.5), start[:, 2]
    squares = q**2 + p**2
    amplitude = np.sqrt(squares.sum(axis=1))
    assert kstest(amplitude, "uniform", args=(0.4, 0.6)).pvalue > 1e-3
    # A share of the uniform distribution on the simplex exceeds x with the probability (1 - x)^(d - 1).
    for i in range(dimension):
        shares = squares[:, i] / amplitude**2
        assert kstest(shares, lambda x: 1 - (1 - x) ** (dimension - 1)).pvalue > 1e-3
        assert kstest(np.arctan2(p[:, i], q[:, i]), "uniform", args=(-np.pi, 2 * np.pi)).pvalue > 1e-3


# --- Random cubic potentials: their barriers, against the closed form for Henon-Heiles and a search by scipy.

CUBIC_BAND = (0.05, 0.75)


@pytest.fixture(scope="module", params=[2, 3])
def ensemble(request):
    return made.cubic_ensemble(request.param, 24, 11, band=CUBIC_BAND, t_end=30.0)


def test_barrier_of_henon_and_heiles_is_a_sixth():
    terms = made._monomials(2)
    cubic = np.array([{(0, 0, 1): 1.0, (1, 1, 1): -1 / 3}.get(term, 0.0) for term in terms])
    angles = np.linspace(0, np.pi, 720, endpoint=False) + np.pi / 1440  # halves of a degree, but none without a barrier
    n = np.stack([np.cos(angles + np.pi / 1440), np.sin(angles + np.pi / 1440)], axis=1)
    for q in (np.zeros(2), np.array([0.3, 0.1])):
        scale = made._scale(n, np.ones(2), np.array(terms), cubic, q, 0.5)
        own = abs(cubic @ np.prod(q[np.array(terms)], axis=-1))
        # Scaled by s, the barrier is 1 / (6 s^2), which the energy has to be half of.
        assert (0.5 + own * scale) * scale**2 == pytest.approx(0.5 / 6, rel=1e-12)


@pytest.mark.slow
def test_no_orbit_has_the_energy_to_escape(ensemble):
    system, d = ensemble.system, ensemble.system.dimension
    random = np.random.default_rng(2)
    for start, parameters in zip(ensemble.start, ensemble.parameters, strict=True):
        given = parameters[::2]
        q, p = start[:d], start[2 * d : 3 * d]
        energy = p @ p / 2 + system.V(q, *given)

        def barrier(x, given=given):
            n = x / np.linalg.norm(x)
            square, cubic = given[:d] @ n**2, system.V(n, *[0.0] * d, *given[d:])
            return square**3 / (54 * cubic**2)

        lowest = min(minimize(barrier, random.normal(size=d), method="Nelder-Mead").fun for _ in range(12))
        # Directions are 400 random ones: the lowest barrier that they find is a few per cent too high at most.
        assert energy < CUBIC_BAND[1] * 1.1 * lowest
        assert energy > 0


# --- Rings of masses as model crystals: their potential, phonons, and the distributions that they are drawn from.

RING_BAND = (0.01, 0.15)


def rings(count=400, seed=1, band=RING_BAND, t_end=50.0):
    return problems.ring_ensemble(count, seed, band=band, t_end=t_end)


def parts(ensemble):
    """Inverse roots of masses and strengths of bonds (problems, sites), and quartic coefficients (problems,)."""
    values = ensemble.parameters.reshape(ensemble.size, -1, 2)
    assert (values[:, :, 1] == 0).all()
    return values[:, : problems.SITES, 0], values[:, problems.SITES : 2 * problems.SITES, 0], values[:, -1, 0]


def ring_states(ensemble):
    """Positions and momenta (problems, sites)."""
    start = ensemble.start.reshape(-1, 4, problems.SITES)
    assert (start[:, [1, 3]] == 0).all()
    return start[:, 0], start[:, 2]


def phonons(w, k):
    """Squared frequencies and modes by LAPACK, of the matrix that the bonds have by hand."""
    bonds = np.zeros((problems.SITES, problems.SITES))
    for i in range(problems.SITES):
        bonds[i, i], bonds[i, (i + 1) % problems.SITES] = -w[i], w[(i + 1) % problems.SITES]
    return np.linalg.eigh(bonds.T @ np.diag(k) @ bonds)


def test_the_potential_of_rings_is_the_one_that_the_docstring_writes():
    ensemble, random = rings(4), np.random.default_rng(2)

    def of_bonds(q, w, k, c):
        x = w * q
        d = np.append(x[1:], x[0]) - x
        return np.sum(k * (d**2 / 2 - d**3 / 2 + c * d**4))

    for w, k, c in zip(*parts(ensemble), strict=True):
        q, given = random.normal(size=problems.SITES), (*w, *k, c)
        assert ensemble.system.V(tuple(q), *given) == pytest.approx(of_bonds(q, w, k, c), rel=1e-13)
        slope = ensemble.system.grad_V(tuple(q), *given)
        for i, e in enumerate(np.eye(problems.SITES)):
            # An imaginary step differentiates to all digits.
            assert slope[i] == pytest.approx(of_bonds(q + 1e-40j * e, w, k, c).imag / 1e-40, rel=1e-12, abs=1e-12)


def test_quartic_coefficient_lies_between_morse_and_lennard_jones():
    # V = (1 - exp(-x))^2 is x^2 - x^3 + 7/12 x^4. V = r^-12 - 2 r^-6 at r = 1 + x is 36 x^2 - 252 x^3 + 1113 x^4.
    # In lengths for which the cubic term is half of the quadratic one, both quadratic terms being 1/2:
    morse, lennard_jones = 7 / 12 / 2, (1113 / 72) / (252 / 72 / 0.5) ** 2
    c = parts(rings())[2]
    assert kstest(c, "uniform", args=(morse, lennard_jones - morse)).pvalue > 1e-3


def test_highest_frequency_is_one_and_one_mode_is_free():
    w, k, _ = parts(rings(50))
    for row in zip(w, k, strict=True):
        squares, _ = phonons(*row)
        # 1e-12: Jacobi's rotations and LAPACK round differently.
        assert squares[-1] == pytest.approx(1.0, abs=1e-12)
        assert squares[0] == pytest.approx(0.0, abs=1e-12)
        assert squares[1] > 1e-3


def test_masses_take_turns_and_bonds_vary_as_stated():
    w, k, _ = parts(rings())
    masses = w**-2.0
    assert masses[:, ::2] == pytest.approx(np.repeat(masses[:, :1], problems.SITES // 2, axis=1), rel=1e-13)
    assert masses[:, 1::2] == pytest.approx(np.repeat(masses[:, 1:2], problems.SITES // 2, axis=1), rel=1e-13)
    assert kstest(np.log(masses[:, 1] / masses[:, 0]), "uniform", args=(0, np.log(4))).pvalue > 1e-3
    assert kstest(np.log(k.ravel()), "uniform", args=(np.log(0.7), np.log(2))).pvalue > 1e-3


def test_strength_is_rms_change_of_bonds_in_equilibrium():
    ensemble = rings(60)
    assert kstest(np.log(rings().strength), "uniform", args=(np.log(0.01), np.log(15))).pvalue > 1e-3
    (w, k, _), (q, p) = parts(ensemble), ring_states(ensemble)
    shares = []
    for i in range(ensemble.size):
        squares, modes = phonons(w[i], k[i])
        coordinates, momenta = (modes[:, 1:].T @ x[i] for x in (q, p))
        # Equilibrium at a temperature: the covariance of the bonds follows from the modes', temperature over squares.
        changes = np.roll(w[i][:, None] * modes[:, 1:], -1, axis=0) - w[i][:, None] * modes[:, 1:]
        root = ensemble.strength[i] / sqrt(np.mean(changes**2 @ (1 / squares[1:])))
        shares += [*(coordinates * np.sqrt(squares[1:]) / root), *(momenta / root)]
        assert p[i] @ (1 / w[i]) == pytest.approx(0.0, abs=1e-13)  # the total momentum
    assert kstest(shares, norm.cdf).pvalue > 1e-3


# --- Random Kepler orbits: energy, eccentricity vector and Kepler's equation, and the distributions of their elements.

BOUNDS = (0.02, 0.35)


def orbits(count=1000, seed=1, eccentricities=BOUNDS):
    return problems.orbit_ensemble(count, seed, eccentricities=eccentricities, orbits=20)


def states(ensemble):
    start = ensemble.start.reshape(-1, 4, 2)
    assert (start[:, [1, 3]] == 0).all()
    return start[:, 0], start[:, 2]


def elements(ensemble):
    """Energy and eccentricity vector of each orbit, from its state alone."""
    q, p = states(ensemble)
    r = np.linalg.norm(q, axis=1)
    moment = q[:, 0] * p[:, 1] - q[:, 1] * p[:, 0]
    vector = np.stack([p[:, 1] * moment, -p[:, 0] * moment], axis=1) - q / r[:, None]
    return (p**2).sum(axis=1) / 2 - 1 / r, vector


@pytest.mark.parametrize("eccentricities", [BOUNDS, (0.0, 1e-3), (0.8, 0.89)])
def test_energy_follows_from_axis_one_and_eccentricity_from_draw(eccentricities):
    ensemble = orbits(eccentricities=eccentricities)
    (energy, vector), (q, p) = elements(ensemble), states(ensemble)
    assert (q[:, 0] * p[:, 1] > q[:, 1] * p[:, 0]).all()  # against the clock
    # 1/r reaches 10 for the largest eccentricities.
    assert np.abs(energy + 0.5).max() < 2e-14
    assert np.abs(np.linalg.norm(vector, axis=1) - ensemble.strength).max() < 2e-14
    assert eccentricities[0] <= ensemble.strength.min()
    assert ensemble.strength.max() <= eccentricities[1]


@pytest.mark.parametrize("eccentricities", [BOUNDS, (0.8, 0.89)])
def test_positions_solve_keplers_equation_for_mean_anomaly_that_was_drawn(eccentricities):
    ensemble = orbits(50, eccentricities=eccentricities)
    random = np.random.default_rng([1, 50])
    random.uniform(*eccentricities, 50)
    M, turn = random.uniform(0.0, 2 * np.pi, (2, 50))
    q, _ = states(ensemble)
    for m in range(50):
        with mp.workdps(40):
            e, angle = mpf(ensemble.strength[m]), mpf(turn[m])
            x, y = map(mpf, q[m])
            cosine, sine = mp.cos(angle), mp.sin(angle)
            E = mp.atan2((cosine * y - sine * x) / mp.sqrt(1 - e * e), cosine * x + sine * y + e)
            assert abs(mp.sin((E - e * mp.sin(E) - mpf(M[m])) / 2)) < mpf(10) ** -14 / 2
    _, vector = elements(ensemble)
    turned = np.arctan2(vector[:, 1], vector[:, 0])
    assert np.abs(np.angle(np.exp(1j * (turned - turn)))).max() < 1e-12


def test_runs_cover_given_periods_with_unit_mass():
    ensemble = orbits(3)
    assert ensemble.t_end == pytest.approx(40 * np.pi, rel=1e-15)
    assert next(iter(ensemble.system.parameters)) == "GM"
    assert ensemble.parameters.reshape(-1)[0] == 1.0
    assert ensemble.name == "Kepler, e 0.02 to 0.35"


@pytest.mark.parametrize(
    "draw",
    [
        lambda seed: potentials(2, 50, seed),
        lambda seed: made.cubic_ensemble(2, 5, seed, band=CUBIC_BAND, t_end=30.0),
        lambda seed: rings(20, seed),
        lambda seed: orbits(50, seed),
    ],
)
def test_one_seed_gives_same_problems_and_others_none_of_them(draw):
    one, again, other = draw(1), draw(1), draw(2)
    for name in ("start", "parameters", "strength"):
        assert getattr(one, name).tobytes() == getattr(again, name).tobytes()
    assert not (one.start[:, None] == other.start[None]).all(axis=2).any()
    assert not np.isin(one.strength, other.strength).any()
