"""Runs integrated again have the bits of their files, and a bit that differs is named."""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np
import pytest

from nearharmonic.engine.settings import Sweep
from nearharmonic.errors import ResultFileError
from nearharmonic.output import store
from nearharmonic_paper.record import manifest
from nearharmonic_paper.record.query import rerun
from nearharmonic_paper.tasks.job import write
from nearharmonic_paper.tasks.provenance import Receipt, function_of, provenance, task
from support.hostile.mutations import ODD_SETTINGS
from support.results.result_folder import edited

SWEEP = Sweep(
    system="sho", t_end="10", lowest=0.003, highest=1.5, points_per_decade=5, precision=("double", "extended"),
    summation="compensated", samples=20, shards=2,
)  # fmt: skip


@pytest.fixture
def results(tmp_path, monkeypatch):
    """Two run files, as the workflow makes them."""
    monkeypatch.chdir(tmp_path)
    return made(tmp_path, SWEEP, "run:integrate")


def made(tmp_path, sweep, function):
    folder = tmp_path / "results/paper"
    (folder / "logs").mkdir(parents=True)
    for shard in (0, 1):
        described = task(
            f"nearharmonic_paper.experiments.paper.{function}", sweep=sweep, integrator="babs7o7h", shard=shard
        )
        place = f"results/paper/runs/sho/babs7o7h/{shard}.h5"
        write(function_of(described)(**described["settings"])["run"], [place], provenance(described))
        receipt = Receipt(f"results/paper/logs/{shard}.log")
        receipt.add([place], described)
        receipt.write()
    manifest.write(folder)
    return folder


def sizes(folder):
    """Runs in each precision of all files."""
    found = []
    for path in sorted(folder.rglob("*.h5")):
        with h5py.File(path) as file:
            found += [int((group["steps"][()] > 0).sum()) for group in (file, file.get("extended")) if group]
    return found


@pytest.mark.slow
def test_every_run_has_the_same_bits_again(results):
    """Alone as well as in lanes beside others, and short ones, which have fewer samples."""
    again = rerun(results, 1000)
    assert len(again) == sum(sizes(results)) > 6
    assert {run.precision for run in again} == {"double", "extended"}
    assert [run.differs for run in again] == [()] * len(again)


@pytest.mark.slow
def test_run_without_samples_has_the_same_numbers_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = made(tmp_path, replace(SWEEP, samples=0), "grid.reduced_run:integrate_and_reduce")
    again = rerun(folder, 1000)
    assert len(again) == sum(sizes(folder)) > 6
    assert [run.differs for run in again] == [()] * len(again)


@pytest.mark.slow
@pytest.mark.parametrize("settings", ODD_SETTINGS)
def test_settings_of_no_run_are_one_sentence(results, settings):
    for path in results.rglob("*.h5"):
        with edited(path) as file:
            file.attrs["settings"] = settings
    with pytest.raises(ResultFileError, match=r"0\.h5 has .*settings.* Make it again"):
        rerun(results, 1000)


@pytest.mark.slow
def test_draw_has_requested_size_and_depends_on_seed(results):
    assert len(rerun(results, 3)) == 3
    assert rerun(results, 3, seed=1) == rerun(results, 3, seed=1)
    assert len({tuple((r.file, r.precision, r.tau_per_stage) for r in rerun(results, 3, seed=s)) for s in range(6)}) > 1


def rewritten(results, change):
    """The first run file with both precisions, its variables in double precision changed."""
    place = next(p for p in sorted((results / "runs").rglob("*.h5")) if store.groups_of(p))
    kept = store.read(place)
    root = {name: (v.dims, v.values, v.attrs) for name, v in kept.variables.items()}
    change(root)
    more = {name: (v.dims, v.values, v.attrs) for name, v in store.read(place, "extended").variables.items()}
    attributes = {key: value for key, value in kept.attrs.items() if key not in {"format", "Conventions"}}
    store.write(place, root, attributes, {"extended": more})
    return place.relative_to(results).as_posix()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["q", "block_max_energy_error", "steps", "block_steps"])
def test_a_number_that_differs_in_its_last_bit_is_named(results, name):
    def change(variables):
        first = variables[name][1].reshape(-1)[:1]
        first[:] = first + 1 if first.dtype.kind == "i" else np.nextafter(first, np.inf)

    file = rewritten(results, change)
    differing = [run for run in rerun(results, 1000) if run.differs]
    assert [(run.file, run.precision, run.differs) for run in differing] == [(file, "double", (name,))]


@pytest.mark.slow
@pytest.mark.parametrize("change", [lambda v: v.pop("steps"), lambda v: v.update(more=v["steps"])])
def test_a_variable_that_one_of_them_lacks_is_named(results, change):
    file = rewritten(results, change)
    differing = {(run.file, run.precision): run.differs for run in rerun(results, 1000) if run.differs}
    assert list(differing) == [(file, "double")]
    assert differing[file, "double"] in {("steps",), ("more",)}


def test_a_damaged_run_file_is_named(results):
    (results / "runs/sho/babs7o7h/0.h5").write_bytes(b"?")
    with pytest.raises(ResultFileError, match=r"0\.h5 is truncated or no result file"):
        rerun(results, 1)
