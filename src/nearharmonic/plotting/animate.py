"""Films of trajectories: GIF files, and HTML files that need no network.

matplotlib is loaded by the first film, so that the library can be used without it.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nearharmonic.errors import bad_setting
from nearharmonic.output.atomic import write_bytes, write_text
from nearharmonic.plotting.datasets.kinds import TRAJECTORY, check_measured, kind_of
from nearharmonic.plotting.plot import with_matplotlib

if TYPE_CHECKING:
    import xarray as xr

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
    film = with_matplotlib("film", "a film")
    if ending == ".gif":
        write_bytes(Path(str(path)), film.gif(given, frames, fps, title))
        return Path(str(path))
    page = Film(film.page(given, frames, fps, title))
    if path is None:
        return page
    write_text(Path(path), page)
    return Path(path)
