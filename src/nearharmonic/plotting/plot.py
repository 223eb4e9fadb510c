"""Plots of results of ``integrate``, ``sweep``, ``ensemble``, ``section``, ``tangent`` and ``recommend``, and of cubes.

matplotlib is loaded by the first plot, so that the library can be used without it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from nearharmonic.errors import MissingPackageError, bad_setting
from nearharmonic.plotting.datasets.kinds import CUBE, KINDS, RANKING, SECTION, kind_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

ALLOWED = (
    "a Dataset of nearharmonic.integrate, sweep, ensemble, tangent, section or recommend, or a list of those of one of "
    "the first four, or the cube of a system"
)


def plot(
    datasets: xr.Dataset | Iterable[xr.Dataset],
    kind: str | None = None,
    axes: Sequence[str] | None = None,
    title: str | None = None,
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
        curve if its formulas are those of a registered system. Of other systems, and where a curve would miss the
        samples, fewer than about 20 samples a period are points: take more by ``samples=`` or ``t=`` of ``integrate``.
    axes : pair of str, optional
        Quantities of an orbit, a phase space or a section, such as ("q1", "p2"), or variables over the samples such as
        an observable: ("t", "E1").
    title : str, optional
        Text above the figure.

    Returns
    -------
    matplotlib.figure.Figure
        A notebook shows it; ``savefig`` writes it to a file.

    Raises
    ------
    SettingError
        The argument is not such an object or is empty, it has no plot of this kind or no such axes, Datasets have
        different kinds or different units of step sizes or times, or energy errors are relative to different energies.

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
    drawing = with_matplotlib("drawing", "a plot")
    drawn: Figure = drawing.draw(source, chosen, given, axes)
    if title is not None:
        drawing.write_above(drawn, title)
    return drawn


def with_matplotlib(module: str, purpose: str) -> Any:
    """Import a module of functions that draw, and matplotlib with it.

    Raises
    ------
    MissingPackageError
        matplotlib is not installed.
    """
    try:
        return import_module(f"nearharmonic.plotting.datasets.{module}")
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "matplotlib":
            raise
        raise MissingPackageError(purpose, "matplotlib", "figures") from error
