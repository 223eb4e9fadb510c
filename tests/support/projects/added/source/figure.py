"""Figure of the energy errors."""

from __future__ import annotations

from typing import Any

from nearharmonic.plotting.style import house_style, method_handles, new_figure, style_of


@house_style
def one_step(cube: Any) -> Any:
    """Draw the errors."""
    drawn = new_figure(4, 3)
    axes = drawn.subplots()
    for name, errors in zip(cube.integrator.values, cube.energy_error, strict=True):
        axes.plot(cube.tau, errors, color=style_of(str(name)).colour)
    axes.set_xlabel(r"step size, $\tau$")
    axes.set_ylabel("energy error after one step")
    axes.legend(handles=method_handles(map(str, cube.integrator.values), map(str, cube.label.values)))
    return drawn
