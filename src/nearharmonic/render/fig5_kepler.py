"""Figure 5: energy error of the Sun-Mercury system over ten years against tau/s in hours."""

from __future__ import annotations

from nearharmonic.render.energy_error import energy_error_figure as figure

__all__ = ["CAPTION", "figure"]

CAPTION = (
    "Benchmark profile for the planar Sun-Mercury system over ten years (87 660 h): largest (A) and mean (B) relative "
    "energy error over every step of a run, against step size per stage tau/s in hours; each point is a whole run in "
    "double precision with compensated summation. The largest error comes at perihelion passages, so the two panels "
    "rank the methods differently. A curve ends where runs leave their energy surface."
)
