"""docs/explanation/splitting.md: the drawn step, and the costs and orders that the page states."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest
from mpmath import cos, hypot, mp, mpf, sin

import nearharmonic as nh
from nearharmonic.theory.order import harmonic_orders_of
from support.results.code_cells import executed
from support.results.stated_numbers import flat, states

PAGE = "docs/explanation/splitting.md"


@pytest.fixture(scope="module")
def drawn():
    return executed(PAGE)


def path(name, tau, steps):
    """States between the substeps on the oscillator from (1, 0), exact."""
    tableau = nh.integrators[name]
    states, drifts, kicks = [(Fraction(1), Fraction(0))], iter(()), iter(())
    for _ in range(steps):
        drifts, kicks = ([Fraction(c) * tau for c in row] for row in (tableau.drift, tableau.kick))
        while drifts or kicks:
            q, p = states[-1]
            if len(kicks) > len(drifts) or (len(kicks) == len(drifts) and tableau.first == "drift"):
                states.append((q, p - kicks.pop(0) * q))
            else:
                states.append((q + drifts.pop(0) * p, p))
    return states


@pytest.mark.parametrize(("panel", "name", "steps"), [(0, "babps8o7h", 1), (1, "leapfrog", 8)])
def test_arrows_of_the_picture_are_substeps_of_one_interval(drawn, panel, name, steps):
    time = Fraction("1.6")
    expected = path(name, time / steps, steps)
    axes = drawn["figure"].axes[panel]
    arrows = [one for one in axes.texts if getattr(one, "arrow_patch", None)]
    assert len(arrows) == len(expected) - 1
    for arrow, start, end in zip(arrows, expected, expected[1:], strict=False):
        assert arrow.xyann == pytest.approx([float(x) for x in start], abs=1e-12)
        assert arrow.xy == pytest.approx([float(x) for x in end], abs=1e-12)
    with mp.workdps(30):
        (q, p), t = (mpf(x.numerator) / x.denominator for x in expected[-1]), mpf("1.6")
        error = hypot(q - cos(t), p + sin(t))
    digit, power = re.findall(
        r"error at the end: \$(\d) \\times 10\^\{(-?\d+)\}\$", " ".join(x.get_text() for x in axes.texts)
    )[0]
    assert f"{float(error):.0e}" == f"{digit}e-{abs(int(power)):02}"


def test_labels_of_the_picture_lie_beside_what_they_name(drawn):
    left = drawn["figure"].axes[0]
    backward = [
        one for one in left.texts if getattr(one, "arrow_patch", None) and one.xy[0] > 0.9 and one.xy[1] > one.xyann[1]
    ]
    (label,) = [one for one in left.texts if one.get_text() == "backward kick"]
    assert any(one.xyann[1] < label.get_position()[1] < one.xy[1] for one in backward)


def test_both_panels_take_as_many_forces_as_stated(drawn):
    first, both = 1, {nh.integrators["babps8o7h"].evaluations(1), nh.integrators["leapfrog"].evaluations(8)}
    assert {forces - first for forces in both} == {8}
    assert "Within a run, each panel below takes eight forces for the same time." in flat(PAGE)


@pytest.mark.parametrize("name", ["ruth", "abas5o6h", "leapfrog", "babps8o7h"])
def test_runs_take_the_forces_of_the_table(name):
    tableau, steps = nh.integrators[name], 7
    (row,) = re.findall(r"\| forces in n steps \| (.*?) \| (.*?) \|", flat(PAGE))
    expression = row[tableau.first == "kick"].replace("n s", "n * s")
    run = nh.integrate("sho", name, 0.1, t_end=0.7)
    assert run.evaluations.item() == eval(expression, {"n": steps, "s": tableau.stages})


@pytest.mark.parametrize("name", ["ruth", "abas5o6h", "babs7o7h", "pefrl", "yoshida_s7o6a", "mclachlan_sb3a5"])
def test_exchanged_roles_keep_the_order_for_any_H(name):
    assert nh.order_of(name, first="kick") == nh.order_of(name, first="drift")


def test_both_kinds_of_sets_leave_the_stated_orders():
    orders = {harmonic_orders_of(name)[:2] for name in ("babps8o7h", "babs7o7h")}
    assert len(orders) == 1
    assert states(PAGE, orders.pop(), "harmonic order of position", "momentum")
