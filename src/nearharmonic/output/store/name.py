"""Names of result files within their folder of results, which each file states: a copy under another name is found.

The name of the folder of results is not part of it, so results can be renamed, copied and adopted as a whole.
"""

from __future__ import annotations

import os
from pathlib import PurePath
from typing import Any

#: Attribute with the name of a file: ``runs/kepler/ruth/0.h5``.
NAME_KEY = "file"
#: Folders of HDF5 files in a folder of results.
ROOMS = ("runs", "reduced", "cubes")


def name_of(path: str | os.PathLike[str]) -> str:
    """Return the name of a file in its folder of results, ``results/<name>``; empty if it stands elsewhere."""
    parts = PurePath(path).parts
    starts = (i + 2 for i, part in enumerate(parts[:-3]) if part == "results" and parts[i + 2] in ROOMS)
    start = max(starts, default=None)
    return "" if start is None else "/".join(parts[start:])


def misplaced(path: str | os.PathLike[str], said: Any) -> str:
    """Return the complaint about a file at ``path`` that says it is another one, or an empty text.

    Parameters
    ----------
    path : path
        The file. Outside of a folder of results it may have any name.
    said : object
        The name that the file states; None for a file without one.
    """
    name = name_of(path)
    return f"says it is {said}" if name and said not in {None, name} else ""
