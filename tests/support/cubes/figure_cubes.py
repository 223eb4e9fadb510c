"""Small cubes made by hand for the tests of figures: every curve has numbers of its own, so that it can be told apart.

Labels are not the names that the package would give, so that a figure that ignores the cube's labels is noticed.
"""

import numpy as np
import xarray as xr

from nearharmonic.integrators import BENCHMARKED, integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.recommendation.measure import Solver, curves_of, dataset_of
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.paper.orbits import substeps
from nearharmonic_studies.trained.settings import IDEAS

#: Two hollow markers and a filled one.
METHODS = ("ruth", "aba104", "babps9o7h")
TAU = np.geomspace(1e-3, 1, 25)
FACTS = {"measured": "today", "cpu": "Fast 9", "pinned_core": "1", "load_average": "0.5", "clock": "c"}


def label(method):
    return f"label of {method}"


def powers(*shape, seed, low=-9, high=-1):
    """Powers of ten with random exponents between ``low`` and ``high``: no two alike."""
    return 10 ** np.random.default_rng(seed).uniform(low, high, shape)


def named(methods):
    return {"integrator": list(methods), "label": ("integrator", [label(m) for m in methods])}


def emptied(cube, *kept):
    """``cube`` with NaN in all its floating-point variables but those in ``kept``."""
    lost = [v for v in cube.data_vars if cube[v].dtype.kind == "f" and v not in kept]
    return cube.assign({v: cube[v] * np.nan for v in lost})


def errors(methods=METHODS, precision=False, unit="1", gaps=None):
    """Energy errors as Figures 1, 3 and 5 show them; where there is no number to draw, see :data:`GAPS`."""
    shape = (2, len(methods), TAU.size)
    largest, mean = powers(*shape, seed=1), powers(*shape, seed=2)
    for values in (largest, mean):
        for index, value in (gaps or GAPS).items():
            values[:, :, index] = value
    dims = ("precision", "integrator", "tau_per_stage")
    cube = xr.Dataset(
        {"max_energy_error": (dims, largest), "mean_energy_error": (dims, mean)},
        coords={
            **named(methods),
            "precision": ["double", "extended"],
            "tau_per_stage": ("tau_per_stage", TAU, {"units": unit}),
        },
    )
    return cube if precision else cube.isel(precision=0, drop=True)


def crowded():
    """Errors of order four of the benchmarked methods by their own labels: gains are 1, 10 000, and eight near 20."""
    gains = 10 ** np.array([0, 1, 1.25, 1.3, 1.3, 1.35, 1.4, 1.6, 1.9, 4])
    sizes = ("integrator", "tau_per_stage"), 1e-4 * TAU**4 / gains[:, None]
    cube = errors(BENCHMARKED).assign(max_energy_error=sizes, mean_energy_error=sizes)
    return cube.assign_coords(label=("integrator", [integrators[name].label for name in BENCHMARKED]))


#: Index of a step size -> what stands there: not computed, an error of zero, diverged.
GAPS = {0: np.nan, 7: 0.0, 11: np.nan, TAU.size - 1: np.inf}
#: The same with runs alone between them, at the ends as well, and an error of more than ten times the energy.
LONELY = {1: np.inf, 3: np.nan, 5: 0.0, 9: np.inf, 11: 0.0, 15: 20.0, 20: np.inf, 21: np.inf, TAU.size - 2: np.inf}


