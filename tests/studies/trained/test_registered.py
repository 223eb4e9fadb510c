"""The trained methods that are registered: what their notes say, what they gain, and that a search finds them."""

from __future__ import annotations

import re

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.integrators import integrators
from nearharmonic.theory.order import nystrom_order_of
from nearharmonic.training.objective import mean_errors
from nearharmonic_studies.trained import search
from nearharmonic_studies.trained.settings import PURPOSES, REGISTERED, SearchSettings

#: Seed of problems that no set of the search has, and how many.
SEED, PROBLEMS = 70_001, 64


#: Purposes of all registered methods: those that are trained by default, and those for polynomial potentials.
POLYNOMIAL = ("cubic", "cubic_precise", "quartic_precise")
ALL = (*REGISTERED, *POLYNOMIAL)


@pytest.mark.parametrize("name", ALL)
def test_a_note_says_window_ensemble_limit_seed_and_run(name):
    purpose, tableau = PURPOSES[name], integrators[PURPOSES[name].title]
    low, high = purpose.window
    assert f"tau/s {low:.3g} to {high:.3g}; {purpose.problems}; " in tableau.note
    assert re.search(r"seed \d+; run [0-9a-f]{16}$", tableau.note)
    assert tableau.digits == 60
    if not tableau.modified:
        limit = re.search(r"stability limit tau = ([\d.]+);", tableau.note)
        assert float(limit.group(1)) == pytest.approx(float(nh.stability_limit(tableau)), abs=1e-4)
        # A window reaches up to the limit at most.
        assert high * tableau.stages < float(limit.group(1))


@pytest.mark.parametrize("name", POLYNOMIAL)
def test_a_method_has_the_order_of_its_note(name):
    tableau = integrators[PURPOSES[name].title]
    order, degree = map(int, re.search(r"; order (\d) for V of degree (\d); ", tableau.note).groups())
    assert nh.order_of(tableau, potential_degree=degree) == order
    assert (nh.order_of(tableau), nystrom_order_of(tableau)) == (4, tableau.order)
    assert (tableau.requires is None) == (tableau.order == 4)


def test_every_trained_method_has_a_purpose():
    names = list(nh.integrators.registered)
    assert sorted(one for one in names if one.startswith("trained_")) == sorted(PURPOSES[name].title for name in ALL)


#: Half width in decades of the interval of a gain on 192 problems (docs/results/trained.md); less is noise.
RESOLVED = 0.05


@pytest.mark.long
def test_search_finds_method_as_good_as_registered_one():
    """The last bits of linear algebra differ from processor to processor, and the search takes another path."""
    purpose, settings = PURPOSES["weak"], SearchSettings()
    registered = integrators[purpose.title]
    document = search.train("weak", settings, purpose.known)["document"]
    assert (document["first"], len(document["kick"])) == (registered.first, len(registered.kick))
    problems = purpose.ensembles(PROBLEMS, SEED)
    found = nh.Tableau(
        name="found", order=4, first=document["first"], kick=tuple(document["kick"]), drift=tuple(document["drift"]),
        digits=60, source="this test",
    )  # fmt: skip
    errors = [mean_errors(one, [found, registered], purpose.tau_per_stage, purpose.charge) for one in problems]
    lost = np.mean(errors, axis=0)[0] - np.mean(errors, axis=0)[1]
    assert abs(lost).max() < RESOLVED
