"""Numbers that README and the pages under docs state, as far as they are cheap: each is computed and compared."""

from __future__ import annotations

import contextlib
import io
import re
from math import isclose
from pathlib import Path

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.cli import main

ROOT = Path(__file__).parents[3]
SIXTH_ORDER = ("babs8o6_7h", "abas9o6_7h", "babs10o6_8h", "abas11o6_8h")
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


def stated(page, pattern):
    """The numbers that ``pattern`` finds in ``page``, where it occurs once; line breaks count as spaces."""
    text = re.sub(r"\s+", " ", (ROOT / page).read_text(encoding="utf-8"))
    (found,) = re.findall(pattern, text)
    words = [found] if isinstance(found, str) else found
    return [float(re.sub(r" × 10([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)", lambda m: "e" + m[1].translate(SUPERSCRIPTS), w)) for w in words]


def decades(system, name, taus_per_stage):
    """log10 of the maximum energy error of a method at each step size per stage."""
    tableau = nh.integrators[name]
    errors = nh.sweep(system, name, [tau * tableau.stages for tau in taus_per_stage]).max_energy_error.values
    return np.log10(errors)


def lost(system, rivals, taus_per_stage):
    """Decades by which each method of order six loses to the best of ``rivals``, a row a method."""
    best = np.min([decades(system, rival, taus_per_stage) for rival in rivals], axis=0)
    return np.array([decades(system, name, taus_per_stage) - best for name in SIXTH_ORDER])


def test_the_terms_of_the_decomposition_are_those_of_the_page():
    assert abs(nh.kappa("babps8o7h", 7)[6]) < 1e-60 < abs(nh.kappa("abas5o6h", 7)[6])
    (exchanged,) = stated("docs/derivation.md", r"BABs6o7H, with its roles exchanged, has κ₇ = (\d\.\d+)")
    assert isclose(nh.kappa("babs6o7h", 7, first="drift")[6], exchanged, abs_tol=5e-4)


def test_the_methods_of_order_six_win_and_lose_on_kepler_by_what_the_page_says():
    low, high = stated("docs/results.md", r"they beat BAB's9o7H by (\S+) to (\S+) decades")
    won = -lost("kepler", ["babps9o7h"], [2.0])[:, 0]
    assert [round(won.min(), 1), round(won.max(), 1)] == [low, high]
    at_20, at_30 = lost("kepler", ["aba104"], [20.0, 30.0]).T
    assert (at_30 > 0).all()
    losses = stated("docs/results.md", r"At 20 h abas9o6_7h and babs10o6_8h lose by (\S+) and (\d\.\d)")
    assert at_20[1:3].round(1).tolist() == losses
    assert (at_20[[0, 3]] < 0.1).all()


def test_the_methods_of_order_six_lose_on_henon_heiles_by_what_the_page_says():
    low, high = stated("docs/results.md", r"at 0\.1 by (\S+) to (\d\.\d)\.")
    loss = lost("henon_heiles", ["babps8o7h", "babps9o7h"], [0.03, 0.05, 0.1, 0.2, 0.3])
    assert (loss[:, :4] > 0).all()
    assert [loss[:, 2].min().round(1), loss[:, 2].max().round(1)] == [low, high]
    assert (loss[:, 4] > 0.1).sum() == 3


def test_the_methods_of_order_six_lose_on_the_oscillator_by_what_the_page_says():
    low, high = stated("docs/results.md", r"from 0\.03 to 0\.3, by (\S+) to (\d\.\d)\.")
    loss = lost("sho", ["babs7o7h"], [0.03, 0.05, 0.1, 0.2, 0.3])
    assert (loss[:, 3:] > 0).all()
    assert [loss[0].min().round(1), loss[0].max().round(1)] == [low, high]


def test_the_budget_of_a_recommendation_is_what_the_pages_say():
    from nearharmonic.recommendation.question import question

    asked = question("sho", 1e-3)
    (thousands,) = stated("README.md", r"reaches the error within (\d+) 000 evaluations")
    (again,) = stated("docs/own_systems.md", r"in a run that is recommended, (\d+) 000 by default")
    assert 1000 * thousands == 1000 * again == asked.budget
    (top, bottom) = stated("docs/own_systems.md", r"numbers of steps, up to (\d)/(\d) of the budget")
    assert asked.longest == asked.budget * top / bottom
    (word,) = [word for word in shown("recommend", "--help").split() if word.startswith("200000")]
    assert word == f"{asked.budget})"


def shown(*words):
    """What the command prints."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        main([*words])
    return out.getvalue()


@pytest.mark.slow
def test_chains_and_bodies_take_the_memory_that_the_page_says():
    stated_bytes = stated("docs/larger_systems.md", r"(\d+) kB for the chain and (\d+) kB for the bodies")
    examples = (ROOT / "examples" / name for name in ("fput_chain.py", "hundred_bodies.py"))
    taken = [nh.problem(str(path), "leapfrog").memory for path in examples]
    assert [round(bytes_taken / 1000) for bytes_taken in taken] == stated_bytes
