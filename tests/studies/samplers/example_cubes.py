"""Cubes that each figure of the experiment is drawn from by the tests of all figures, and variables that stay."""

import numpy as np
import xarray as xr

from support.cubes.figure_cubes import named, powers


def samplers(methods):
    """Three targets, four dimensions and strengths; the methods are also those that were trained for all strengths."""
    shape = (3, len(methods))
    gains = {one: powers(*shape, seed=3 + k, low=-0.5, high=0.5) for k, one in enumerate(("gain", "over_best"))}
    trained = ["0", "0.1", *methods[:3]]
    over = ("target", "integrator")
    return xr.Dataset(
        {
            **{f"{one}{end}": (over, factor * values) for one, values in gains.items()
               for end, factor in (("", 1), ("_low", 0.9), ("_high", 1.2))},
            "gaussian_gradients": (("dimension", "integrator"), powers(4, len(methods), seed=5, low=1, high=2.4)),
            "gaussian_gain": (("dimension", "integrator"), powers(4, len(methods), seed=6, low=-0.3, high=1)),
            "special_gain": (("strength", "trained_for"), powers(4, len(trained), seed=7, low=-0.1, high=0.1)),
            "special_half": (("strength", "trained_for"), powers(4, len(trained), seed=8, low=-2, high=-1)),
        },
        coords={
            **named(methods),
            "target": ["quartic", "lattice", "mesquite"],
            "target_label": ("target", ["quartic posterior", "field", "regression"]),
            "dimension": np.array([1e2, 1e3, 1e4, 1e5]),
            "strength": [0.0, 0.1, 0.5, 2.0],
            "trained_for": trained,
            "trained_label": ("trained_for", [f"searched {one}" for one in trained]),
        },
    )  # fmt: skip


EXAMPLES = dict.fromkeys(("samplers_gaussian", "samplers_targets", "samplers_trained"), (samplers, ()))
