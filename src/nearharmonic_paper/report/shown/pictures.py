"""Static pictures of pages.

The page of results has reduced SVG files and small pictures as data URIs for img elements; pages below docs have PNG
files of few colours.
"""

from __future__ import annotations

import re
from base64 import b64encode
from io import BytesIO
from pathlib import Path

#: Redundant parts of the SVG files of matplotlib, and their replacements. Coordinates keep a hundredth of a point.
_SHORTER = (
    (re.compile(r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>|<!--.*?-->", re.DOTALL), ""),
    (re.compile(r'<g id="[^"]*"'), "<g"),
    (re.compile(r'xlink:href="#'), 'href="#'),
    # The outline referenced by a <use> has its own stroke style.
    (re.compile(r'(<use [^>]*?) style="fill: (#\w+); stroke: [^"]*"/>'), r'\1 fill="\2"/>'),
    (re.compile(r'(<use [^>]*?) style="stroke: [^"]*"/>'), r"\1/>"),
    (re.compile(r'(scale\([^)]*\))|(?<=[ \n"])(-?\d+\.\d\d)\d+'), r"\1\2"),
    (re.compile(r"\s*\n\s*"), " "),
    (re.compile(r"> <"), "><"),
)
#: A path of straight lines: the letter of each line may be omitted.
_STRAIGHT = re.compile(r"M [^A-Za-z\"]+(?:L [^A-Za-z\"]+)+")
#: Successive lines of one style, such as error bars, become one path.
_ALIKE = re.compile(r'<path d="[^"]*"( clip-path="[^"]*" style="fill: none; [^"]*")/>(?:<path d="[^"]*"\1/>)+')
_OUTLINE = re.compile(r'd="([^"]*)"')
#: Width of a small picture in pixels, for screens of two pixels per unit, and its quality of 100.
_WIDTH, _QUALITY = 320, 70
#: Largest width in pixels of a PNG file of a page below docs.
WIDEST = 1100
#: Characters that end a data URI or an attribute in single quotes, or have a special meaning there.
_ESCAPED = str.maketrans({"%": "%25", "#": "%23", "&": "%26", "'": "%27"})


def shorter(svg: str) -> str:
    """Return the text of an SVG file of matplotlib without invisible parts."""
    for pattern, replacement in _SHORTER:
        svg = pattern.sub(replacement, svg)
    svg = _STRAIGHT.sub(lambda path: path[0].replace("L ", ""), svg)
    return _ALIKE.sub(lambda run: f'<path d="{"".join(_OUTLINE.findall(run[0]))}"{run[1]}/>', svg).strip()


def picture(svg: str) -> str:
    """Return the text of an SVG file as a data URI for an attribute in single quotes."""
    return "data:image/svg+xml," + shorter(svg).translate(_ESCAPED)


def thumbnail(png: Path) -> str:
    """Return a small picture of a PNG file as a data URI."""
    from PIL import Image

    with Image.open(png) as whole:
        height = round(_WIDTH * whole.height / whole.width)
        small = whole.convert("RGB").resize((_WIDTH, height), Image.Resampling.LANCZOS)
    held = BytesIO()
    small.save(held, "WEBP", quality=_QUALITY)
    return f"data:image/webp;base64,{b64encode(held.getvalue()).decode()}"


def few_colours(figure: str, colours: int) -> dict[str, bytes]:
    """Return the PNG file ``figure`` in few colours, at most :data:`WIDEST` pixels wide, as ``picture``.

    20 colours are enough for lines; pale areas and shades need more.
    """
    from PIL import Image

    with Image.open(figure) as whole, BytesIO() as file:
        shown = whole.convert("RGB")
        if shown.width > WIDEST:
            shown = shown.resize((WIDEST, round(WIDEST * shown.height / shown.width)), Image.Resampling.LANCZOS)
        few = shown.quantize(colours, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE)
        few.save(file, "PNG", optimize=True)
        return {"picture": file.getvalue()}
