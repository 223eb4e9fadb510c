"""Reader of result files as datasets."""

from __future__ import annotations

import os
from collections.abc import Collection
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr


def read(path: str | os.PathLike[str], group: str | None = None, *, leave_out: Collection[str] = ()) -> xr.Dataset:
    """Load the root of a file, or one of its groups, with the attributes of the file.

    Parameters
    ----------
    path : path
        A result file.
    group : str, optional
        Name of the group; the root by default.
    leave_out : collection of str
        Variables that are not wanted.

    Returns
    -------
    xarray.Dataset
        The dataset of ``xarray.open_dataset(path, engine="h5netcdf", group=group)``, with words in place of the
        integers of variables with ``flag_meanings``.

    Raises
    ------
    ResultFileError
        The file is missing, truncated or not one of this package, or lacks the group; the message contains the command
        that makes it again.
    """
    import xarray as xr

    from nearharmonic.output.store.backend import ResultFiles

    return xr.open_dataset(path, engine=ResultFiles, group=group, drop_variables=list(leave_out), cache=False)


def read_precisions(path: str | os.PathLike[str], *, leave_out: Collection[str] = ()) -> dict[str, xr.Dataset]:
    """Load the runs of a file by precision: double is in the root, another precision in the group of its name.

    Errors are those of :func:`read`.
    """
    import xarray as xr

    from nearharmonic.output.store.backend import ResultFiles

    groups = xr.open_groups(path, engine=ResultFiles, drop_variables=list(leave_out), cache=False)
    # The root of a file without runs in double precision is empty.
    return {group.strip("/") or "double": runs for group, runs in groups.items() if runs.data_vars}
