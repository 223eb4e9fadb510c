"""docs/results/stability.md: its tables are those of runs, and its text says what they have."""

from __future__ import annotations

import re

import pytest

from nearharmonic.integrators import integrators
from nearharmonic.output.store import read
from nearharmonic_paper.experiments.stability.ensembles import stacked
from nearharmonic_paper.experiments.stability.henon_heiles import run
from nearharmonic_paper.experiments.stability.henon_heiles.reductions import (
    TOLERATED,
    henon_heiles_cube,
    henon_heiles_table,
)
from nearharmonic_paper.experiments.stability.kinetic_energy.reductions import (
    COMPARED_AT,
    kinetic_energy_cube,
    kinetic_energy_table,
)
from nearharmonic_paper.experiments.stability.settings import EnsembleSettings
from nearharmonic_paper.pages.targets import stability
from nearharmonic_paper.tasks import job
from support.results.recorded_results import unpack
from support.results.stated_numbers import ROOT, states

PLACE = "docs/results/stability.md"
SETTINGS = EnsembleSettings()


def part(name):
    """The lines of a generated part of the page."""
    (text,) = re.findall(
        rf"<!-- {name} -->\n(.*?)\n<!-- end -->", (ROOT / PLACE).read_text(encoding="utf-8"), re.DOTALL
    )
    return text.splitlines()


def cells(name):
    """The rows of a table by their first cells."""
    return {line.split("|")[1].strip(): [cell.strip() for cell in line.split("|")[2:-1]] for line in part(name)[2:]}


def test_settings_of_the_ensembles_are_those_of_the_page():
    assert len(SETTINGS.energies) == 4
    assert states(PLACE, [SETTINGS.trajectories], "trajectories on each of four energy surfaces")
    assert states(PLACE, [100 * TOLERATED], "grey where more than")
    assert states(PLACE, [100 * TOLERATED], "The table has the largest step sizes")
    assert states(PLACE, [COMPARED_AT], "on a relativistic oscillator")


def test_errors_on_the_relativistic_oscillator_are_the_recorded(tmp_path):
    cube = kinetic_energy_cube(read(unpack(tmp_path) / "cubes/kinetic_energy.h5"))
    assert stability.kinetic({"kinetic_energy": kinetic_energy_table(cube).records()}).splitlines() == part("kinetic")


def test_methods_named_by_the_page_are_stable_above_their_limit():
    above = {name for name, (_, lowest, *_) in cells("limits").items() if float(lowest) > 1}
    assert above == {integrators[name].label for name in ("aba1064", "babs7o7h", "babps8o7h", "babps9o7h")}


def test_yoshidas_plain_sums_alone_grow_almost_linearly():
    *_, largest, _ = part("rounding")[2].split("|")[1:-1]
    assert float(largest) > 0.8


@pytest.mark.long
def test_step_sizes_at_which_orbits_stay_are_those_run(tmp_path):
    place = tmp_path / "run.h5"
    job.write(run.measure("ruth", SETTINGS)["run"], [str(place)], {})
    cube = henon_heiles_cube(stacked([integrators["ruth"]], [read(place)]))
    table = stability.limits({"stability_henon_heiles": henon_heiles_table(cube).records()})
    assert table.splitlines() == part("limits")[:3]
