"""Content of the page of results: figures, tables, claims and links, read from files."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatch
from functools import cache, cached_property
from io import BytesIO
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import integrators
from nearharmonic.output.store import attributes_of, read
from nearharmonic.output.table import Table
from nearharmonic.plotting.profile import energy_error_label, energy_of, style_of
from nearharmonic_paper.claims.claim import OPEN, in_words, of_the_paper
from nearharmonic_paper.claims.claim import VERDICTS as IN_A_SENTENCE
from nearharmonic_paper.experiments.paper.orbits import paper_panels
from nearharmonic_paper.experiments.paper.run import PAPER as SYSTEMS_OF_THE_PAPER
from nearharmonic_paper.experiments.paper.run import Totals, totals_in
from nearharmonic_paper.record.manifest import Texts
from nearharmonic_paper.tasks.experiment import Figure, figures_of

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic_paper.report.plots import Panel


# --- Declared figures on the page: their order, ids and pages of their own; read while the workflow is parsed.

#: Experiment of the figures that may have interactive panels.
PAPER = "paper"
#: Interactive figures of other quantities than energy errors, by their file names: drawing function and hint.
OTHERS = {
    "gain": ("gain", ""),
    "fig2_decomposition": ("decomposition", ""),
    "fig4_perihelion": ("perihelion", "The interactive figure has arcseconds per century at each point."),
    "fig6_substeps": ("phase_space", ""),
}


def number_of(figure: Figure) -> int | None:
    """Return the number of a figure in the paper, None if it has none."""
    digits = figure.target.removeprefix("fig")
    return int(digits) if digits.isdigit() else None


def anchor_of(figure: Figure) -> str:
    """Return the id of a figure."""
    return f"figure-{number_of(figure) or figure.stem}"


def in_order(figures: Iterable[Figure]) -> list[Figure]:
    """Return figures: the gain, energy errors of the config's own systems, numbered figures, and others."""
    others = {True: 0, False: inf}
    return sorted(figures, key=lambda one: (one.stem != "gain", number_of(one) or others[one.profile], one.stem))


def pages_alone(figures: Iterable[Figure]) -> dict[str, str]:
    """Return the files of the pages that hold one interactive figure each, by the names of their outputs."""
    drawn = (one for one in in_order(figures) if one.experiment == PAPER and (one.profile or one.stem in OTHERS))
    anchors = map(anchor_of, drawn)
    return {anchor.replace("-", "_").replace(".", "_"): f"{anchor}.html" for anchor in anchors}


# --- Static pictures of pages.
#
# Reduced SVG files for pages of docs and, with small pictures, as data URIs for the page of results.

