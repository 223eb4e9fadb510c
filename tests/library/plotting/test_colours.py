"""Colours and markers of methods, as readers with each kind of colour vision see them."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.colors import to_hex

from nearharmonic.integrators import BENCHMARKED, integrators
from nearharmonic.plotting.profile import has_style
from nearharmonic.plotting.style import style_of
from nearharmonic_paper.experiments.exact_oscillator.run import ExactOscillatorSettings
from nearharmonic_paper.experiments.stability.figures import ESCAPED_COLOUR, LOST_COLOUR
from support.cubes.colour_vision import SEEN, difference, lab, least_difference

#: Least difference in CIELAB of colours that are told apart; 2.3 is just noticeable for large patches side by side.
APART = 13
TRAINED, TRAINED_EXACT = (
    [name for name in integrators if name.startswith("trained_") and name.startswith("trained_exact_") == exact]
    for exact in (False, True)
)
EXACT = ExactOscillatorSettings().integrators


def test_simulated_vision_confuses_red_and_green_of_one_lightness():
    assert lab("#ffffff") == pytest.approx([100, 0, 0], abs=1e-3)
    assert lab("#ff0000") == pytest.approx([53.24, 80.09, 67.20], abs=0.05)  # published values of sRGB red
    assert difference("#c05040", "#6f7a3c") > 8 * difference("#c05040", "#6f7a3c", "deuteranopia")
    assert all(difference("#404040", "#808080", vision) > 20 for vision in SEEN)


def test_methods_with_one_marker_have_colours_that_all_readers_see():
    alike = [
        (one, other)
        for one, other in combinations(filter(has_style, integrators), 2)
        if (style_of(one).marker, style_of(one).filled) == (style_of(other).marker, style_of(other).filled)
        and least_difference(style_of(one).colour, style_of(other).colour) < APART
    ]
    assert alike == []


@pytest.mark.parametrize(
    "names",
    [[*BENCHMARKED, *EXACT], TRAINED, [*EXACT, *TRAINED_EXACT]],
    ids=["with the exact oscillator", "trained", "trained with the exact oscillator"],
)
def test_methods_drawn_together_have_colours_that_all_readers_see(names):
    found = {
        (one, other): least_difference(style_of(one).colour, style_of(other).colour)
        for one, other in combinations(dict.fromkeys(names), 2)
    }
    assert min(found.values()) >= APART, min(found, key=found.get)


@pytest.mark.parametrize(("colours", "none"), [("plasma_r", ESCAPED_COLOUR), ("viridis_r", LOST_COLOUR)])
def test_cells_without_number_differ_from_every_colour_of_map(colours, none):
    assert min(least_difference(none, to_hex(colormaps[colours](x))) for x in np.linspace(0, 1, 64)) >= APART
    # The largest errors, beside which such cells lie, are dark: black differs from them in colour, not in lightness.
    assert lab(none)[0] - lab(colormaps[colours](1.0)[:3])[0] >= 40
