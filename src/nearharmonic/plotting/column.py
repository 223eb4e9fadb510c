"""Figures of the width of a column of text."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.offsetbox import VPacker
from matplotlib.text import Text

from nearharmonic.plotting.style import house_style

#: Width in inches (85 mm), smallest size of text in points, and factors of sizes of text and margins, and of panels.
WIDTH, SMALLEST, SMALLER, FLATTER = 85 / 25.4, 6.0, 0.72, 0.62
#: Height of a line of text in inches.
LINE = 9 / 72


@house_style
def narrow(figure: Figure) -> None:
    """Make a wider figure 85 mm wide, with text of at least 6 pt, thinner lines and fewer legend entries in a row."""
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    width, height = figure.get_size_inches()
    if width == WIDTH:
        return
    dpi, edges = figure.dpi, figure.subplotpars
    before = sum(legend.get_window_extent(renderer).height for legend in figure.legends) / dpi
    figure.set_size_inches(WIDTH, height * FLATTER)
    found: Any = figure.findobj
    for axes in (panels := found(Axes)):
        axes.tick_params(which="both", labelsize=SMALLEST, length=2)
    for text in found(Text):
        text.set_fontsize(max(SMALLEST, SMALLER * text.get_fontsize()))
    for line in found(Line2D):
        line.set(linewidth=0.75 * line.get_linewidth(), markersize=0.7 * line.get_markersize())
    after = sum(_pack(legend, figure, renderer) for legend in figure.legends) / dpi
    share, above = SMALLER / WIDTH, SMALLER * ((1 - edges.top) * height - before) + after
    figure.subplots_adjust(
        left=edges.left * width * share, right=1 - (1 - edges.right) * width * share,
        bottom=SMALLER / FLATTER * edges.bottom, hspace=1.2 * edges.hspace, wspace=1.5 * edges.wspace,
    )  # fmt: skip
    second_line = 0.0
    for axes in panels:  # two titles that do not fit in a line take two
        places = {"left": 10 / 72 * dpi / axes.bbox.width, "right": 1}
        said = {side: axes.get_title(side) for side in places}
        shown = [axes.set_title(s, loc=side, x=places[side], y=1, fontsize=6.5, pad=3) for side, s in said.items() if s]
        if sum(one.get_window_extent(renderer).width for one in shown) > 0.9 * axes.bbox.width:
            shown[-1].set_y(1 + LINE * dpi / axes.bbox.height)
            second_line = LINE
    figure.subplots_adjust(top=1 - (above + second_line) / figure.get_figheight())


def _pack(legend: Legend, figure: Figure, renderer: Any) -> float:
    """Arrange the entries of a legend in as many columns as fit, at most four, and return its height in pixels."""
    box: Any = legend.get_children()[0]
    columns = box.get_children()[-1]
    entries = [entry for column in columns.get_children() for entry in column.get_children()]
    columns.sep *= 0.5
    for number in (4, 3, 2, 1):
        rows = -(-len(entries) // number)
        parts = [VPacker(children=entries[i : i + rows], sep=2, align="baseline") for i in range(0, len(entries), rows)]
        for part in parts:
            part.set_figure(figure)
        columns.get_children()[:] = parts
        if box.get_window_extent(renderer).width < figure.bbox.width:
            break
    return float(legend.get_window_extent(renderer).height)
