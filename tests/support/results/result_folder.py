"""A small result folder for tests of the record: real runs and cubes of two methods, a table, claims, and a history.

The manifest and the history are written here, from the description of their format, not by the code that is tested.
"""

from __future__ import annotations

import json
from contextlib import contextmanager
from hashlib import sha256

import h5py

from nearharmonic.engine.settings import Sweep
from nearharmonic.output import table
from nearharmonic.output.table import Table
from nearharmonic.reproduction.experiments.paper.grid.plan import shards_of
from nearharmonic.reproduction.experiments.paper.reduce import reduce
from nearharmonic.reproduction.experiments.paper.run import integrate
from nearharmonic.reproduction.experiments.paper.tableaus.decompose import decompose
from nearharmonic.reproduction.tasks import job
from nearharmonic.reproduction.tasks.provenance import provenance, task

METHODS = ("ruth", "babps9o7h")
VERSIONS = {"python": "3.11.7", "nearharmonic": "0.1.0", "numpy": "2.4.6", "numba": "0.68.1", "snakemake": "9.27.0"}

#: Ruth's runs at the largest steps diverge on Henon-Heiles; the oscillator has cells that were never run.
SWEEPS = (
    Sweep(
        system="henon_heiles", t_end="50", lowest=0.05, highest=2.0, points_per_decade=5, precision=("double",),
        summation="compensated", samples=20, shards=2,
    ),
    Sweep(
        system="kepler", t_end="8766", lowest=10.0, highest=100.0, points_per_decade=4, precision=("double",),
        summation="compensated", samples=50, shards=1,
    ),
    Sweep(
        system="sho", t_end="50", lowest=0.002, highest=1.0, points_per_decade=3, precision=("double", "extended"),
        summation="compensated", samples=20, shards=1,
    ),
)  # fmt: skip

CLAIMS = (
    ("fig1.order", "Section 4, Figure 1", "BABs7o7H falls as the sixth power", "holds", "5.99", "6 +- 0.3"),
    ("fig5.best", "Section 6, Figure 5", "ABA104 has the least maximum", "holds in part", "3 h to 20 h", "every step"),
)


def run_id(hour, tail="3f9a1c2e"):
    return f"20261122T{hour:02d}0253Z-{tail}"


def history_line(hour, **changes):
    """One line of ``history.jsonl``: the run that started at ``hour``."""
    line = {
        "id": run_id(hour),
        "work": "a" * 64,
        "status": "ok",
        "exit_status": 0,
        "start": f"2026-11-22T{hour:02d}:02:53.123Z",
        "end": f"2026-11-22T{hour:02d}:03:16.533Z",
        "duration": 23.41,
        "cpu_seconds": 40.5,
        "cores": 2,
        "command": ["snakemake", "-j2"],
        "targets": ["all"],
        "commit": "0123456789abcdef0123456789abcdef01234567",
        "dirty": False,
        "config": config(),
        "config_digest": "b" * 64,
        "code_digest": "c" * 64,
        "coefficients_digest": "d" * 64,
        "versions": VERSIONS,
        "platform": "Linux-6.18-x86_64",
        "cpu": {"model": "Fast 9", "features": ["avx2"]},
        "jobs_run": 46,
        "jobs_reused": 0,
        "evaluations": 4160000000,
        "evaluations_skipped": 4280000000,
    }
    return line | changes


def config(name="paper"):
    """A config as it is resolved, of the sweeps that the cubes are made of."""
    grids = {s.system: {"lowest": s.lowest, "highest": s.highest} for s in SWEEPS}
    return {
        "name": name,
        "integrators": list(METHODS),
        "systems": {s.system: {"t_end": s.t_end, "tau_per_stage": grids[s.system]} for s in SWEEPS},
    }


