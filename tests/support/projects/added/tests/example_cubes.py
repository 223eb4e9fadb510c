"""Cubes that each figure of the experiment is drawn from by the tests of all figures, and variables that stay."""

import xarray as xr

from support.cubes import figure_cubes as made


def errors(methods=made.METHODS):
    cube = xr.Dataset({"energy_error": (("integrator", "tau"), made.powers(len(methods), 5, seed=50))})
    return cube.assign_coords(made.named(methods) | {"tau": [0.1, 0.2, 0.3, 0.4, 0.5]})


EXAMPLES = {"one_step": (errors, ())}
