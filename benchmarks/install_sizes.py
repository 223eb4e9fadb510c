"""Sizes of the package and of its extras, from the files of the installed distributions.

Run: ``python benchmarks/install_sizes.py`` where all extras are installed; ``--page`` writes the table to
``docs/start/install.md``.
"""

from __future__ import annotations

from importlib.metadata import distribution

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from timing import fill

from nearharmonic_paper.pages.filling import table

PAGE, PACKAGE = "docs/start/install.md", "nearharmonic"
#: Purposes of the extras.
PURPOSES = {
    "": "trajectories, sweeps, recommendations",
    "figures": "`nh.plot` and the examples",
    "tailor": "`nh.tailor`: a method for one system",
    "workflow": "`snakemake`, and the commands that read results",
    "scipy": "adapter for scipy",
    "rebound": "adapter for REBOUND",
    "openmm": "adapter for OpenMM",
    "ase": "adapter for ASE",
    "mici": "adapter for mici",
    "diffrax": "adapter for diffrax, with JAX",
    "blackjax": "adapter for BlackJAX, with JAX",
    "jax-md": "adapter for JAX MD, with JAX",
    "gpu": "runs on a GPU of NVIDIA: the bindings of its driver",
    "peers": "other libraries, for comparisons of time",
    "docs": "this site",
    "test": "the tests",
    "browser": "tests in Chromium",
    "lint": "linters and types",
    "ptx": "tests of the code for a GPU: the assembler of the CUDA compiler",
}


def needed(text: str, found: dict[tuple[str, frozenset[str]], int]) -> None:
    """Add the megabytes of an installed requirement, and of its own requirements, to ``found``."""
    wanted = Requirement(text)
    key = (canonicalize_name(wanted.name), frozenset(wanted.extras))
    if key in found:
        return
    one = distribution(wanted.name)
    paths = (file.locate() for file in one.files or () if file.suffix != ".pyc")
    found[key] = sum(path.stat().st_size for path in paths if path.is_file())
    for other in map(Requirement, one.requires or ()):
        if other.marker is None or any(other.marker.evaluate({"extra": extra}) for extra in ("", *wanted.extras)):
            needed(str(other).partition(";")[0], found)


def size(extra: str) -> int:
    """Bytes of the package with an extra; each distribution counts once."""
    found: dict[tuple[str, frozenset[str]], int] = {}
    needed(f"{PACKAGE}[{extra}]" if extra else PACKAGE, found)
    return sum({name: number for (name, _), number in found.items()}.values())


def parts() -> dict[str, str]:
    """Table of extras with purpose and size."""
    rows = []
    for extra, purpose in PURPOSES.items():
        megabytes = round((size(extra) - (size("") if extra else 0)) / 1e6)
        rows.append((f"`[{extra}]`" if extra else "none", purpose, f"{'+ ' if extra else ''}{megabytes} MB"))
    return {"sizes": table(("extra", "for", "size"), rows, left=2)}


if __name__ == "__main__":
    fill(__doc__, parts, PAGE)
