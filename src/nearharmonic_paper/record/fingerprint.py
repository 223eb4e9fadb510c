"""Fingerprint of a run of the workflow: its config, code, coefficients and versions, and its machine."""

from __future__ import annotations

import json
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from nearharmonic.integrators import integrators
from nearharmonic.output.atomic import digest_of, plain
from nearharmonic.systems import systems
from nearharmonic_paper.config.config import Config
from nearharmonic_paper.tasks.provenance import coefficients_digest, files_in
from nearharmonic_paper.tasks.sources import PACKAGE, PACKAGES, ROOT, module_digest
from nearharmonic_paper.tasks.sources import digest_of as digest_of_file

#: Libraries that affect a number or a picture.
LIBRARIES = (
    "numpy", "numba", "llvmlite", "mpmath", "gmpy2", "xarray", "h5py", "h5netcdf", "matplotlib", "bokeh", "snakemake",
)  # fmt: skip


def fingerprint(config: Config) -> dict[str, Any]:
    """Return the data that identify the work of a run.

    They are ``config`` as resolved, ``config_digest``, ``code_digest``, ``coefficients_digest``, ``versions``; if users
    define systems or integrators, ``user_files`` with the digest of each file; and ``work``, the SHA-256 over these,
    which is equal for equal work.
    """
    # Keys stay in their order, which determines the order of tables and legends.
    resolved = json.loads(json.dumps(config, default=plain))
    methods = dict.fromkeys((*config.methods, *config.decomposed, *config.compared))
    told = {
        "config": resolved,
        "config_digest": digest_of(resolved),
        "code_digest": package_digest(),
        "coefficients_digest": coefficients_digest(integrators[name] for name in methods),
        "versions": versions(),
    }
    files = files_in({"systems": systems.definitions, "integrators": integrators.definitions})
    if files:
        told["user_files"] = {file: digest_of_file(file) for file in files}
    return {"work": digest_of(told), **told}


def package_digest(root: Path = ROOT) -> str:
    """Return the SHA-256 of the code of all modules of the packages, without docstrings and comments."""
    files = [path for package in PACKAGES for path in root.joinpath(package).rglob("*.py")]
    places = [path.relative_to(root).with_suffix("") for path in files]
    modules = sorted(".".join(p.parts[:-1] if p.name == "__init__" else p.parts) for p in places)
    return digest_of({name: module_digest(name, None if root == ROOT else root) for name in modules})


def versions() -> dict[str, str]:
    """Return the versions of Python, of this package and of the installed :data:`LIBRARIES`."""
    found = {"python": platform.python_version()}
    for name in (PACKAGE, *LIBRARIES):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def machine() -> dict[str, Any]:
    """Return ``platform`` and ``cpu``: model and instruction-set features for compiled code."""
    from llvmlite import binding

    features = sorted(name for name, there in binding.get_host_cpu_features().items() if there)
    return {"platform": platform.platform(), "cpu": {"model": _cpu_model(), "features": features}}


def _cpu_model() -> str:
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8") as lines:
            return next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def revision(folder: Path) -> dict[str, Any]:
    """Return ``commit`` and ``dirty`` of the working tree at ``folder``; both are None without a repository.

    Without git this is an OSError.
    """
    commit = _git(folder, "rev-parse", "HEAD")
    status = None if commit is None else _git(folder, "status", "--porcelain")
    return {"commit": commit, "dirty": None if status is None else bool(status)}


def _git(folder: Path, *arguments: str) -> str | None:
    done = subprocess.run(
        ["git", "-C", str(folder), *arguments], capture_output=True, text=True, check=False, timeout=20
    )
    return done.stdout.strip() if done.returncode == 0 else None
