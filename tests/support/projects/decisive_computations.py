"""Computations that determine the bits of result files besides compiled kernels; as a program it prints digests."""

import hashlib
import json
import math

import numpy as np
import xarray as xr

from nearharmonic.engine.setup import observable_values
from nearharmonic.numerics import portable
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.exact_oscillator import ExactOscillatorSettings
from nearharmonic_paper.experiments.exact_oscillator.reductions import crossings
from nearharmonic_paper.experiments.exact_oscillator.run import starts_on
from nearharmonic_paper.experiments.stability.reductions import evaluations_below, rotation_per_sample
from nearharmonic_paper.experiments.stability.reductions import growth_exponent as growth
from nearharmonic_paper.experiments.stability.run import kepler_apoapsis
from nearharmonic_studies.trained.problems import NAMED, named_ensemble, orbit_ensemble, random_ensemble
from nearharmonic_studies.trained.reductions import gains

COUNT = 2000


def computations():
    """Arrays by name."""
    u = portable.quasi_random(COUNT, 4, 1)
    kepler = systems["kepler"]
    q, p = (u[:, :2] - 0.5) * 140, (u[:, 2:] - 0.5) * 0.28
    angle = observable_values(kepler, q, p, kepler.constants(float))["perihelion_angle"]
    time = np.sort(u[:, 0]) * 87660
    errors = 1e-3 * u[:, 1] * (u[:, 2] + 0.5) ** 2
    tau = np.sort(u[:200, 3]) + 1e-3
    made = {
        "perihelion angles": angle,
        "trend": portable.line_fit(*portable.unwrapped(time, 1e-6 * time + 1e-3 * angle)),
    }
    made["linearity"] = portable.trend_linearity(*portable.unwrapped(time, 1e-6 * time + 1e-3 * angle))
    made["fit"] = portable.line_fit(u[:, 0] - 0.5, errors)
    curves = 1e-6 * tau * tau * tau * (1 + 1e-3 * portable.quasi_random(100 * 200, 1, 2).reshape(100, 200))
    orders = (xr.DataArray(x, dims=("curve", "tau_per_stage")) for x in (tau + 0 * curves, curves))
    made["orders"] = portable.observed_order(*orders)
    made["power laws"] = [portable.power_law(tau, curve) for curve in curves]
    made["growth"] = growth((u[:, :1] - 0.5) * np.sqrt(tau), tau * 1000)
    made["apoapsis"] = kepler_apoapsis(u[:, 0] * 0.9, u[:, 1] * 6)
    path = [np.reshape(x, (40, 50, 2)) for x in (np.array([69.0, 3.0]) + 0.5 * q / 70, np.array([0.01, 0.14]) + p / 50)]
    made["advance"] = rotation_per_sample(path[0] / 70, path[1] * 7)
    columns = (errors.reshape(200, 10) + 1e-4).T / tau
    made["contour"] = [evaluations_below(np.arange(1, 201), column, 1e-2) for column in columns]
    made["norms"] = portable.norms(u.reshape(500, 4, 4) - 0.5)
    made["surface"] = starts_on(1 / 80, 500, 1)
    energies = ExactOscillatorSettings(integrators=("aba864",)).surfaces()
    plain, rotated = errors[: 17 * 100].reshape(17, 2, 50).swapaxes(0, 1)
    over = ("energy", "trajectory")
    runs = {"energy_error": (("integrator", *over), [plain])}
    runs["exact_energy_error"] = over, rotated * np.linspace(0.5, 2, 17)[:, None]
    found = crossings(xr.Dataset(runs, {"energy": energies}, {"seed": 1}))
    made |= {f"crossings: {name}": entry.values for name, entry in found.items()}
    for one in NAMED:
        made[f"starts of {one.name}"] = named_ensemble(one, 20, 3, 100.0).start
    whole = random_ensemble(3, 100, 1, band=(0.01, 0.5), t_end=10.0)
    made |= {"random potentials": whole.parameters, "their starts": whole.start}
    made["orbits"] = orbit_ensemble(500, 1, eccentricities=(0.02, 0.35), orbits=3.0).start
    table = portable.log10(errors.reshape(4, 5, 100))
    logs = {"log_error": (("ensemble", "integrator", "point", "problem"), [table])}
    kinds = ("integrator", ["published", "trained"] * 2)
    names = {"ensemble": ["one"], "integrator": list("abcd"), "kind": kinds}
    resampled = gains(xr.Dataset(logs, names, {"seed": 1}), 200)
    made |= {"gain": resampled.gain.values, "its interval": resampled.gain_interval.values}
    return made


def of_libraries():
    """Operations by numpy, BLAS and the C library, which choose their code by the processor."""
    x = portable.quasi_random(COUNT, 2, 2) + 0.1
    by_numpy = [np.exp(x), np.log(x), np.sin(9 * x), np.arctan2(x[:, 0], x[:, 1] - 0.6), x @ x.T]
    return [*by_numpy, [f(a) for f in (math.exp, math.log, math.sin) for a in x[:, 0].tolist()]]


def digests():
    """Digests of the bytes of all computations by name, and one of what libraries compute."""
    found = {name: _digest(value) for name, value in computations().items()}
    return found, [_digest(value) for value in of_libraries()]


def _digest(value):
    return hashlib.sha256(np.ascontiguousarray(value, dtype=float).tobytes()).hexdigest()


if __name__ == "__main__":
    print(json.dumps(digests()))
