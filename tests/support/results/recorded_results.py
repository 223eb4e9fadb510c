"""Results on which the committed verdicts were decided.

``python tests/support/results/recorded_results.py results/paper`` records them again. The archive
holds the cubes, tables and derived coefficients that statements need, without what no statement looks at.
"""

from __future__ import annotations

import shutil
import sys
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

from nearharmonic.output.store import read, write_dataset
from nearharmonic.reproduction.claims.statements.performance.discussion import CLOSE, ROUND
from nearharmonic.reproduction.claims.statements.tableaus.trained import ENSEMBLES
from nearharmonic.reproduction.claims.table import FILES

ARCHIVE = Path(__file__).parents[2] / "reproduction/claims/recorded.zip"
ERRORS = ("max_energy_error", "mean_energy_error", "tau")
#: What is kept of cubes of which statements look at little.
KEPT = {
    "sho": lambda cube: cube[list(ERRORS)],
    "henon_heiles": lambda cube: cube[list(ERRORS)],
    "kepler": lambda cube: cube[[*ERRORS, *(name for name in cube if "perihelion" in name or "per_orbit" in name)]],
    "stability_rounding": lambda cube: cube[["energy_error_rms", "time", "orbit"]].isel(sample=slice(-20, None)),
    "stability_kepler": lambda cube: cube[["energy_error", "evaluations_per_orbit"]].sel(
        eccentricity=[ROUND, CLOSE], method="nearest"
    ),
    "trained": lambda cube: cube[["mean_log_error", "tau_per_stage", "kind"]].sel(ensemble=list(ENSEMBLES)),
    "kinetic_energy": lambda cube: cube[["max_energy_error"]],
}


def record(results: Path) -> None:
    """Write the archive from a folder of results in which every target has run."""
    with TemporaryDirectory() as place, zipfile.ZipFile(ARCHIVE, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name in FILES:
            path = Path(place) / name
            path.parent.mkdir(exist_ok=True)
            if path.suffix == ".h5":
                cube = read(results / name)
                write_dataset(path, KEPT.get(path.stem, lambda cube: cube)(cube), {})
            else:
                shutil.copy(results / name, path)
            # The time of the archive's entries is that of the format's beginning: the same results, the same bytes.
            archive.writestr(zipfile.ZipInfo(name), path.read_bytes(), zipfile.ZIP_DEFLATED, 9)


def unpack(folder: Path) -> Path:
    """Put the recorded files into a folder of results."""
    with zipfile.ZipFile(ARCHIVE) as archive:
        archive.extractall(folder)
    return folder


if __name__ == "__main__":
    record(Path(sys.argv[1]))