def build(folder, *, sweeps=SWEEPS, methods=METHODS, runs=None):
    """Make results in ``folder`` and return it.

    Parameters
    ----------
    folder : Path
        ``results/<name>``, made if it is missing.
    sweeps, methods
        What is run.
    runs : sequence of dict, optional
        Lines of the history, oldest first; by default one that failed and one that made all.
    """
    for sweep in sweeps:
        files = {method: list(_run_files(folder, sweep, method)) for method in methods}
        _job(
            {"cube": f"{folder}/cubes/{sweep.system}.h5"}, reduce, sweep=sweep, integrators=list(methods), inputs=files
        )
    _job({"cube": f"{folder}/cubes/sho_terms.h5"}, decompose, integrators=list(methods))
    rows = [[name, i + 3, 0.1 * i + 1.5, 0.25 + i] for i, name in enumerate(methods)]
    caption = "Methods, and how long they took."
    methods_table = Table(header=["integrator", "stages", "error", "seconds"], rows=rows, caption=caption)
    (folder / "tables").mkdir(parents=True, exist_ok=True)
    table.save(methods_table, [folder / f"tables/methods.{suffix}" for suffix in ("csv", "md")])
    write_claims(folder, CLAIMS)
    history = [history_line(7, status="failed", exit_status=1), history_line(8)] if runs is None else runs
    write_history(folder, history)
    return write_manifest(folder)


def write_history(folder, lines):
    """Write ``lines`` as the history of ``folder``."""
    (folder / "history.jsonl").write_text("".join(f"{json.dumps(line)}\n" for line in lines))


def write_claims(folder, claims):
    """Write ``claims``, rows as in :data:`CLAIMS`, as the JSON of the target ``claims``."""
    header = ("id", "paper", "statement", "verdict", "value", "threshold")
    told = [dict(zip(header, claim, strict=True)) | {"needs": ["cubes/sho.h5"]} for claim in claims]
    for one in told:
        one |= {"paper": {"section": one["paper"], "sentence": one["statement"]}, "kind": "result", "margin": "exact"}
    (folder / "tables/claims.json").write_text(json.dumps(told))


@contextmanager
def edited(path):
    """Open a result file to change it; HDF5 drops the last line, the digest, which is then written anew."""
    with h5py.File(path, "r+") as file:
        yield file
    content = path.read_bytes()
    assert b"nearharmonic sha256" not in content
    path.write_bytes(content + b"\nnearharmonic sha256 " + sha256(content).hexdigest().encode() + b"\n")


def write_manifest(folder, run=None, volatile=(("tables/methods.csv", ["seconds"]),)):
    """Write the manifest of all that is in ``folder``, and return the folder."""
    ours = ("manifest.json", "history.jsonl")
    names = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    files = {}
    for name in (name for name in names if name not in ours and not name.startswith("logs/")):
        content = (folder / name).read_bytes()
        files[name] = {
            "size": len(content),
            "sha256": sha256(content).hexdigest(),
            "function": "reproduction.experiments.paper.reduce:reduce",
            "code": "e" * 64,
            "coefficients": "f" * 64,
            "run": run or run_id(8),
            "systems": [],
            "integrators": [],
            "volatile": dict(volatile).get(name, []),
        }
    told = {"format": "nearharmonic manifest 1", "files": files, "changed": []}
    told["sha256"] = sha256(json.dumps(told, sort_keys=True, ensure_ascii=False).encode()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(told))
    return folder


def _run_files(folder, sweep, method):
    for shard in range(shards_of(sweep, method)):
        path = f"{folder}/runs/{sweep.system}/{method}/{shard}.h5"
        _job({"run": path}, integrate, sweep=sweep, integrator=method, shard=shard)
        yield path


def _job(outputs, function, inputs=None, **settings):
    """Job of the workflow: one function, its results written with their provenance."""
    name = f"{function.__module__.removeprefix('nearharmonic.')}:{function.__name__}"
    results = function(**settings, **(inputs or {}))
    for key, path in outputs.items():
        job.write(results[key], [path], provenance(task(name, **settings)))
