"""The pictures of docs/start/gallery.md: those that the examples draw, each with the code that draws it."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import dedent
from typing import TYPE_CHECKING, Any

from nearharmonic.output.page import filled_page
from nearharmonic.plotting.style import house_style, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Small pictures side by side, and their width in pixels.
COLUMNS, WIDTH = 4, 330
#: The last line of an example, which writes its picture and tells where.
_WRITTEN = re.compile(r'print\("wrote", save\((.+), \["(\w+\.png)"\]\)\[0\]\.resolve\(\)\)')


def page(page: str, files: Sequence[str], systems: Sequence[str], integrators: Sequence[str]) -> dict[str, Any]:
    """Fill the page, and draw its figure. ``files`` are paths of the examples, which are run."""
    places = sorted(map(Path, files))
    return {"page": filled_page(page, {"gallery": entries(places)}), "figure": drawn(places)}


def entries(places: Sequence[Path]) -> str:
    """Return for each example its title and, folded, the lines that make its picture."""
    found = []
    for place in places:
        text = place.read_text(encoding="utf-8")
        title = (ast.get_docstring(ast.parse(text)) or place.stem).splitlines()[0]
        found += [
            f'<details id="{place.stem}"><summary><b>{place.stem}</b>: {title}</summary>', "", "```python",
            drawing_lines(text), "```", "", f"[{place.name}](../../examples/{place.name})", "", "</details>", "",
        ]  # fmt: skip
    return "\n".join(found).rstrip()


def drawing_lines(text: str) -> str:
    """Return the body of the function ``main`` of an example; its last line writes the picture, and no more."""
    (main,) = (node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef) and node.name == "main")
    lines = text.splitlines()[main.body[0].lineno - 1 : main.end_lineno]
    return _WRITTEN.sub(r'\1.savefig("\2")', dedent("\n".join(lines))).strip()


@house_style
def drawn(places: Sequence[Path]) -> Figure:
    """Run the examples, and return their pictures side by side, each with its name."""
    import numpy as np
    from PIL import Image

    rows = -(-len(places) // COLUMNS)
    figure = new_figure(7, 1.85 * rows)
    figure.subplots_adjust(left=0.01, right=0.99, bottom=0.01, top=0.985, wspace=0.05, hspace=0.13)
    cells = figure.subplots(rows, COLUMNS).ravel()
    for cell in cells:
        cell.set_axis_off()
    for cell, place in zip(cells, places, strict=False):
        with Image.open(BytesIO(_picture(place))) as whole:
            small = whole.convert("RGB").resize(
                (WIDTH, round(WIDTH * whole.height / whole.width)), Image.Resampling.LANCZOS
            )
        cell.imshow(np.asarray(small), interpolation="none")
        cell.set_title(place.stem, fontsize=7.5, pad=2)
    return figure


def _picture(place: Path) -> bytes:
    """Run an example in a folder of its own, and return the bytes of the picture that it writes."""
    with TemporaryDirectory() as folder:
        subprocess.run([sys.executable, str(place.resolve())], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        (made,) = Path(folder).glob("*.png")
        return made.read_bytes()