#: Redundant parts of the SVG files of matplotlib, and their replacements. Coordinates keep a hundredth of a point.
_SHORTER: tuple[tuple[re.Pattern[str], str | Callable[[re.Match[str]], str]], ...] = (
    (re.compile(r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>|<!--.*?-->", re.DOTALL), ""),
    (re.compile(r'<g id="[^"]*"'), "<g"),
    (re.compile(r'xlink:href="#'), 'href="#'),
    (re.compile("DejaVuFigures-"), "f"),  # names of outlines of letters
    # The outline referenced by a <use> has its own stroke style.
    (re.compile(r'(<use [^>]*?) style="fill: (#\w+); stroke: [^"]*"/>'), r'\1 fill="\2"/>'),
    (re.compile(r'(<use [^>]*?) style="stroke: [^"]*"/>'), r"\1/>"),
    # A function takes half the time of a template: there are 80 000 numbers.
    (re.compile(r'(scale\([^)]*\))|(?<=[ \n"(])(-?\d+\.\d\d)\d+'), lambda found: found[1] or found[2]),
    (re.compile(r"\s*\n\s*"), " "),
    (re.compile(r"> <"), "><"),
)
#: A path of straight lines: the letter of each line may be omitted.
_STRAIGHT = re.compile(r"M [^A-Za-z\"]+(?:L [^A-Za-z\"]+)+")
#: Successive lines of one style, such as error bars, become one path.
_ALIKE = re.compile(r'<path d="[^"]*"( clip-path="[^"]*" style="fill: none; [^"]*")/>(?:<path d="[^"]*"\1/>)+')
_OUTLINE = re.compile(r'd="([^"]*)"')
#: Width and height of a picture; a browser reserves its space by them.
_SIZE = re.compile(r'<svg [^>]*?width="([\d.]+)pt" height="([\d.]+)pt"')
#: Width of a small picture in pixels, for screens of two pixels per unit, and its quality of 100. Before it is resized,
#: it is reduced to twice this width or more, and compressed with half the effort: both halve the time.
_WIDTH, _QUALITY, _REDUCED, _EFFORT = 320, 70, 2.0, 2
#: Style of a picture of a page below docs. A browser compares with the ``color-scheme`` of the element that shows it.
_DARK = "@media (prefers-color-scheme:dark){svg{filter:invert(.91) hue-rotate(180deg)}.paper{display:none}}"
#: Characters that end a data URI or an attribute in single quotes, or have a special meaning there.
_ESCAPED = {"%": "%25", "#": "%23", "&": "%26", "'": "%27"}


def shorter(svg: str) -> str:
    """Return the text of an SVG file of matplotlib without invisible parts."""
    for pattern, replacement in _SHORTER:
        svg = pattern.sub(replacement, svg)
    svg = _STRAIGHT.sub(lambda path: path[0].replace("L ", ""), svg)
    return _ALIKE.sub(lambda run: f'<path d="{"".join(_OUTLINE.findall(run[0]))}"{run[1]}/>', svg).strip()


def picture(svg: str) -> str:
    """Return the text of an SVG file as a data URI for an attribute in single quotes."""
    text = shorter(svg)
    for character, code in _ESCAPED.items():  # a table of str.translate takes 30 times as long
        text = text.replace(character, code)
    return f"data:image/svg+xml,{text}"


def thumbnail(png: Path) -> str:
    """Return a small picture of a PNG file as a data URI."""
    from PIL import Image, WebPImagePlugin  # noqa: F401  else Pillow loads all its forty plugins

    with Image.open(png) as whole:
        height = round(_WIDTH * whole.height / whole.width)
        small = whole.convert("RGB").resize((_WIDTH, height), Image.Resampling.LANCZOS, reducing_gap=_REDUCED)
    held = BytesIO()
    small.save(held, "WEBP", quality=_QUALITY, method=_EFFORT)
    return f"data:image/webp;base64,{b64encode(held.getvalue()).decode()}"


def on_page(figure: str) -> dict[str, bytes]:
    """Return the SVG file ``figure`` as ``picture``, with inverted lightness and no background in the dark."""
    svg = Path(figure).read_text(encoding="utf-8").replace('<g id="patch_1">', '<g class="paper">', 1)
    return {"picture": (shorter(svg).replace("</style>", f"{_DARK}</style>", 1) + "\n").encode()}


def drawn(figure: Any) -> bytes:
    """Return a figure of matplotlib as the picture of a page."""
    from nearharmonic.plotting.style import save

    with TemporaryDirectory() as folder:
        return on_page(str(*save(figure, [f"{folder}/figure.svg"])))["picture"]


# --- Formats of numbers and verdicts on the page.

#: Pattern of a Python float; a number with more digits is an exact decimal.
_FLOAT = re.compile(r"-?\d+(\.\d+)?(e[+-]?\d+)?")
#: Most digits of a float, and its displayed digits.
_MOST_DIGITS_OF_A_FLOAT, _SHOWN = 17, 4


def cell(text: str) -> str:
    """Return the displayed text of a cell of a CSV file: a float with four digits, other cells unchanged."""
    if not _FLOAT.fullmatch(text) or ("." not in text and "e" not in text):
        return text
    digits = re.sub(r"e.*|\D", "", text).lstrip("0")
    return f"{float(text):.{_SHOWN}g}" if _SHOWN < len(digits) <= _MOST_DIGITS_OF_A_FLOAT else text


def is_number(text: str) -> bool:
    """Return True if a cell is a number, nan or an infinity."""
    return bool(_FLOAT.fullmatch(text)) or text in {"nan", "inf", "-inf"}


def percent(share: float) -> str:
    """Return a fraction as a percentage with two digits, or "below 0.01 %"."""
    return f"{100 * share:.2g}\N{NO-BREAK SPACE}%" if share >= 1e-4 or share == 0 else "below 0.01 %"


def tallied(claims: Sequence[Mapping[str, Any]]) -> str:
    """Return the number of statements with each verdict in words: 1 fails, 2 hold."""
    return in_words(Counter(claim["verdict"] for claim in claims))


def verdict(name: str, number: int) -> str:
    """Return a verdict on ``number`` statements: 1 holds, 2 hold."""
    return name if number == 1 else IN_A_SENTENCE[name].removeprefix("are ")


def counted(number: int, one: str, more: str = "") -> str:
    """Return ``number`` with its noun: 1 claim, 2 claims."""
    return f"{number} {one if number == 1 else more or one + 's'}"


def minutes(times: Iterable[str]) -> str:
    """Return the sum of durations such as "50 s" and "3 min", in whole minutes."""
    seconds = sum(float(number) * {"s": 1, "min": 60, "h": 3600}[unit] for number, unit in map(str.split, times))
    return counted(max(1, round(seconds / 60)), "minute")


#: End of the headline for verdicts on the gain over Ruth's method on planets.
_ON_PLANETS = {
    "holds in part": "; on planets the gain is orders of magnitude at some step sizes only",
    "fails": "; on planets the gain is a factor, not orders of magnitude",
}


def headline(claims: Sequence[Mapping[str, Any]]) -> str:
    """Return what came out: how much of the paper, or of its decided part, holds, and the gain on planets."""
    every = {claim["id"]: claim["verdict"] for claim in of_the_paper(claims)}
    decided = [verdict for verdict in every.values() if verdict != OPEN]
    good, many = sum(verdict in ("holds", "holds but for edges") for verdict in decided), len(decided)
    share = "Nothing" if not good else "All" if good == many else "Most" if 2 * good > many else "At most half"
    subject = "of the paper holds" if 2 * many > len(every) else "of what these runs decide holds"
    return f"{share} {subject}{_ON_PLANETS.get(every.get('outperform-ruth-kepler', OPEN), '')}"


# --- Tables of the page, from CSV files of the results, or from Markdown files with headings.
@dataclass(frozen=True, kw_only=True)
class ShownTable(Table):
    """A table of the page, with formatted cells, the id of its element, and the file with all digits.

    The id of the paper's Table 4 is "table-4"; the name of the file is relative to the folder of results.
    """

    anchor: str
    file: str


def tables_of(texts: Texts, stem: str, *, has_markdown: bool) -> list[ShownTable]:
    """Read the table ``tables/<stem>.csv``, with the caption above its Markdown.

    Markdown with headings is a summary of a long table; its tables are then returned. A ResultFileError says that a
    file is missing, damaged or no table.
    """
    file, anchor = f"tables/{stem}.csv", _anchor_of(stem)
    said = texts.read(f"tables/{stem}.md").splitlines() if has_markdown else []
    if said and said[0].startswith("# "):
        return [
            ShownTable(anchor=anchor, caption=f"{said[0][2:]}; {caption}", header=header, rows=rows, file=file)
            for caption, header, rows in _digests(said)
        ]
    table = texts.table(file)
    caption = said[0] if said else stem.replace("_", " ").capitalize()
    shown = [[cell(text) for text in row] for row in table.rows]
    return [ShownTable(anchor=anchor, caption=caption, header=table.header, rows=shown, file=file)]


def _digests(lines: Iterable[str]) -> Iterator[tuple[str, list[str], list[list[str]]]]:
    """Yield the tables of a Markdown text, each with its heading."""
    heading, rows = "", []
    for line in [*lines, ""]:
        if line.startswith("|"):
            rows.append([cell.strip().strip("*`") for cell in line.strip("| ").split("|")])
            continue
        if rows:
            yield heading, rows[0], rows[2:]
            rows = []
        if line.startswith("## "):
            heading = line[3:].strip()


def _anchor_of(stem: str) -> str:
    name, _, rest = stem.partition("_")
    digits = name.removeprefix("table")
    return f"table-{digits}" if digits.isdigit() and rest != "derived" else f"table-{stem}"


# --- Content of the page for a folder of results: claims, tables and figures, read from files.

#: Verdicts in the order of the page, each with the name of its style.
VERDICTS = {
    "holds": "holds",
    "holds but for edges": "edges",
    "holds in part": "part",
    "fails": "fails",
    "erratum": "erratum",
    OPEN: "open",
}


class ShownResults:
    """A folder of results, ``results/<name>``, without files of these names, which are leftovers of another config.

    A ResultFileError says that a file is missing or damaged, and has the command that makes it again.
    """

    def __init__(self, folder: Path, leftovers: Sequence[str] = ()) -> None:
        self.folder = folder
        self._leftovers = leftovers
        self._texts = Texts(folder)

    @cached_property
    def claims(self) -> list[dict[str, Any]]:
        """The objects of ``tables/claims.json``; none without a system of the paper."""
        if not self.has_systems_of_the_paper:
            return []
        name = "tables/claims.json"
        text = self._texts.read(name)
        try:
            found = list(json.loads(text))
            known = all(claim["verdict"] in VERDICTS and claim["paper"]["sentence"] for claim in found)
        except (ValueError, KeyError, TypeError) as error:
            raise self._texts.unusable(name, "is damaged") from error
        if not known:
            raise self._texts.unusable(name, f"has a verdict that is none of {', '.join(VERDICTS)}")
        return found

    @cached_property
    def figures(self) -> list[Figure]:
        """The existing declared figures, in the order of the page."""
        cubes = self.stems("cubes", ".h5")
        drawn = self.stems("figures", ".svg")
        return in_order(one for one in figures_of(cubes, cubes) if one.stem in drawn)

    @property
    def has_systems_of_the_paper(self) -> bool:
        """True if a system of the paper has a cube."""
        return not set(SYSTEMS_OF_THE_PAPER).isdisjoint(self.labels)

    @property
    def leftovers(self) -> list[str]:
        """Names of the leftovers, each once for all its formats."""
        return sorted({name.partition(".")[0] for name in self._leftovers})

    def pictures(self, stem: str) -> dict[str, Any]:
        """Return the name of a figure's files, its picture, its small picture, "" without a PNG file, and its size."""
        png = self.folder / f"figures/{stem}.png"
        svg = self._texts.read(f"figures/{stem}.svg")
        small, size = thumbnail(png) if png.is_file() else "", _SIZE.search(svg)
        return {"stem": stem, "picture": picture(svg), "thumbnail": small, "size": size.groups() if size else ()}

    @property
    def files(self) -> dict[str, list[str]]:
        """Paths of all cubes and tables, by kind."""
        kinds = {"cubes": ".h5", "tables": ".csv"}
        return {kind: [f"{kind}/{stem}{suffix}" for stem in self.stems(kind, suffix)] for kind, suffix in kinds.items()}

    @cached_property
    def labels(self) -> dict[str, str]:
        """Labels of the systems that have a cube, by name."""
        attributes = {stem: attributes_of(self.folder / f"cubes/{stem}.h5") for stem in self.stems("cubes", ".h5")}
        return {stem: told["system_label"] for stem, told in attributes.items() if "system_label" in told}

    def stems(self, folder: str, suffix: str, patterns: Sequence[str] = ("*",)) -> list[str]:
        """Return the names of the files below ``folder`` that match one of ``patterns``, sorted by pattern and name."""
        paths = (self.folder / folder).glob(f"*{suffix}")
        found = sorted(path.stem for path in paths if f"{folder}/{path.name}" not in self._leftovers)
        return list(dict.fromkeys(stem for pattern in patterns for stem in found if fnmatch(stem, pattern)))

    def tables(self, patterns: Sequence[str], without: Sequence[str] = ()) -> list[ShownTable]:
        """Read the tables whose file names match one of ``patterns`` and none of ``without``; all anchors differ."""
        found: dict[str, ShownTable] = {}
        for stem in self.stems("tables", ".csv", patterns):
            if not any(fnmatch(stem, pattern) for pattern in without):
                has_markdown = (self.folder / "tables" / f"{stem}.md").is_file()
                for one in tables_of(self._texts, stem, has_markdown=has_markdown):
                    anchor = f"{one.anchor}-{len(found)}" if one.anchor in found else one.anchor
                    found[anchor] = replace(one, anchor=anchor)
        return list(found.values())

    @cached_property
    def saving(self) -> Totals:
        """The totals of ``tables/skipped.csv``."""
        name = "tables/skipped.csv"
        text = self._texts.read(name)
        try:
            return totals_in(text)
        except NearharmonicError as error:
            raise self._texts.unusable(name, "holds no totals") from error


# --- Figures of the page, interactive and static, with their texts and the legend of the methods.

_HINT = "Squares at the upper edge are runs that diverged."


@dataclass(kw_only=True)
class ShownFigure:
    """A figure of the page, with its files, the pictures of them as data URIs, "" if they are omitted, and their size.

    ``anchor`` is the id of its element, and the name of the page of this figure alone. ``hint`` is a sentence on what
    the interactive panels have besides, and ``document`` the compressed document of their plots. ``statements`` are
    statements of the paper that the figure decides or illustrates, the worst first, and ``methods`` the labels in its
    panels by name. The energy errors of a system that the paper does not have ``is_own``.
    """

    anchor: str
    title: str
    caption: str
    stem: str
    cube: str | None = None
    cubes: Sequence[str] = ()
    picture: str = ""
    thumbnail: str = ""
    size: Sequence[str] = ()
    statements: list[dict[str, Any]] = field(default_factory=list)
    hint: str = ""
    panels: list[Panel] = field(default_factory=list)
    document: str = ""
    methods: dict[str, str] = field(default_factory=dict)
    is_own: bool = False

    @property
    def files(self) -> dict[str, str]:
        """Paths of its files from the page, by names for links."""
        cubes = {f"{name} data (HDF5)": f"cubes/{name}.h5" for name in self.cubes}
        cubes |= {"data (HDF5)": f"cubes/{self.cube}.h5"} if self.cube else {}
        alone = {"figure alone": f"{self.anchor}.html"} if self.panels else {}
        return {kind.upper(): f"figures/{self.stem}.{kind}" for kind in ("pdf", "svg", "png")} | cubes | alone

    @property
    def plots(self) -> dict[str, Any]:
        """The plots by the ids of their elements."""
        return {f"{self.anchor}-panel-{i}": panel.plot for i, panel in enumerate(self.panels, start=1)}


def interactive(results: ShownResults) -> Iterator[ShownFigure]:
    """Yield the existing figures of the paper, and the existing energy-error figures of other systems."""
    from nearharmonic_paper.report import plots

    cubes = cache(lambda name: read(results.folder / f"cubes/{name}.h5"))
    for one in results.figures:
        if one.experiment != PAPER:
            continue
        number, title, caption, panels = number_of(one), one.title, one.caption, {}
        draw, hint = ("energy_error", _HINT) if one.profile else OTHERS.get(one.stem, ("", ""))
        if draw:
            shown: list[Any] = [cubes(name) for name in one.cubes or [one.cube] if name] or [paper_panels()]
            data = shown[0]
            panels = {"panels": getattr(plots, draw)(*shown, **one.settings), "hint": hint, "methods": _methods(data)}
            if one.profile:
                title = f"Energy error against step size: {data.attrs['system_label']}"
                caption = _caption(caption, data)
        yield ShownFigure(
            anchor=anchor_of(one),
            title=f"Figure {number}. {title}" if number else title,
            caption=caption,
            cube=one.cube,
            cubes=one.cubes,
            is_own=one.profile and number is None,
            **results.pictures(one.stem),
            **panels,
        )


def static(results: ShownResults, titles: Mapping[str, str]) -> Iterator[ShownFigure]:
    """Yield the other figures whose file names match one of the patterns in ``titles``.

    The part of the name that matches the wildcard, the name of a system, is added to the title.
    """
    declared, labels = {one.stem: one for one in results.figures}, results.labels
    for stem in results.stems("figures", ".svg", list(titles)):
        pattern = next(pattern for pattern in titles if fnmatch(stem, pattern))
        rest = stem.removeprefix(pattern.rstrip("*")) if "*" in pattern else ""
        title = titles[pattern] + (f": {labels.get(rest, rest)}" if rest else "")
        caption, cube = (declared[stem].caption, declared[stem].cube) if stem in declared else ("", None)
        yield ShownFigure(anchor=f"figure-{stem}", title=title, caption=caption, cube=cube, **results.pictures(stem))


def _caption(caption: str, cube: xr.Dataset) -> str:
    """Return ``caption`` with the energy of ``cube``, and what its errors are unless they are relative to |H0|."""
    relative = "|ΔH/H₀|"
    label = energy_error_label(cube["max_energy_error"].attrs, "|ΔH|", relative)
    if label != relative:
        caption = f"{caption.replace('relative energy', 'energy')} Energy errors are {label}."
    return f"{caption} The energy at the start is H₀ = {H0}." if (H0 := energy_of(cube.attrs)) else caption


def _methods(cube: Any) -> dict[str, str]:
    if isinstance(cube, dict):  # paths of substeps
        return {path.attrs["integrator"]: path.attrs["label"] for path in cube.values()}
    names, labels = (map(str, cube[name].values) for name in ("integrator", "label"))
    return dict(zip(names, labels, strict=True))


def coefficients(methods: Iterable[str]) -> list[dict[str, Any]]:
    """Return coefficients, as doubles, and colours of registered methods that are sequences of kicks and drifts."""
    found = (integrators[name] for name in methods if name in integrators)
    return [
        {"name": one.name, "label": one.label, "first": one.first, "colour": style_of(one.name).colour}
        | {"kick": list(map(float, one.kick)), "drift": list(map(float, one.drift))}
        for one in found
        if not (one.square or one.implicit or one.modified)
    ]


class Entry(NamedTuple):
    """A method in the legend: name, label, and marker as an SVG path with colours."""

    method: str
    label: str
    outline: str
    colour: str
    fill: str


def entries(figures: Iterable[ShownFigure]) -> list[Entry]:
    """Return an entry for each method that a figure draws, in the order of the figure with the most methods."""
    from nearharmonic_paper.report.plots import MARKERS

    drawn = sorted(figures, key=lambda figure: -len(figure.methods))
    methods = {method: label for figure in reversed(drawn) for method, label in figure.methods.items()}
    ordered = dict.fromkeys(method for figure in drawn for method in figure.methods)
    return [
        Entry(name, methods[name], MARKERS[one.marker].outline, one.colour, one.colour if one.filled else "#ffffff")
        for name, one in zip(ordered, map(style_of, ordered), strict=True)
    ]


# --- Links from the claims to the figures and tables with their numbers.

#: A piece of text, and the anchor of its link, "" without a link.
Piece = tuple[str, str]

#: Pattern of figures and tables in the text of a claim.
_NAMED = re.compile(r"\b(Figures?|Figs?\.|Tables?)\s+(\d+(?:(?:,\s*|\s*(?:and|to|-|–)\s*)\d+)*)")
_NUMBERED = re.compile(r"(figure|table)-(\d+)")


class Places:
    """Places of all figures and tables on the page."""

    def __init__(self, figures: Iterable[ShownFigure], tables: Iterable[ShownTable]) -> None:
        self._shown: dict[str, list[Piece]] = {}
        self._anchors: set[str] = set()
        for figure in figures:
            self._add(f"cubes/{figure.cube}.h5", figure.anchor, figure.title)
        for table in tables:
            name = table.file.rpartition("/")[2].partition(".")[0]
            self._add(table.file, table.anchor, f"table of {name.replace('_', ' ')}")

    def _add(self, file: str, anchor: str, title: str) -> None:
        numbered = _NUMBERED.fullmatch(anchor)
        self._anchors.add(anchor)
        self._shown.setdefault(file, []).append(
            (f"{numbered[1].capitalize()} {numbered[2]}" if numbered else title, anchor)
        )

    def pieces(self, claim: Mapping[str, Any]) -> list[Piece]:
        """Return the position of ``claim`` in the paper, with links to the figures and tables that it names.

        If it names none on the page, links to the figures and tables of the files of the claim follow.
        """
        pieces = self._named(str(claim["paper"]["section"]))
        if any(anchor for _, anchor in pieces):
            return pieces
        shown = dict.fromkeys(piece for file in claim["needs"] for piece in self._shown.get(str(file), []))
        for i, piece in enumerate(shown):
            pieces += [(", " if i else "; shown in ", ""), piece]
        return pieces

    def figures(self, claim: Mapping[str, Any]) -> list[str]:
        """Return the ids of the figures that show the data of ``claim`` or that its place in the paper names."""
        anchors = [anchor for _, anchor in self.pieces(claim)]
        return [anchor for anchor in dict.fromkeys(anchors) if anchor.startswith("figure-")]

    def _named(self, text: str) -> list[Piece]:
        pieces: list[Piece] = []
        end = 0
        for named in _NAMED.finditer(text):
            kind = "table" if named[1].startswith("Table") else "figure"
            for number in re.finditer(r"\d+", named[2]):
                anchor = f"{kind}-{number[0]}"
                if anchor in self._anchors:
                    begin = named.start(2) + number.start() if number.start() else named.start()
                    stop = named.start(2) + number.end()
                    pieces += [(text[end:begin], ""), (text[begin:stop], anchor)]
                    end = stop
        return [piece for piece in [*pieces, (text[end:], "")] if piece[0]]
