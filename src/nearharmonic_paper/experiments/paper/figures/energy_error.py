"""Benchmark profiles: energy errors against tau/s of any system, and of the systems of Figures 1, 3 and 5."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nearharmonic.plotting.energy_error import draw_profile
from nearharmonic_paper.tasks.declarations import figure

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@figure(
    cube="{system}",
    profile=True,
    caption=(
        "Benchmark profile: largest (A) and mean (B) relative energy error over every step of a run, against step "
        "size per stage tau/s; each point is a whole run. Dashed lines, if any, are in extended precision. A curve "
        "ends where runs leave their energy surface. Filled markers are the methods of Nielsen (2015) and those "
        "found here."
    ),
)
def energy_error(cube: xr.Dataset) -> Figure:
    """Draw the energy errors of any system."""
    return draw_profile(cube)


@figure(
    cube="sho",
    target="fig1",
    profile=True,
    caption=(
        "Benchmark profile for the simple harmonic oscillator, t in [0, 500]: largest (A) and mean (B) relative "
        "energy error over every step of a run, against step size per stage tau/s; each point is a whole run. Solid "
        "lines with markers: double precision with compensated summation; dashed lines of the same colour: extended "
        "precision (double-double), which goes on below the rounding floor of a double. Filled markers are the "
        "methods of Nielsen (2015): their slope is 6, although their general order is 4. A curve ends where the "
        "method becomes unstable."
    ),
)
def fig1_sho(cube: xr.Dataset) -> Figure:
    """Draw the energy errors of the harmonic oscillator, in double and extended precision."""
    return draw_profile(cube)


@figure(
    cube="henon_heiles",
    target="fig3",
    profile=True,
    caption=(
        "Benchmark profile for the Hénon-Heiles system at H = 1/8, t in [0, 500]: largest (A) and mean (B) relative "
        "energy error over every step of a run, against step size per stage tau/s; each point is a whole run in "
        "double precision with compensated summation. Where the steps are large, methods solved for the harmonic "
        "oscillator (filled markers) fall faster than their order 4, as the system is then close to an oscillator. A"
        " curve ends where runs leave their energy surface."
    ),
)
def fig3_henon_heiles(cube: xr.Dataset) -> Figure:
    """Draw the energy errors of the Henon-Heiles system."""
    return draw_profile(cube)


@figure(
    cube="kepler",
    target="fig5",
    profile=True,
    caption=(
        "Benchmark profile for the planar Sun-Mercury system over ten years (87 660 h): largest (A) and mean (B) "
        "relative energy error over every step of a run, against step size per stage tau/s in hours; each point is a"
        " whole run in double precision with compensated summation. The largest error comes at perihelion passages, "
        "so the two panels rank the methods differently. A curve ends where runs leave their energy surface."
    ),
)
def fig5_kepler(cube: xr.Dataset) -> Figure:
    """Draw the energy errors of the Sun-Mercury system over ten years, against tau/s in hours."""
    return draw_profile(cube)
