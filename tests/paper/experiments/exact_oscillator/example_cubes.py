"""Cubes that each figure of the experiment is drawn from by the tests of all figures, and variables that stay."""

from support.cubes import figure_cubes as made

EXAMPLES = {
    "exact_oscillator_error": (made.amplitudes_of_crossing, ()),
    "exact_oscillator_charge": (made.amplitudes_of_crossing, ()),
}
