"""Software behind an archive: licence, citation file, workflow, and libraries.

``LICENSE``, ``CITATION.cff`` and the workflow are in the root of the source tree. A wheel has copies of the first two
among its licence files, and the workflow below ``share/``.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import nearharmonic
from nearharmonic.errors import ResultFileError, SettingError

#: Home pages of the libraries whose versions are in the history.
HOMES = {
    "bokeh": "https://bokeh.org",
    "gmpy2": "https://github.com/gmpy2/gmpy2",
    "h5netcdf": "https://h5netcdf.org",
    "h5py": "https://www.h5py.org",
    "llvmlite": "https://llvmlite.readthedocs.io",
    "matplotlib": "https://matplotlib.org",
    "mpmath": "https://mpmath.org",
    "numba": "https://numba.pydata.org",
    "numpy": "https://numpy.org",
    "python": "https://www.python.org",
    "snakemake": "https://snakemake.github.io",
    "xarray": "https://xarray.dev",
}
#: Documents of the software in an archive.
DOCUMENTS = ("CITATION.cff", "LICENSE")

#: Place of the workflow in a wheel.
SHARED = "share/nearharmonic/Snakefile"
_SOURCE_TREE = Path(nearharmonic.__file__).parents[2]


def document(name: str) -> bytes:
    """Return the file ``name``, one of :data:`DOCUMENTS`, from the source tree or else from the installed package.

    Raises
    ------
    ResultFileError
        The file is in neither of them.
    """
    in_tree = _SOURCE_TREE / name if (_SOURCE_TREE / "pyproject.toml").is_file() else None
    for place in (in_tree, _installed(name)):
        if place is not None and place.is_file():
            return place.read_bytes()
    message = f"{name} is missing from this installation of nearharmonic: install it from its source tree or its wheel"
    raise ResultFileError(message)


def _installed(name: str) -> Path | None:
    """Return the file ``name`` from the metadata of the installed package."""
    try:
        files = distribution("nearharmonic").files or []
    except PackageNotFoundError:
        return None
    found = [file for file in files if file.name == name and any(part.endswith(".dist-info") for part in file.parts)]
    return Path(str(found[0].locate())) if found else None


def workflow_root() -> Path:
    """Return the folder with the files of the workflow: that of a wheel, or that of the sources.

    Raises
    ------
    SettingError
        There is none.
    """
    if (_SOURCE_TREE / "Snakefile").is_file() and (_SOURCE_TREE / "workflow").is_dir():
        return _SOURCE_TREE
    try:
        installed = distribution("nearharmonic")
        found = [Path(str(installed.locate_file(one))) for one in installed.files or [] if str(one).endswith(SHARED)]
    except PackageNotFoundError:
        found = []
    if not found:
        raise SettingError("the package has come without the workflow: pip install 'nearharmonic[workflow]' has it")
    return found[0].resolve().parent


def citation() -> dict[str, Any]:
    """Return the content of ``CITATION.cff``: ``title``, ``version``, ``license``, ``references`` and the rest.

    Raises
    ------
    ResultFileError
        The file is missing.
    """
    import yaml

    said: dict[str, Any] = yaml.safe_load(document("CITATION.cff"))
    return said


def homepage(cited: Mapping[str, Any]) -> str:
    """Return the address of the software, or of the reproduced paper if the citation file has no other address."""
    return str(cited.get("repository-code") or cited.get("url") or cited["references"][0]["url"])
