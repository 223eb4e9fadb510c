"""Frames of films of trajectories, as a GIF file or in an HTML page."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Sequence
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from nearharmonic.plotting.drawing import in_brackets
from nearharmonic.plotting.plot import plot
from nearharmonic.plotting.style import house_style, panel_letter, right_title

if TYPE_CHECKING:
    import xarray as xr

#: Pixels per inch.
DPI = 90
_PAGE = """<!DOCTYPE html>
<meta charset="utf-8"><title>{title}</title>
<style>body{{font:14px sans-serif;text-align:center}}img{{max-width:100%}}input{{width:60%}}</style>
<img alt="{title}"><br><button>pause</button> <input type="range" min="0" max="{last}" value="0">
<script>
const frames={frames},at=s=>document.querySelector(s),slider=at("input"),button=at("button");
let playing=true;
function show(k){{slider.value=k;at("img").src="data:image/png;base64,"+frames[k];}}
slider.oninput=()=>{{playing=false;button.textContent="play";show(+slider.value);}};
button.onclick=()=>{{playing=!playing;button.textContent=playing?"pause":"play";}};
setInterval(()=>{{if(playing)show((+slider.value+1)%frames.length);}},{interval});
show(0);
</script>
"""


def gif(given: Sequence[xr.Dataset], frames: int, fps: int, title: str | None) -> bytes:
    """Return the film of trajectories as a GIF file."""
    first, *others = [Image.open(BytesIO(one)).convert("RGB") for one in _pictures(given, frames, title)]
    content = BytesIO()
    first.save(content, "GIF", save_all=True, append_images=others, duration=int(1000 / fps), loop=0)
    return content.getvalue()


def page(given: Sequence[xr.Dataset], frames: int, fps: int, title: str | None) -> str:
    """Return the film of trajectories as an HTML page, which needs no network."""
    return _PAGE.format(
        title=escape(title or "orbit and energy error"), last=frames - 1, interval=round(1000 / fps),
        frames=[b64encode(one).decode() for one in _pictures(given, frames, title)],
    )  # fmt: skip


@house_style
def _pictures(given: Sequence[xr.Dataset], frames: int, title: str | None) -> list[bytes]:
    """Return the frames as PNG files."""
    figure = plot(given, title=title)
    show, found = truncator(figure, given), []
    figure.set_dpi(DPI)
    for k in range(frames):
        show(k / (frames - 1))
        picture = BytesIO()
        FigureCanvasAgg(figure).print_png(picture)  # type: ignore[no-untyped-call]
        found.append(picture.getvalue())
    return found


def truncator(figure: Figure, given: Sequence[xr.Dataset]) -> Callable[[float], None]:
    """Put the orbit above the energy error, and return a function that cuts both at a share of the time.

    ``figure`` is the plot of the trajectories ``given``.
    """
    energy, orbit = figure.axes
    upper, lower = energy.get_position(), orbit.get_position()
    energy.set_position((lower.x0, lower.y0, upper.width, upper.height))
    orbit.set_position((upper.x0, upper.y1 - lower.height, lower.width, lower.height))
    for axes, letter in ((orbit, "A"), (energy, "B")):
        panel_letter(axes, letter, axes.get_title(loc="left").partition("  ")[2])
    figure.draw_without_rendering()  # the limits of complete curves
    curves = [(orbit.lines[2 * k], energy.lines[k]) for k in range(len(given))]
    whole = [[np.array(line.get_xydata()) for line in pair] for pair in curves]
    dots = [orbit.plot([], [], "o", markersize=6, color=line.get_color())[0] for _, line in curves]
    times = [one["t"].values for one in given]
    first, last = min(t[0] for t in times), max(t[-1] for t in times)
    unit = in_brackets(str(given[0]["t"].attrs.get("units", "1")))

    def show(share: float) -> None:
        now = first + share * (last - first)
        for t, pair, points, dot in zip(times, curves, whole, dots, strict=True):
            passed = (np.searchsorted(t, now * (1 + 1e-12), side="right") - 1) / max(1, len(t) - 1)
            for line, all_of_it in zip(pair, points, strict=True):
                line.set_data(*all_of_it[: round(passed * (len(all_of_it) - 1)) + 1].T)
            dot.set_data(*np.array(pair[0].get_xydata())[-1:].T)
        right_title(orbit, f"$t$ = {now:.4g}{unit}")

    return show