def advances(methods=METHODS):
    """Perihelion advances of either sign: twelve beyond their interval, one equal to it, the rest below or no number.

    The period is not Mercury's, so that it must be read.
    """
    shape = (len(methods), TAU.size)
    advance = powers(*shape, seed=3) * np.where(np.arange(TAU.size) % 2, 1, -1)
    interval = abs(advance) * powers(*shape, seed=4, low=-1.5, high=-0.1)
    interval[:, 12:] *= 50
    interval[:, 12] = abs(advance[:, 12])
    advance[:, 3], interval[:, 4], advance[:, 5], interval[:, 5] = np.nan, np.nan, np.inf, np.nan
    dims = ("integrator", "tau_per_stage")
    evaluations = np.array([[(3 + i) * 500 / tau for tau in TAU] for i in range(len(methods))])
    return xr.Dataset(
        {
            "perihelion_advance": (dims, advance),
            "perihelion_advance_interval": (dims, interval),
            "evaluations_per_orbit": (dims, evaluations),
        },
        coords={**named(methods), "tau_per_stage": TAU},
        attrs={"orbital_period": 2000.0},
    )


def terms(methods=METHODS):
    """Error terms kappa up to order 9 (drift first) or 8 (kick first).

    Orders 1, 2 and 4 vanish for drift first, orders 1 to 3 and 6 for kick first; 5 is just above the limit of 1e-30 for
    either.
    """
    kappa = powers(len(methods), 2, 9, seed=5, low=-6, high=1)
    kappa[:, 0, [0, 1, 3]], kappa[:, 1, [0, 1, 2, 5]] = 1e-76, 9.9e-31
    kappa[:, 0, 4], kappa[:, 1, 4] = 1.01e-30, 1.02e-30
    kappa[:, 1, 8] = np.nan
    return xr.Dataset(
        {"kappa": (("integrator", "first", "order"), kappa)},
        coords={**named(methods), "first": ["drift", "kick"], "order": np.arange(1, 10)},
    )


#: Four pairs of drift and kick whose signs make every kind of dot; a kick first, or a drift first.
TOY_KICK = ("0.7", "-0.3", "0.1", "0.1", "-0.3", "0.7")
TOY_DRIFT = ("0.4", "-0.2", "0.6", "-0.2", "0.4")


def toy(first):
    rows = {"kick": TOY_KICK, "drift": TOY_DRIFT} if first == "kick" else {"kick": TOY_DRIFT, "drift": TOY_KICK}
    return Tableau(name="toy", label=f"Toy of {first}", order=2, first=first, source="none", digits=10, **rows)


def toy_panels(tau=0.3):
    """Substeps of the harmonic oscillator in panels A (drift first) and B (kick first)."""
    window = ((-1.5, 1.5), (-1.5, 1.6))
    return {
        letter: substeps(toy(first), systems["sho"], start=(0.0, 1.0), tau=tau, window=window)
        for letter, first in (("A", "drift"), ("B", "kick"))
    }


def displaced(methods=METHODS):
    """Panel D beside its plane: two of three paths leave, at other iterations with either summation."""
    iteration, over = np.array([1, 3, 10, 32, 100]), ("displacement", "summation")
    left_at = np.array([[0, 0], [40, 7], [100, 5]])
    error = powers(3, 2, iteration.size, seed=41, low=-4, high=-1)
    error[(left_at[..., None] > 0) & (iteration >= left_at[..., None])] = np.nan
    return xr.Dataset(
        {"block_max_energy_error": ((*over, "iteration"), error), "left_at": (over, left_at)},
        coords={"displacement": [0.0, 1e-9, 1e-2], "summation": ["compensated", "plain"], "iteration": iteration},
        attrs={"label": label(methods[0]), "system_label": "system of the tests", "surface_limit": 1.5},
    )


