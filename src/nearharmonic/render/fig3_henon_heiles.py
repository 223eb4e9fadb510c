"""Figure 3: energy error of the Henon-Heiles system against tau/s."""

from __future__ import annotations

from nearharmonic.render.energy_error import energy_error_figure as figure

__all__ = ["CAPTION", "figure"]

CAPTION = (
    "Benchmark profile for the Hénon-Heiles system at H = 1/8, t in [0, 500]: largest (A) and mean (B) relative "
    "energy error over every step of a run, against step size per stage tau/s; each point is a whole run in double "
    "precision with compensated summation. Where the steps are large, methods solved for the harmonic oscillator "
    "(filled markers) fall faster than their order 4, as the system is then close to an oscillator. A curve ends "
    "where runs leave their energy surface."
)
