"""Stability gaps against closed forms, values known elsewhere, and a scan of the trace of the step matrix."""

from __future__ import annotations

import pytest
from mpmath import inf, linspace, mp, mpf, sqrt

from nearharmonic.integrators import integrators
from nearharmonic.linear_stability import stability_end, stability_gaps, stability_limit
from nearharmonic.tableau import Tableau

from .oracles import oscillator_step

EVERY = pytest.mark.parametrize("name", list(integrators))


def trace(tableau, tau):
    step = oscillator_step(tableau, mpf(tau))
    return step[0, 0] + step[1, 1]


def symmetric(outer, inner):
    return Tableau(
        name="symmetric", label="symmetric", order=2, first="kick", kick=outer, drift=inner, source="here", digits=30
    )


@pytest.mark.parametrize("first", ["kick", "drift"])
def test_leapfrog_is_stable_up_to_two_and_never_after(first):
    assert stability_gaps(symmetric(("0.5", "0.5"), ("1",)), first=first) == [(2, inf)]


def test_where_the_trace_only_touches_two_no_gap_opens():
    # Two leapfrog steps of half the size: the trace touches -2 at sqrt(8), and leaves [-2, 2] for good at 4.
    assert stability_gaps(symmetric(("0.25", "0.5", "0.25"), ("0.5", "0.5"))) == [(4, inf)]


def test_the_gap_of_two_stages_is_where_its_quadratic_equations_say():
    # Kicks b, 1 - 2b, b and drifts 1/2: with x = tau^2, K12/tau = 1 - x(1 - 2b)/4 and K21/tau has a factor
    # 1 - b x/2; at b = 1/4 these roots, 4/(1 - 2b) and 2/b, meet.
    with mp.workdps(30):
        (start, end), (last, forever) = stability_gaps(symmetric(("0.3", "0.4", "0.3"), ("0.5", "0.5")))
        assert abs(start - sqrt(mpf(20) / 3)) < mpf(10) ** -28
        assert abs(end - sqrt(mpf(10))) < mpf(10) ** -28
        assert (last > end, forever) == (True, inf)


@EVERY
def test_each_edge_is_a_crossing_of_two_to_more_than_twelve_digits(name):
    tableau, gaps = integrators[name], stability_gaps(name)
    assert stability_limit(name) == gaps[0][0]
    assert stability_end(name) == gaps[-1][0]
    assert gaps[-1][1] == inf
    with mp.workdps(60):
        for start, end in gaps:
            assert (
                abs(trace(tableau, start * (1 - mpf(10) ** -14)))
                < 2
                < abs(trace(tableau, start * (1 + mpf(10) ** -14)))
            )
            if end != inf:
                assert (
                    abs(trace(tableau, end * (1 - mpf(10) ** -14)))
                    > 2
                    > abs(trace(tableau, end * (1 + mpf(10) ** -14)))
                )


@EVERY
def test_a_scan_finds_instability_in_the_gaps_alone(name):
    gaps, tableau = stability_gaps(name), integrators[name]
    for tau in linspace(mpf("0.01"), 2 * gaps[-1][0], 300):
        assert (abs(trace(tableau, tau)) > 2) == any(start < tau < end for start, end in gaps)


@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("ruth", "1.573401947"),
        ("s5odr4", "2.720974539"),
        ("aba104", "3.089617987"),
        ("aba864", "3.142177180"),
        ("aba1064", "3.146107336"),
        ("yoshida_s7o6a", "2.269057996"),
        ("abas5o6h", "3.069226671"),
        ("babs7o7h", "3.140769602"),
        ("babps8o7h", "3.139720728"),
        ("babps9o7h", "3.140827789"),
    ],
)
def test_the_limits_agree_with_those_found_by_another_program(name, limit):
    assert abs(stability_limit(name) - mpf(limit)) < mpf("1e-9")


@EVERY
def test_exchanging_roles_changes_no_edge(name):
    # The trace is the same: K12 and K21 change places.
    assert stability_gaps(name, first="kick") == stability_gaps(name, first="drift")
