"""``nearharmonic compare --figure``: both results in one figure."""

from __future__ import annotations

import json
import shutil

import pytest

from nearharmonic.cli import main
from nearharmonic.output import store
from nearharmonic_paper.record.compare import overlay
from support.cubes.artists import NO_LINE, SOLID, dashes, lines_of

pytestmark = pytest.mark.slow


def test_the_figure_shows_the_first_solid_and_the_second_dashed(other, project):
    pairs = {}
    for system in ("henon_heiles", "sho"):
        cubes = [store.read(folder / f"cubes/{system}.h5") for folder in (project, other)]
        pairs[system] = [cube.sel(precision="double") for cube in cubes]
    panels = overlay(["paper", "other"], pairs).axes
    assert len(panels) == 4
    for i, (system, cubes) in enumerate(pairs.items()):
        for j, variable in enumerate(("max_energy_error", "mean_energy_error")):
            axes = panels[2 * i + j]
            assert axes.get_title(loc="left").startswith(cubes[0].attrs["system_label"]), system
            seen = 0
            for cube, expected in zip(cubes, ([SOLID, NO_LINE], [(4.0, 2.0)]), strict=True):
                for name in cube.integrator.values:
                    lines = lines_of(axes, cube.tau_per_stage.values, cube[variable].sel(integrator=name).values)
                    looks = [d if d in (SOLID, NO_LINE) else tuple(x / line.get_linewidth() for x in d)
                             for line in lines for d in [dashes(line)]]  # fmt: skip
                    assert looks == expected, name
                    seen += len(lines)
            assert seen == len(axes.get_lines())


def test_results_without_a_system_in_common_have_no_figure(copy, capsys):
    shutil.rmtree(copy / "cubes")
    assert main(["compare", "paper", "copy", "--figure", "both.png"]) == 2
    assert "no figure: paper and copy have no system in common" in capsys.readouterr().err


def test_the_figure_is_written(copy, tmp_path, capsys):
    place = tmp_path / "sub/both.png"
    assert main(["compare", "paper", "copy", "--figure", str(place), "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["figure"] == str(place)
    assert place.stat().st_size > 1000
