"""README and the pages below docs/start/: what a run finds of the pendulum, and the times of targets."""

from __future__ import annotations

import numpy as np
import pytest

from nearharmonic_paper.experiments.derivation.experiment import EXPERIMENT as DERIVATION
from nearharmonic_paper.experiments.stability.experiment import EXPERIMENT as STABILITY
from nearharmonic_paper.pages.anharmonicity import examples_in, orbits_of
from nearharmonic_studies.trained.experiment import EXPERIMENT as TRAINED
from support.results.code_cells import executed
from support.results.stated_numbers import ROOT, flat, states

PLACE = "docs/start/near_harmonic.md"
NEW = ("BABs7o7H", "BAB's9o7H")


@pytest.mark.slow
def test_the_lead_on_the_pendulum_ends_where_stated():
    lines = {line.get_label(): line for line in executed(PLACE)["axes"].lines}
    amplitudes = lines["Ruth"].get_xdata()
    new, others = (
        np.min([line.get_ydata() for name, line in lines.items() if (name in NEW) is there], axis=0)
        for there in (True, False)
    )
    lead = np.log(others / new)
    (first, *_) = np.flatnonzero(lead < 0)
    place = slice(first, first - 2, -1)
    gone = np.exp(np.interp(0, lead[place], np.log(amplitudes[place])))
    assert lead[0] > np.log(100)
    assert states(PLACE, [round(float(gone), 1)], "At small amplitudes", "it is gone")
    assert states(PLACE, [30.0], "Below, each method", "periods")


def test_times_of_targets_in_readme_are_those_declared():
    times = DERIVATION.duration, STABILITY.duration, TRAINED.cubes_duration
    assert "`snakemake -j2 derive stability trained_proof` ({}, {}, {})".format(*times) in flat("README.md")


def test_pages_say_how_many_systems_are_compared():
    count = len(orbits_of(examples_in([str(path) for path in ROOT.glob("examples/*.py")])))
    words = {13: "thirteen", 14: "fourteen", 15: "fifteen", 16: "sixteen"}
    for place in (PLACE, "docs/results/index.md"):
        assert f"{words[count]} systems" in flat(place), place
