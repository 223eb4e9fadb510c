"""Read back what a figure draws: lines by their data, legends by their texts, pixels by their place in the axes."""

import numpy as np
from matplotlib.colors import to_hex, to_rgb
from matplotlib.lines import Line2D
from matplotlib.offsetbox import DrawingArea, HPacker, TextArea
from matplotlib.patches import Patch

from nearharmonic.plotting.style import style_of

SOLID, NO_LINE = "solid", "no line"


def dashes(line):
    """Lengths of a line's dashes and gaps, "solid" or "no line"."""
    if line.get_linestyle() in ("None", "none", " ", ""):
        return NO_LINE
    _, pattern = line._unscaled_dash_pattern
    return SOLID if pattern is None else tuple(pattern)


def look(line):
    """(colour, marker, its face, dashes): what a reader tells lines apart by; marker and face None if there is none."""
    colour, marker = to_hex(line.get_color()), line.get_marker()
    if marker in ("None", "none", " ", "", None):
        return colour, None, None, dashes(line)
    face = line.get_markerfacecolor()
    return colour, marker, face if face == "none" else to_hex(face), dashes(line)


def look_of(method, line=SOLID):
    """The look that the house style gives to a method."""
    style = style_of(method)
    return to_hex(style.colour), style.marker, to_hex(style.colour if style.filled else "white"), line


def lines_of(axes, x, y):
    """All lines of ``axes`` with just these data, NaN for NaN."""
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))

    def same(line):
        data = (np.asarray(values, dtype=float) for values in line.get_data())
        return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(data, (x, y), strict=True))

    return [line for line in axes.get_lines() if same(line)]


def line_of(axes, x, y):
    """The one line of ``axes`` with these data."""
    (line,) = lines_of(axes, x, y)
    return line


def drawn(line):
    """Points of ``line`` that have a place on the paper."""
    return np.isfinite(line.get_transform().transform(np.column_stack(line.get_data()))).all(axis=1)


def seen(line):
    """Points of ``line`` that a reader sees: joined to a neighbour, or with a marker."""
    there = np.pad(drawn(line), 1)
    marks = np.zeros(there.size - 2, bool)
    marks[slice(None) if line.get_markevery() is None else line.get_markevery()] = line.get_marker() != "none"
    return there[1:-1] & (there[:-2] | there[2:] | marks)


def entries(legend):
    """Text -> the lines and patches beside it, of every entry of ``legend``, in their order."""
    found = {}
    for row in legend.findobj(HPacker):
        if [type(child) for child in row.get_children()] == [DrawingArea, TextArea]:
            area, text = row.get_children()
            assert text.get_text() not in found
            found[text.get_text()] = [a for a in area.get_children() if isinstance(a, (Line2D, Patch))]
    assert list(found) == [text.get_text() for text in legend.get_texts()]
    return found


def looks(legend):
    """Text -> look, of every entry of ``legend`` that is one line."""
    return {text: look(artists[0]) for text, artists in entries(legend).items() if isinstance(artists[0], Line2D)}


def slope(line):
    """The slope of a line of two or more points in the logarithms of its data."""
    x, y = (np.log(np.asarray(values, dtype=float)) for values in line.get_data())
    steps = np.diff(y) / np.diff(x)
    assert np.ptp(steps) < 1e-9  # one straight line
    return steps[0]


def span(patch, axis=0):
    """Lowest and highest x (``axis`` 0) or y (1) of a patch drawn across the axes, in data coordinates."""
    along = patch.get_patch_transform().transform_path(patch.get_path()).vertices[:, axis]
    return along.min(), along.max()


def pixels(figure):
    """A function (axes, x, y) -> colour (r, g, b) from 0 to 1 of the picture there."""
    figure.canvas.draw()
    picture = np.asarray(figure.canvas.buffer_rgba())[::-1, :, :3] / 255

    def at(axes, x, y):
        column, row = axes.transData.transform((x, y))
        return picture[int(row), int(column)]

    return at


def luminance(colour):
    """Relative luminance of a colour (WCAG 2.1), 0 for black, 1 for white."""
    channels = [c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
    return float(np.dot([0.2126, 0.7152, 0.0722], channels))


def ticks(axis):
    """Label -> place, of the major ticks of an axis with fixed labels."""
    labels = [text.get_text() for text in axis.get_ticklabels()]
    return dict(zip(labels, axis.get_ticklocs(), strict=True))
