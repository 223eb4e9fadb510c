"""Plots and films of the results of functions of ``nh``, and plots of cubes.

matplotlib is loaded by the first plot, so that the library can be used without it.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from html import escape
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nearharmonic.errors import MissingPackageError, bad_setting
from nearharmonic.output.atomic import write_bytes, write_text

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


MEMBER = "member"
#: Contents of a Dataset, by which its plots are found.
PROFILE, TRAJECTORY, CUBE, ENSEMBLE = "energy errors over tau", "a trajectory", "a cube", "an ensemble"
SECTION, RANKING = "a section", "a recommendation"
DEVIATIONS, MANY_DEVIATIONS = "deviations from an orbit", "deviations from several orbits"
#: What may be drawn of each kind of Dataset, the default first; "" is a trajectory's energy error above its orbit.
KINDS = {
    PROFILE: ("energy", "work"), CUBE: ("energy",), ENSEMBLE: ("energy",), SECTION: ("section",), RANKING: ("work",),
    TRAJECTORY: ("", "energy", "orbit", "phase"), DEVIATIONS: ("chaos", "orbit", "phase"), MANY_DEVIATIONS: ("chaos",),
}  # fmt: skip
ALLOWED = (
    "a Dataset of nearharmonic.integrate, sweep, ensemble, tangent, section or recommend, a list of Datasets of one of "
    "the first four, or the cube of a system"
)


def plot(
    datasets: xr.Dataset | Iterable[xr.Dataset],
    kind: str | None = None,
    axes: Sequence[str] | None = None,
    title: str | None = None,
    width: str = "page",
) -> Figure:
    """Draw a result in the style of the figures.

    - A Dataset of ``sweep``: maximum and mean energy error against step size per stage.
    - One of ``integrate``: the energy error over time, and the orbit: (q, p) of a system of one coordinate, the first
      two coordinates of other systems. Without energy errors (``energy="none"``) only the orbit is drawn.
    - One of ``ensemble``: the maximum energy error of each member, against the varied parameter if there is exactly
      one, otherwise against the number of the member.
    - The cube of a system, as ``xarray.open_dataset`` returns it: its energy-error figure.
    - One of ``section``: the crossings of each member, in one colour.
    - One of ``tangent``: exponent, MEGNO and SALI over time, a line for each member.
    - One of ``recommend``: the error of each method against its evaluations and its time.

    Parameters
    ----------
    datasets : xarray.Dataset, or list of them
        One or several results of ``integrate``, ``sweep``, ``ensemble`` or ``tangent``, each with an entry in the
        legend; or one cube, section or recommendation.
    kind : {"energy", "orbit", "phase", "section", "work"}, optional
        What is drawn in place of the default: of a trajectory its energy error, its orbit or its phase space alone; of
        ``sweep`` the error against the evaluations of the force, "work". An orbit between coarse samples is a smooth
        curve if its formulas belong to a registered system. Of other systems, and where a curve would miss the
        samples, fewer than about 20 samples a period are points: take more by ``samples=`` or ``t=`` of ``integrate``.
    axes : pair of str, optional
        Quantities of an orbit, a phase space or a section, such as ("q1", "p2"), or variables over the samples such as
        an observable: ("t", "E1").
    title : str, optional
        Text above the figure.
    width : {"page", "column"}
        Width of the figure: 7 inches, or 85 mm with text of at least 6 pt.

    Returns
    -------
    matplotlib.figure.Figure
        A notebook shows it; ``savefig`` writes it to a file.

    Raises
    ------
    SettingError
        The argument is not such an object or is empty, it has no plot of this kind or no such axes, Datasets have
        different kinds or different units of step sizes or times, energy errors are relative to different energies, or
        there is no such width.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> figure = nh.plot(nh.sweep("sho", "ruth", [0.5, 0.25]))
    >>> len(figure.axes)
    2
    """
    given: list[Any] = list(datasets) if isinstance(datasets, list | tuple) else [datasets]
    kinds = {kind_of(one) for one in given}
    single = kinds & {CUBE, SECTION, RANKING}
    if len(kinds) != 1 or kinds == {""} or (single and len(given) > 1):
        several = [*single] * len(given) if single == kinds else sorted(filter(None, kinds))
        shown = " and ".join(several) or type(datasets).__name__
        raise bad_setting("datasets", shown, ALLOWED)
    (source,) = kinds
    chosen = kind
    if chosen is None:
        chosen = "orbit" if axes is not None and "orbit" in KINDS[source] else KINDS[source][0]
    if chosen not in KINDS[source] or not (kind is None or chosen):
        allowed = f"of {source} one of {', '.join(filter(None, KINDS[source]))}"
        raise bad_setting("kind", kind, allowed)
    if axes is not None and chosen not in ("orbit", "phase", "section"):
        raise bad_setting("axes", axes, "two quantities of an orbit, a phase space or a section, and this has none")
    if width not in ("page", "column"):
        raise bad_setting("width", width, "page or column")
    drawing = with_matplotlib("drawing", "a plot")
    drawn: Figure = drawing.draw(source, chosen, given, axes)
    if width == "column":
        with_matplotlib("column", "a plot").narrow(drawn)
    with_matplotlib("style", "a plot").keep_inside(drawn)
    if title is not None:
        drawing.write_above(drawn, title)
    return drawn


def kind_of(dataset: Any) -> str:
    """Return the kind of a Dataset, "" for a Dataset of another origin."""
    dims, attributes, variables = (getattr(dataset, name, ()) for name in ("dims", "attrs", "variables"))
    if not hasattr(dataset, "data_vars"):
        return ""
    dims, variables, named = set(dims), set(variables), "integrator" in attributes
    measured, followed = "max_energy_error" in variables, {"lyapunov_exponent", "t"} <= variables
    found = {
        MANY_DEVIATIONS: followed and MEMBER in dims, DEVIATIONS: followed,
        CUBE: measured and {"integrator", "tau_per_stage"} <= dims,
        PROFILE: measured and named and "tau" in dims, ENSEMBLE: measured and named and MEMBER in dims,
        SECTION: "crossing" in dims and "surface" in variables,
        RANKING: "rank" in dims and {"evaluations", "time"} <= variables,
        TRAJECTORY: named and {"t", "q", "p", "energy_error"} <= variables,
    }  # fmt: skip
    return next((kind for kind, holds in found.items() if holds), "")


def check_measured(given: Sequence[xr.Dataset]) -> None:
    """Raise SettingError if a Dataset has no measured energy errors."""
    if any(one.attrs.get("energy") == "none" for one in given):
        allowed = "there are no energy errors to draw; run with energy='every' or 'samples'"
        raise bad_setting("datasets", "energy='none'", allowed)


def with_matplotlib(module: str, purpose: str) -> Any:
    """Import a module of functions that draw; a MissingPackageError says that matplotlib is not installed."""
    try:
        return import_module(f"nearharmonic.plotting.{module}")
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "matplotlib":
            raise
        raise MissingPackageError(purpose, "matplotlib", "figures") from error


# --- Films of trajectories: GIF files, and HTML files that need no network -------------------------------------------

#: Largest number of frames, and height of the frame in a notebook in pixels.
MOST, HEIGHT = 2000, 846


class Film(str):
    """Text of an HTML page with a film; a notebook shows the page."""

    def _repr_html_(self) -> str:
        return f'<iframe srcdoc="{escape(self)}" width="100%" height="{HEIGHT}" frameborder="0"></iframe>'


def animate(
    runs: xr.Dataset | Iterable[xr.Dataset],
    path: str | os.PathLike[str] | None = None,
    frames: int = 60,
    fps: int = 20,
    title: str | None = None,
) -> Path | Film:
    """Write a film of trajectories: the orbit, and the energy error beneath it, up to the time of each frame.

    Parameters
    ----------
    runs : xarray.Dataset, or list of them
        Results of ``integrate`` with energy errors.
    path : str or os.PathLike, optional
        File to write, a GIF or an HTML file by its ending; an existing file is replaced when the film is complete. If
        not given, the HTML page is returned, which a notebook shows.
    frames : int
        Number of frames, from the first to the last sample, evenly spaced in time; at least 2.
    fps : int
        Frames per second.
    title : str, optional
        Text above the orbit.

    Returns
    -------
    pathlib.Path or Film
        The written file, or the page.

    Raises
    ------
    SettingError
        The ending of the file is not .gif or .html, the runs are no trajectories with energy errors, or a number is not
        allowed.
    FileWriteError
        The file cannot be written.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> run = nh.integrate("henon_heiles", "babps8o7h", 0.4, t_end=60)
    >>> page = nh.animate(run, frames=2)  # with a path, such as "orbit.gif", a file
    >>> page.startswith("<!DOCTYPE html>")
    True
    """
    ending = "" if path is None else Path(path).suffix.lower()
    if path is not None and ending not in (".gif", ".html"):
        raise bad_setting("path", str(path), "the name of a file that ends with .gif or .html")
    numbers: tuple[tuple[str, Any, int, int], ...] = (("frames", frames, 2, MOST), ("fps", fps, 1, 100))
    for name, value, least, most in numbers:
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise bad_setting(name, value, f"an integer from {least} to {most}")
    given: list[Any] = list(runs) if isinstance(runs, list | tuple) else [runs]
    if not given or any(kind_of(one) != TRAJECTORY for one in given):
        raise bad_setting("runs", type(runs).__name__, "a Dataset of nearharmonic.integrate, or a list of them")
    check_measured(given)
    drawing = with_matplotlib("drawing", "a film")
    if ending == ".gif":
        write_bytes(Path(str(path)), drawing.film_gif(given, frames, fps, title))
        return Path(str(path))
    page = Film(drawing.film_page(given, frames, fps, title))
    if path is None:
        return page
    write_text(Path(path), page)
    return Path(path)
