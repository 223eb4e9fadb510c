"""Colours and markers for methods that have none in ``nearharmonic.plotting.profile``, in its format.

Run: ``python benchmarks/palette.py``, or with names of methods. A colour of a coarse grid has a contrast of at least
3:1 with white. Beside the methods with the same marker, it is the one that the readers who see the least tell apart
best; at least 13 CIELAB units are asked for by ``tests/library/plotting/test_style.py``.
"""

from __future__ import annotations

import sys
from itertools import product
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "tests"))

from nearharmonic.integrators import integrators
from nearharmonic.plotting.profile import has_style, style_of
from support.cubes.colour_vision import lab, least_difference

#: Markers of methods that are not in the paper.
MARKERS = "<>*h8dPX"
#: Grid of a channel, and the lightness of a grey with the contrast 3:1 to white.
LEVELS, LIGHTEST = range(10), 61.0
GRID = [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in product([round(25.5 * level) for level in LEVELS], repeat=3)]


def suggestion(taken: list[tuple[str, str]]) -> tuple[float, str, str]:
    """The least difference, colour and marker of the best free style beside styles (colour, marker) that are taken."""
    beside = {marker: [colour for colour, other in taken if other == marker] for marker in MARKERS}
    dark = [colour for colour in GRID if lab(colour)[0] <= LIGHTEST]
    return max(
        (min((least_difference(colour, other) for other in beside[marker]), default=100.0), colour, marker)
        for marker, colour in product(MARKERS, dark)
    )


def main() -> None:
    names = sys.argv[1:] or [name for name in integrators if not has_style(name)]
    styles = [style_of(name) for name in integrators if has_style(name) and name not in names]
    taken = [(style.colour, style.marker) for style in styles if not style.filled]
    for name in names:
        difference, colour, marker = suggestion(taken)
        taken.append((colour, marker))
        print(f'("{colour}", "{marker}", "{name}"),  # {difference:.0f} apart')


if __name__ == "__main__":
    main()
