"""A small result folder for tests of the record: real runs and cubes of two methods, a table, claims, and a history.

The manifest and the history are written here, from the description of their format, not by the code that is tested.
"""

import json
from contextlib import contextmanager
from hashlib import sha256

import h5py

from nearharmonic.engine.settings import Sweep
from nearharmonic.output import table
from nearharmonic.output.table import Table
from nearharmonic_paper.experiments.paper.reductions import reduce
from nearharmonic_paper.experiments.paper.run import integrate, shards_of
from nearharmonic_paper.experiments.paper.tableaus import decompose
from nearharmonic_paper.tasks import job
from nearharmonic_paper.tasks.provenance import provenance, task
from support.results import finished_results
from support.results.finished_results import entry, run, write_history

METHODS = ("ruth", "babps9o7h")
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
    start, end = (f"2026-11-22T{hour:02d}:{rest}Z" for rest in ("02:53.123", "03:16.533"))
    return run(run_id(hour), start, end, config=config()) | changes


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
    assert b"nearharmonic sha256" not in content[-100:]
    path.write_bytes(content + b"\nnearharmonic sha256 " + sha256(content).hexdigest().encode() + b"\n")


def write_manifest(folder, volatile=(("tables/methods.csv", ["seconds"]),)):
    """Write the manifest of all that is in ``folder``, and return the folder."""
    names = {str(path.relative_to(folder)): path for path in sorted(folder.rglob("*")) if path.is_file()}
    ours = {name for name in names if name in ("manifest.json", "history.jsonl") or name.startswith("logs/")}
    about = {name: {"systems": [], "integrators": [], "volatile": dict(volatile).get(name, [])} for name in names}
    files = {name: entry(names[name].read_bytes(), run_id(8)) | about[name] for name in names.keys() - ours}
    finished_results.write_manifest(folder, files)
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
