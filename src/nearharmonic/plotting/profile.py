"""Content of figures of energy errors, on paper and in a browser, without matplotlib: curves, labels, looks of methods.

Methods differ in colour, and in marker and filling, for grey print and colour-blind readers. Methods of Nielsen (2015)
have filled markers, and other methods of that paper have hollow markers. Dashes are free for other distinctions in a
figure (extended precision, composition).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple
from zlib import crc32

import numpy as np

from nearharmonic.numerics.portable import Floats

if TYPE_CHECKING:
    import xarray as xr


#: Panels of a benchmark profile: variable, and statistic.
PANELS = {"max_energy_error": "maximum", "mean_energy_error": "mean"}
#: Units of time in words.
UNITS = {"h": "hours", "s": "seconds", "d": "days", "yr": "years"}
#: Upper end of the axis: an error of ten times the energy belongs to a diverged run.
LARGEST_ERROR = 10.0

#: The line of the rounding of a potential is drawn if an error is at most this multiple of it.
SHOWN = 100.0
#: Hours of a year, as the paper counts them.
YEAR = 8766
#: Columns of a figure: 0.3 mm each in a figure 7 inches wide.
COLUMNS = 500


class Line(NamedTuple):
    """The runs of one method in one precision, variables over tau_per_stage, as a curve of a figure.

    Infinite errors (diverged runs), NaN (not computed) and zeros leave gaps. ``turn`` is the index of the method and
    the number of methods, whose markers are at alternate points.
    """

    integrator: str
    label: str
    runs: xr.Dataset
    turn: tuple[int, int]
    extended: bool = False

    def dashes(self) -> tuple[int, tuple[int, int]]:
        """Return offset and lengths of dashes: of three methods with one curve, each is seen in the gaps of others."""
        return 3 * (self.turn[0] % 3), (4, 5)


def lines(cube: xr.Dataset, names: Iterable[str] = tuple(PANELS), columns: int = COLUMNS) -> list[Line]:
    """Return the curves of the variables ``names`` of a cube in drawing order, each as its :func:`envelope`.

    Dimensions are (integrator, tau_per_stage), optionally led by precision.
    """
    methods, shown = cube.sizes["integrator"], list(names)
    found = []
    for precision in cube["precision"].values.tolist() if "precision" in cube.dims else [""]:
        layer = cube.sel(precision=precision) if precision else cube
        for i in range(methods):
            runs = envelope(layer.isel(integrator=i), shown, columns)
            integrator, label = (str(runs[name].item()) for name in ("integrator", "label"))
            found.append(Line(integrator, label, runs, (i, methods), precision == "extended"))
    return found


def lone(values: Floats) -> Any:
    """Return a mask of the numbers that no line leads to: positive ones, whose neighbours are none."""
    there = np.pad(np.isfinite(values) & (values > 0), 1)
    return there[1:-1] & ~there[:-2] & ~there[2:]


def beyond(curves: Sequence[Line], variable: str) -> tuple[list[tuple[int, xr.Dataset]], str]:
    """Return the rows of the strip above a panel, index of a curve and its runs outside the panel, and their name.

    These runs diverged, or their error ``variable`` is above :data:`LARGEST_ERROR`.
    """
    found = [line.runs[variable] > LARGEST_ERROR for line in curves]
    rows = [(i, curves[i].runs.isel({out.dims[0]: out.values})) for i, out in enumerate(found) if out.any()]
    finite = any(np.isfinite(runs[variable]).any() for _, runs in rows)
    return rows, f"diverged,\nor > {LARGEST_ERROR:g}" if finite else "diverged"


def problem_of(results: xr.Dataset, unit: str = "1") -> str:
    """Return system, interval and energy of runs, as far as attributes tell; ``unit`` is the unit of time."""
    try:
        settings = json.loads(results.attrs["settings"])
        t_end = {**settings.get("settings", {}), **settings.get("sweep", {})}["t_end"]
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError):
        t_end = None
    interval = "" if t_end is None else rf"$t \in [0, {t_end}]$" + ("" if unit == "1" else f" {unit}")
    if unit == "h" and t_end and float(t_end) % YEAR == 0:
        interval = f"{float(t_end) / YEAR:.0f} years".replace("10 ", "ten ")
    H0 = energy_of(results.attrs)
    return ", ".join(filter(None, (str(results.attrs.get("system_label", "")), interval, H0 and f"$H_0$ = {H0}")))


def range_of(attributes: Mapping[str, str]) -> str:
    """Return the range of the maximum of energy errors with these attributes, in words."""
    return "over the samples" if "over the samples" in attributes.get("long_name", "") else "over all steps"


def floor_near(given: Sequence[xr.Dataset], variable: str) -> float:
    """Return the highest attribute ``energy_floor`` of results, or 0 if no error ``variable`` is near it."""
    floor = max(float(one.attrs.get("energy_floor", 0)) for one in given)
    errors = np.concatenate([np.abs(np.ravel(one[variable].values)) for one in given])
    return floor if np.any((errors > 0) & (errors <= SHOWN * floor)) else 0.0


def floor_name(floor: float) -> str:
    """Return the label of the line of the rounding of a potential."""
    return f"rounding of V, {floor:.0e}"


def energy_error_label(attributes: Mapping[str, str], absolute: str, relative: str) -> str:
    """Return the label of an axis of energy errors, relative to |H0| unless their attributes say otherwise.

    ``absolute`` and ``relative`` are the symbols of |H - H0| and of |H - H0|/|H0|.
    """
    meaning = attributes.get("long_name", "|H - H0|/|H0|")
    if "p_t" in meaning:
        absolute, relative = f"{absolute} of $T + V + p_t$", f"{relative} of $T + V + p_t$"
    scale = re.search(r"\|H - H0\|/\((\S+) (.*?)\)(?: over|, |$)", meaning)
    if scale:
        return f"{absolute} relative to energy_scale {scale[1]}" + ("" if scale[2] == "1" else f", in {scale[2]}")
    if "|H - H0|/|H0|" not in meaning:
        return f"{absolute} ({attributes.get('units', '1')})"
    return f"{relative}, or {absolute} where H0 = 0" if "where H0 = 0" in meaning else relative


def energy_of(attributes: Mapping[str, Any]) -> str:
    """Return the energy at the start with its unit, "" if the attributes of a cube have none."""
    if "energy_at_start" not in attributes:
        return ""
    unit = attributes.get("energy_unit", "1")
    return f"{float(attributes['energy_at_start']):.6g}" + ("" if unit == "1" else f" {unit}")


def envelope(curve: xr.Dataset, names: Iterable[str], columns: int = COLUMNS) -> xr.Dataset:
    """Return the points of a curve that determine its drawing against a logarithmic step size.

    Of each of ``columns`` of equal width in the logarithm they are, for each variable in ``names``, the first, last,
    lowest and highest number, and the first and last point without a number. A curve of fewer than four points a column
    is returned as it is.
    """
    if curve.sizes["tau_per_stage"] <= 4 * columns:
        return curve
    place = np.log(curve["tau_per_stage"].values)
    edges = np.searchsorted(place, np.linspace(place[0], place[-1], columns + 1)[1:-1])
    kept = {index for name in names for index in _extremes(curve[name].values, [0, *edges.tolist(), place.size])}
    return curve.isel(tau_per_stage=sorted(kept))


def _extremes(values: Floats, edges: list[int]) -> Iterator[int]:
    """Yield the indices of first, last, lowest and highest number and of first and last gap in each column."""
    drawable = np.isfinite(values)
    for begin, end in pairwise(edges):
        numbers, gaps = (begin + np.flatnonzero(among[begin:end]) for among in (drawable, ~drawable))
        if numbers.size:
            yield from (int(numbers[0]), int(numbers[-1]))
            yield from (int(numbers[values[numbers].argmin()]), int(numbers[values[numbers].argmax()]))
        if gaps.size:
            yield from (int(gaps[0]), int(gaps[-1]))


def spread(heights: Floats, row: float) -> Floats:
    """Return the nearest heights to ``heights``, in ascending order, that are a row apart, by isotonic regression."""
    steps, count = row * np.arange(len(heights)), len(heights)
    free = heights - steps
    ranks = [max(min(free[j : k + 1].mean() for k in range(i, count)) for j in range(i + 1)) for i in range(count)]
    found: Floats = np.add(steps, ranks)
    return found


def darker(colour: str) -> str:
    """Return the hexadecimal name of a colour a quarter darker, for text in the colour of a curve."""
    return "#" + "".join(f"{int(0.75 * int(colour[i : i + 2], 16) + 0.5):02x}" for i in (1, 3, 5))


def text_on(colour: Floats) -> str:
    """Return black or white: the one with the higher contrast with a colour (WCAG 2.1), at least 4.5 to 1."""
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return "black" if linear @ (0.2126, 0.7152, 0.0722) > 0.179 else "white"


# --- Colour and marker of each method ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Style:
    """Colour and marker of one method in all figures."""

    colour: str
    marker: str
    filled: bool = False

    def line(self, **changes: Any) -> dict[str, Any]:
        """Keywords of ``Axes.plot`` for a curve of this method, with changes."""
        face = self.colour if self.filled else "white"
        return {"color": self.colour, "marker": self.marker, "markerfacecolor": face} | changes

    def points(self, **changes: Any) -> dict[str, Any]:
        """Keywords of ``Axes.plot`` for markers without a line."""
        return self.line(linestyle="none") | changes


# The colours were found by a search, benchmarks/palette.py: they have a contrast of at least 3:1 with white.
# Differences of at least 13 CIELAB units, for normal vision and for deuteranopia, protanopia and tritanopia (Machado et
# al. 2009, doi:10.1109/TVCG.2009.113), separate the paper's ten methods and the two that are drawn beside them, the
# trained methods, and any two methods with one marker.
_STYLES = {
    "ruth": Style("#6b6b6b", "o"),
    "s5odr4": Style("#806515", "s"),
    "aba104": Style("#00a070", "^"),
    "aba864": Style("#4a90e2", "D"),
    "aba1064": Style("#8e3fb5", "v"),
    "yoshida_s7o6a": Style("#e0569b", "p"),
    "abas5o6h": Style("#e86a10", "o", filled=True),
    "babs7o7h": Style("#0b3c8c", "s", filled=True),
    "babps8o7h": Style("#8b0000", "^", filled=True),
    "babps9o7h": Style("#000000", "D", filled=True),
    # Other methods of Nielsen's Table 4, which are not in the figures of the paper.
    "abas5o6h_b": Style("#8a4b08", "P", filled=True),
    "abas5o6h_c": Style("#c1440e", "X", filled=True),
    "babs6o7h": Style("#2b5fa5", "P", filled=True),
    "babs6o5h": Style("#14746f", "X", filled=True),
    "babps6o5h": Style("#9d174d", "P", filled=True),
    "babps7o6h": Style("#5b21b6", "X", filled=True),
}
#: Published methods that are not in the paper: a colour for the methods of a source or a kind, and a marker for each.
_OTHERS = (
    ("#8000cc", "><*h", "blanes_moan_s6o4 srkn_b6 srkn_b11 srkn_a14"),
    ("#994d33", "8<XPh*", "mclachlan_s4 mclachlan_s5 mclachlan_sb3a4 mclachlan_sb3a5 mclachlan_ss5 mclachlan_atela_2"),
    ("#1a99b3", "<*8dXP", "pefrl vefrl efrl omelyan_p5 omelyan_v5 omelyan_s7o6"),
    ("#809980", "*8P", "s9odr6a s15odr8 s17odr8a"),
    ("#0099b3", "h", "nystrom_6a8"),
    ("#4d3333", "d><P*X", "srkn_a17 srkn_a18 srkn_a19 srkn_b17 srkn_b18 srkn_b19"),
    ("#334d00", "8hdP", "teloy_6a9 teloy_8a17a teloy_8a17b teloy_8a17c"),
    ("#991ab3", "*Xh", "sofspa_s11o6 sofspa_s19o8 sofspa_s35o10"),
    ("#800080", "8", "morales_s17o8"),
    ("#b38000", "<>8", "mclachlan_atela_3 mclachlan_atela_4 mclachlan_atela_5"),
    ("#b31a00", "X", "bcss_s3"), ("#cc4db3", ">", "bcss_s4"), ("#66004d", "h", "predescu_s3"),
    ("#334d80", "d", "bcss_s2"), ("#668080", ">", "omelyan_g5o6"), ("#998000", "P", "rowlands"),
    ("#b3804d", "h", "leapfrog"), ("#e64d1a", "*", "ruth_s3o3"), ("#1a00e6", "X", "chin_4a"), ("#3300e6", ">", "na7"),
    ("#cc4d99", "<", "gauss16"), ("#66004d", "<", "rnia12"),
)  # fmt: skip
#: Methods of this package: trained ones from large to small errors, those for other problems, and methods of order six.
_OWN = (
    ("#669980", "<", "trained_coarse"), ("#994de6", ">", "trained_light"), ("#0000e6", "*", "trained_moderate"),
    ("#808099", "h", "trained_fine"), ("#664d00", "8", "trained_finer"), ("#66004d", "d", "trained_finest"),
    ("#b36600", "P", "trained_precise"), ("#99804d", "X", "trained_weak"), ("#1a66b3", "<", "trained_cubic"),
    ("#8000cc", "P", "trained_cubic_precise"), ("#4d6666", "8", "trained_quartic_precise"),
    ("#b3004d", "<", "trained_exact_coarse"), ("#1a0080", ">", "trained_exact_light"),
    ("#b300e6", "*", "trained_exact_fine"), ("#661ab3", "h", "trained_exact_finer"), ("#990080", "v", "trained_orbits"),
    ("#1a4d33", "p", "trained_orbits_coarse"), ("#331a99", "^", "trained_modified"), ("#99331a", "*", "babs8o6_7h"),
    ("#334d99", "h", "abas9o6_7h"), ("#4d99cc", "X", "babs10o6_8h"), ("#8066e6", "d", "abas11o6_8h"),
    ("#e66600", "*", "abag5o6"), ("#b38080", "h", "babg5o6"),
)  # fmt: skip
_STYLES |= {
    name: Style(colour, marker, filled=rows is _OWN)
    for rows in (_OTHERS, _OWN)
    for colour, markers, names in rows
    for name, marker in zip(names.split(), markers, strict=True)
}

#: Colours of methods without an entry, and of those whose colour another method of the figure has.
SPARE_COLOURS = ("#2a8f80", "#8a8a2e", "#332288", "#aa4499", "#cc6677", "#117733", "#5d5d5d")
_SPARE_MARKERS = ("<", ">", "*", "h", "d", "8")


def has_style(integrator: str) -> bool:
    """Return True for a method with an entry; ``python benchmarks/palette.py`` suggests one for any other."""
    return integrator in _STYLES


def style_of(integrator: str) -> Style:
    """Return the style of a method; a method without an entry has a hollow marker, from a hash of its name."""
    if integrator in _STYLES:
        return _STYLES[integrator]
    rest, colour = divmod(crc32(integrator.encode()), len(SPARE_COLOURS))
    return Style(SPARE_COLOURS[colour], _SPARE_MARKERS[rest % len(_SPARE_MARKERS)], filled=False)
