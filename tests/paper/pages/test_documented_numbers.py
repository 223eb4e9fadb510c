"""Numbers in README and docs that are cheap to compute: each is computed and compared."""

from __future__ import annotations

import contextlib
import io

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.cli import main
from support.results.stated_numbers import ROOT, states

RESULTS = "docs/results/sixth_order.md"
SIXTH_ORDER = ("babs8o6_7h", "abas9o6_7h", "babs10o6_8h", "abas11o6_8h")


def decades(system, name, taus_per_stage):
    """log10 of the maximum energy error of a method at each step size per stage."""
    tableau = nh.integrators[name]
    errors = nh.sweep(system, name, [tau * tableau.stages for tau in taus_per_stage]).max_energy_error.values
    return np.log10(errors)


def least_and_most(values):
    """As the pages state them, to a tenth."""
    return [float(values.min().round(1)), float(values.max().round(1))]


def lost(system, rivals, taus_per_stage):
    """Decades by which each method of order six loses to the best of ``rivals``, a row a method."""
    best = np.min([decades(system, rival, taus_per_stage) for rival in rivals], axis=0)
    return np.array([decades(system, name, taus_per_stage) - best for name in SIXTH_ORDER])


def test_the_terms_of_the_decomposition_are_those_of_the_page():
    assert abs(nh.kappa("babps8o7h", 7)[6]) < 1e-60 < abs(nh.kappa("abas5o6h", 7)[6])
    exchanged = nh.kappa("babs6o7h", 7, first="drift")[6]
    assert states("docs/results/derivation.md", [round(float(exchanged), 3)], "BABs6o7H", "κ₇")


def test_order_six_methods_win_and_lose_on_kepler_as_stated():
    won = -lost("kepler", ["babps9o7h"], [2.0])[:, 0]
    assert states(RESULTS, least_and_most(won), "BAB's9o7H", "τ/s = 2 h")
    at_20, at_30 = lost("kepler", ["aba104"], [20.0, 30.0]).T
    assert (at_30 > 0).all()
    assert states(RESULTS, at_20[1:3].round(1).tolist(), "20 h", "abas9o6_7h and babs10o6_8h")
    assert (at_20[[0, 3]] < 0.1).all()


def test_order_six_methods_lose_on_henon_heiles_as_stated():
    loss = lost("henon_heiles", ["babps8o7h", "babps9o7h"], [0.03, 0.05, 0.1, 0.2, 0.3])
    assert (loss[:, :4] > 0).all()
    assert states(RESULTS, [0.1, *least_and_most(loss[:, 2])], "Hénon-Heiles", "BAB's8o7H and BAB's9o7H")
    assert (loss[:, 4] > 0.1).sum() == 3


def test_order_six_methods_lose_on_oscillator_as_stated():
    loss = lost("sho", ["babs7o7h"], [0.03, 0.05, 0.1, 0.2, 0.3])
    assert (loss[:, 3:] > 0).all()
    assert states(RESULTS, [0.03, 0.3, *least_and_most(loss[0])], "`babs8o6_7h`", "every step size")


def test_the_budget_of_a_recommendation_is_what_the_pages_say():
    from nearharmonic.recommendation.question import question

    asked = question("sho", 1e-3)
    thousands = [asked.budget // 1000, 0.0]  # 200 000
    assert states("docs/start/choosing.md", thousands, "exit status is 1", "evaluations")
    assert states("docs/how_to/own_systems.md", thousands, "`--budget`", "by default")
    assert states(
        "docs/how_to/own_systems.md", (asked.longest / asked.budget).as_integer_ratio(), "steps", "of the budget"
    )
    (word,) = [word for word in shown("recommend", "--help").split() if word.startswith("200000")]
    assert word == f"{asked.budget})"


def shown(*words):
    """Output of the command."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        main([*words])
    return out.getvalue()


@pytest.mark.long
def test_chains_and_bodies_take_the_memory_that_the_page_says():
    examples = (ROOT / "examples" / name for name in ("fput_chain.py", "hundred_bodies.py"))
    taken = [nh.problem(str(path), "leapfrog").memory for path in examples]
    for kilobytes in (round(one / 1000) for one in taken):
        assert states("docs/how_to/larger_systems.md", [kilobytes], "kB for the chain", "kB for the bodies")
