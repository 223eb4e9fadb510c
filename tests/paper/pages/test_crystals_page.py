"""docs/results/crystals.md: what its text says of the leaders is what its tables have."""

from __future__ import annotations

import re

import pytest

from nearharmonic.integrators import integrators
from nearharmonic_paper.pages.targets.crystals import AROUND, COLDEST, MIDDLE, REQUIRED, WARMEST
from nearharmonic_studies.crystals.drift import FORCES, TEMPERATURE
from nearharmonic_studies.crystals.reductions import GENERAL, kind_of
from nearharmonic_studies.crystals.settings import CrystalsSettings
from support.results.stated_numbers import ROOT, flat, numbers, plain, states

PLACE = "docs/results/crystals.md"
NAMES = {integrators[name].label: name for name in CrystalsSettings().methods}


def rows(part):
    """Cells of the rows of a generated table."""
    text = (ROOT / PLACE).read_text(encoding="utf-8")
    (found,) = re.findall(rf"<!-- {part} -->\n(.*?)\n<!-- end -->", text, re.DOTALL)
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in found.splitlines()[2:]]


def leaders(forces):
    """(temperature, name) of the leaders at a number of forces."""
    column = 2 + ["40", "26", "20", "16", "13", "10", "6.3"].index(forces)
    told = [(float(row[1]), row[column].rpartition(" ")[0]) for row in rows("leaders")]
    return [(temperature, NAMES.get(name, name)) for temperature, name in told if name]


def test_trained_methods_lead_with_many_forces_well_below_melting():
    cold = [name for temperature, name in leaders("26") if temperature <= 0.1]
    assert len(cold) == 12
    assert all(kind_of(name) == "trained" for name in cold)


@pytest.mark.parametrize("forces", ["10", "6.3"])
def test_methods_of_order_two_lead_with_few_forces(forces):
    found = {name for _, name in leaders(forces)}
    assert found <= {"predescu_s3", "bcss_s3", "bcss_s4", "leapfrog"}
    assert [name for temperature, name in leaders(forces) if temperature < 0.1 and name == "leapfrog"] == []


def test_general_methods_lead_near_melting():
    hot = [name for temperature, name in leaders("16") if temperature == 1]
    assert all(kind_of(name) == GENERAL for name in hot)


def test_papers_methods_of_six_stages_lead_from_thirteen_forces():
    six = {"babs6o5h", "babps6o5h"}
    assert {integrators[name].stages for name in six} == {6}
    told = [(float(row[1]), *cell.rpartition(" ")[::2]) for row in rows("leaders") for cell in row[4:7]]
    warm = [(NAMES.get(name, name), float(lead)) for temperature, name, lead in told if temperature < 1]
    led = [lead for name, lead in warm if name in six]
    assert len(led) > 0.6 * len(warm)
    assert states(PLACE, [max(led)], "the paper's methods of six stages")
    hot = [NAMES.get(row[3].rpartition(" ")[0]) for row in rows("leaders") if float(row[1]) == 1]
    assert set(hot) <= six


def size(cell):
    """Magnitude of a deviation; a run that diverged has none."""
    return abs(float(cell)) if cell != "–" else float("inf")


def test_leapfrog_in_the_middle_has_the_nearest_averages():
    found = {row[0]: [size(cell) for cell in row[1:]] for row in rows("averages")}
    reference = found.pop("Leapfrog")
    for column in (0, 2):
        assert all(row[column] >= reference[column] for row in found.values())
    near = [found[name][column] for name in ("BCSS 3", "BCSS 4", "Predescu s3") for column in (1, 3)]
    assert max(near) < 0.7
    assert "No other method gains there." in flat(PLACE)


def test_energy_drifts_with_many_stages_and_not_with_few():
    found = {row[0]: [float(plain(cell)) for cell in row[1:]] for row in rows("drift")}
    assert max(*found["Leapfrog"], *found["Predescu s3"]) < 0.01
    many = zip(found["BAB's9o7H"], found["trained_light"], strict=True)
    few = map(max, found["Leapfrog"], found["Predescu s3"])
    assert all(min(pair) > 3 * least for pair, least in zip(many, few, strict=True))
    assert (TEMPERATURE, FORCES) == (0.3, 20)
    assert states(PLACE, [TEMPERATURE, FORCES], "largest change of the energy")


def test_size_of_the_largest_crystal_is_that_of_the_text():
    assert states(PLACE, [max(float(row[1]) for row in rows("errors"))], "these crystals have up to")


def test_lead_of_the_method_trained_on_crystals_is_as_stated():
    warm = [row for row in rows("trained") if float(row[1]) <= WARMEST and (row[2] == "" or float(row[2]) >= COLDEST)]
    leads = [float(plain(row[3 + AROUND.index(MIDDLE)])) for row in warm]
    text = flat(PLACE)
    low, high, middle = numbers(text, r"every other method is ([\d.]+) to ([\d.]+) decades, ([\d.]+) in the middle")
    required, enough, count = numbers(text, r"and at least ([\d.]+) in (\d+) of (\d+) cases")
    # The table rounds to tenths, the sentence to hundredths.
    assert (min(leads), max(leads)) == pytest.approx((low, high), abs=0.055)
    assert sorted(leads)[len(leads) // 2] == pytest.approx(middle, abs=0.1)
    assert count == len(leads)
    assert required == REQUIRED
    assert enough < count  # or it would be registered