def amplitudes_of_crossing(methods=METHODS):
    """Errors of all methods with T + V and with the oscillator solved exactly; crossings with none and everywhere."""
    energy, charge, n = np.geomspace(1e-5, 1 / 6, 5), [1.0, 1.5, 2.0], len(methods)
    at = np.array([3e-3, 2e-4, 0.0])[None, :, None] * np.ones((2, 1, n))
    at[1, 0, 0] = np.inf
    over = ("tau_per_stage", "charge", "exact_integrator")
    return xr.Dataset(
        {
            "energy_error": (
                ("tau_per_stage", "integrator", "energy", "quantile"), powers(2, n, 5, 3, seed=21, low=-9, high=-3),
            ),
            "exact_energy_error": (
                (*over, "energy", "quantile"), powers(2, 3, n, 5, 3, seed=22, low=-11, high=-2),
            ),
            "best_crossing": (over, at),
            "best_crossing_interval": ((*over, "bound"), at[..., None] * np.array([0.9, 1.1])),
        },
        coords={
            **named(methods), "exact_integrator": list(methods), "exact_label": ("exact_integrator", list(methods)),
            "energy": energy, "charge": charge, "tau_per_stage": [0.1, 0.05], "quantile": [0.05, 0.5, 0.95],
        },
    )  # fmt: skip


def contest(methods=METHODS):
    """Errors of trained methods and of a published one on ensembles of two panels, the second with fewer step sizes."""
    tau = np.array([[0.02, 0.05, 0.1], [0.05, 0.1, np.nan], [0.02, 0.05, 0.1]])
    names, point = [*methods, "published"], ("ensemble", "point")
    gain = np.where(np.isfinite(tau), [[0.5, 0.2, -0.1], [0.7, 0.0, 0.3], [-0.3, -0.2, 0.9]], np.nan)
    error = np.log10(powers(3, len(names), 3, seed=31, low=-11, high=-3)) + 0 * tau[:, None]
    return xr.Dataset(
        {
            "tau_per_stage": (point, tau),
            "mean_log_error": (("ensemble", "integrator", "point"), error),
            "gain": (point, gain),
            "gain_interval": ((*point, "bound"), gain[..., None] + np.array([-0.1, 0.1])),
            "kind": ("integrator", ["trained"] * len(methods) + ["published"]),
            "panel": ("ensemble", ["one", "other", "one"]),
        },
        coords={**named(names), "ensemble": ["d = 2, 0.01 to 0.1", "Kepler", "pendulum"]},
    )


def ideas(methods=METHODS):
    """Gains of ideas over two strengths and as many step sizes as methods."""
    over, shape = ("idea", "tau_per_stage", "strength"), (len(IDEAS), len(methods), 2)
    gain = np.log10(powers(*shape, seed=33, low=-1, high=3))
    leader = np.array(IDEAS)[gain.argmax(axis=0)]
    lead = np.abs(gain[0])
    return xr.Dataset(
        {
            "gain": (over, gain),
            "gain_interval": ((*over, "bound"), gain[..., None] + np.array([-0.2, 0.2])),
            "anharmonicity": (("strength", "quantile"), [[1e-3, 2e-3, 4e-3], [0.1, 0.2, 0.4]]),
            **{f"leader{s}": (over[1:], leader) for s in ("", "_split")},
            **{f"lead{s}": (over[1:], lead) for s in ("", "_split")},
        },
        coords={"idea": list(IDEAS), "tau_per_stage": 0.02 * (1 + np.arange(len(methods))), "strength": [1e-3, 0.1]},
    )


def timed(method, measured, times, kind="splitting", lanes=(), **more):
    """A solver whose setting i has the error ``measured[i]`` after ``times[i]`` s at best, in lanes ``lanes[i]``.

    The mean error is half of the largest, the error of the position ten times that; step sizes are 1, 1/2, 1/3, ....
    """
    errors = np.array(measured, dtype=float)
    columns = {"max_energy_error": errors, "mean_energy_error": errors / 2, "position_error": 10 * errors}
    columns["tau"] = 1 / np.arange(1, errors.size + 1)
    repeats = {("trajectory", i): [3 * time, time, 2 * time] for i, time in enumerate(times)}
    repeats |= {("lanes", i): [2 * time, time] for i, time in enumerate(lanes)}
    return Solver(method=method, label=label(method), kind=kind, columns=columns, times=repeats, **more)


def curves(*solvers):
    """The curves of ``solvers`` as readers have them."""
    return curves_of(dataset_of(solvers, "1"))
