"""Runs that an earlier config has made are taken over: what is integrated, and the bytes of the files."""

from __future__ import annotations

from dataclasses import replace

import pytest

from nearharmonic.engine.settings import Sweep
from nearharmonic.output.store import write
from nearharmonic_paper.experiments.paper import reductions as reduced_run
from nearharmonic_paper.experiments.paper import run
from nearharmonic_paper.experiments.paper.earlier import Earlier, forget, keep
from nearharmonic_paper.experiments.paper.run import runs_of, shards_of
from nearharmonic_paper.tasks.provenance import provenance, task

SHO = Sweep(
    system="sho", t_end="5", lowest=1e-4, highest=1.0, points_per_decade=40, precision=("double", "extended"),
    samples=20, shards=1,
)  # fmt: skip
KEPLER = replace(SHO, system="kepler", t_end="8766", lowest=1.0, highest=100.0, precision=("double",))
KEEPING, REDUCING = "run:integrate", "reductions:integrate_and_reduce"
FUNCTIONS = {KEEPING: run, REDUCING: reduced_run}


@pytest.fixture
def integrated(monkeypatch):
    """Each (precision, steps) that is integrated; step sizes with equal steps share one."""
    seen = []
    original = run.integrate_run

    def noting(one):
        seen.extend(dict.fromkeys((one.precision, steps) for steps in one.steps))
        return original(one)

    for module in FUNCTIONS.values():
        monkeypatch.setattr(module, "integrate_run", noting)
    return seen


def make(folder, asked, function=KEEPING):
    """Write the run files of Ruth's method as jobs do, and return their bytes."""
    contents = {}
    shards = [folder / f"runs/{asked.system}/ruth/{i}.h5" for i in range(shards_of(asked, "ruth"))]
    keep(folder, shards)
    for index, place in enumerate(shards):
        settings = {"sweep": asked, "integrator": "ruth", "shard": index}
        origin = provenance(task(f"nearharmonic_paper.experiments.paper.{function}", **settings))
        module, name = FUNCTIONS[function], function.partition(":")[2]
        made = getattr(module, name)(**settings, earlier=Earlier(folder, place, origin))["run"]
        place.parent.mkdir(parents=True, exist_ok=True)
        write(place, made.variables, {**made.attributes, **origin}, made.groups, coordinates=made.coordinates)
        contents[place.name] = place.read_bytes()
    forget(folder)
    return contents


def planned(asked):
    runs = [one for index in range(shards_of(asked, "ruth")) for one in runs_of(asked, "ruth", index)]
    return {(one.precision, steps) for one in runs for steps in one.steps}


@pytest.mark.parametrize(
    ("asked", "function"),
    [
        (SHO, KEEPING),
        *(pytest.param(*of, marks=pytest.mark.slow) for of in ((KEPLER, KEEPING), (replace(SHO, samples=0), REDUCING))),
    ],
)
def test_twice_as_fine_a_grid_integrates_exactly_the_new_half(tmp_path, integrated, asked, function):
    fine = replace(asked, points_per_decade=80)
    make(tmp_path / "one", asked, function)
    assert set(integrated) == planned(asked)
    integrated.clear()
    made = make(tmp_path / "one", fine, function)
    assert len(integrated) == len(set(integrated))
    assert set(integrated) == planned(fine) - planned(asked)
    assert made == make(tmp_path / "other", fine, function)


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [
        {"shards": 2, "lowest": 0.1},
        *(
            pytest.param(one, marks=pytest.mark.slow)
            for one in ({"shards": 3}, {"lowest": 1e-2}, {"highest": 0.5}, {"precision": ("double",)})
        ),
    ],
)
def test_other_shards_and_smaller_grids_integrate_nothing(tmp_path, integrated, change):
    asked = replace(SHO, points_per_decade=10)
    make(tmp_path / "one", asked)
    other = replace(asked, **change)
    integrated.clear()
    made = make(tmp_path / "one", other)
    assert set(integrated) == planned(other) - planned(asked) == set()
    assert made == make(tmp_path / "other", other)


@pytest.mark.slow
def test_another_precision_integrates_its_runs_alone(tmp_path, integrated):
    asked = replace(SHO, precision=("double",), points_per_decade=10)
    make(tmp_path / "one", asked)
    integrated.clear()
    made = make(tmp_path / "one", replace(asked, precision=("double", "extended")))
    assert {precision for precision, _ in integrated} == {"extended"}
    assert made == make(tmp_path / "other", replace(asked, precision=("double", "extended")))


@pytest.mark.slow
@pytest.mark.parametrize("change", [{"t_end": "6"}, {"samples": 30}, {"summation": "plain"}])
def test_other_runs_are_not_taken_over(tmp_path, integrated, change):
    asked = replace(SHO, points_per_decade=5)
    make(tmp_path / "one", asked)
    integrated.clear()
    make(tmp_path / "one", replace(asked, **change))
    assert set(integrated) == planned(replace(asked, **change))


@pytest.mark.slow
def test_damaged_earlier_file_gives_nothing(tmp_path, integrated):
    asked = replace(SHO, points_per_decade=5)
    whole = make(tmp_path / "one", asked)
    place = tmp_path / "one/runs/sho/ruth/0.h5"
    damaged = bytearray(whole["0.h5"])
    damaged[len(damaged) // 2] ^= 1
    place.write_bytes(damaged)
    integrated.clear()
    assert make(tmp_path / "one", asked) == whole
    assert set(integrated) == planned(asked)
