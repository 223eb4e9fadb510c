"""Cubes that each figure of the experiment is drawn from by the tests of all figures, and variables that stay."""

import numpy as np
import xarray as xr

from support.cubes.figure_cubes import named, powers

KINDS, UNREGISTERED = ("general", "paper", "trained"), "trained_on_crystals"


def crystals(methods):
    """Three crystals, four temperatures and five numbers of forces; kinds of methods in turns."""
    sizes = {"crystal": 3, "temperature": 4, "integrator": len(methods), "forces": 5, "quantile": 3}
    errors = np.sort(powers(*sizes.values(), seed=3, low=-7, high=-2), axis=-1)
    kinds = ["trained on crystals" if name == UNREGISTERED else KINDS[k % 3] for k, name in enumerate(methods)]
    leaders = np.array([[[methods[(c + t + f) % len(methods)] for f in range(5)] for t in range(4)] for c in range(3)])
    return xr.Dataset(
        {
            "max_energy_error": (tuple(sizes), errors),
            "leader": (("crystal", "temperature", "forces"), leaders),
            "lead": (("crystal", "temperature", "forces"), np.random.default_rng(4).uniform(0.1, 2, (3, 4, 5))),
            "coordinates": ("crystal", [96, 96, 64]),
            "melting": ("crystal", [83.8, 1358.0, np.nan]),
            "delta": (("crystal", "temperature"), np.geomspace(0.01, 0.5, 12).reshape(3, 4)),
            "density": (("crystal", "bin"), np.random.default_rng(5).uniform(0, 2, (3, 10))),
            "kind": ("integrator", kinds),
            "window": (("integrator", "bound"), [(0.02 * (k + 1), 0.05 * (k + 1)) for k in range(len(methods))]),
            "drift": (("crystal", "drifting", "run"), powers(3, len(methods), 2, seed=6)),
            "potential": (("bath", "averaged", "spacing"), 1 + powers(2, len(methods), 3, seed=7, low=-3)),
            "potential_error": (("bath", "averaged", "spacing"), powers(2, len(methods), 3, seed=8, low=-4, high=-3)),
            "kinetic": (("bath", "averaged", "spacing"), 1 - powers(2, len(methods), 3, seed=9, low=-3)),
            "kinetic_error": (("bath", "averaged", "spacing"), powers(2, len(methods), 3, seed=10, low=-4, high=-3)),
        },
        coords={
            **named(methods),
            "crystal": ["argon", "copper", "chain"],
            "temperature": [0.01, 0.1, 0.3, 1.0],
            "forces": [40.0, 26.0, 16.0, 10.0, 5.0],
            "quantile": [0.1, 0.5, 0.9],
            "drifting": list(methods),
            "drifting_label": ("drifting", [f"label of {one}" for one in methods]),
            "averaged": list(methods),
            "averaged_label": ("averaged", [f"label of {one}" for one in methods]),
            "bath": ["middle", "ends"],
            "spacing": [20.0, 10.0, 5.0],
        },
    )


EXAMPLES = {
    "crystals_error": (crystals, ()), "crystals_map": (crystals, ()), "crystals_phonons": (crystals, ()),
    "crystals_gain": (crystals, ()), "crystals_long_runs": (crystals, ()),
}  # fmt: skip
