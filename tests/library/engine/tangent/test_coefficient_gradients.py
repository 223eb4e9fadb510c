"""Derivatives of runs with respect to coefficients of the method, against complex steps of a plain loop."""

from __future__ import annotations

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.engine import gradient as coefficients
from nearharmonic.errors import SettingError
from nearharmonic.math import cos, sin

#: A complex step has no rounding error of its own; 1000 roundings of numbers near 1 are below this.
ROUNDING = 1e-12
TINY = 1e-40


def henon_heiles(q, t):
    x, y = q
    return x + 2 * x * y, y + x * x - y * y


def driven(q, t):
    return (1.5 * np.sin(q[0]) + 0.3 * np.sin(t),)


DRIVEN = nh.System(
    name="driven", V=lambda q, t, k, a: -k * cos(q[0]) + a * q[0] * sin(t), q0=["1"], p0=["0.2"], t_end="8",
    parameters={"k": "1.5", "a": "0.3"}, time_dependent=True,
)  # fmt: skip


def end_of_loop(force, tableau, kicks, drifts, tau, steps, q, p):
    """State at the end of a plain loop; the time advances with the drifts."""
    q, p, t = [*q], [*p], 0.0
    for _ in range(steps):
        for i in range(max(len(kicks), len(drifts))):
            for operator in ("kick", "drift") if tableau.first == "kick" else ("drift", "kick"):
                if operator == "kick" and i < len(kicks):
                    p = [a - kicks[i] * tau * f for a, f in zip(p, force(q, t), strict=True)]
                elif operator == "drift" and i < len(drifts):
                    q, t = [a + drifts[i] * tau * b for a, b in zip(q, p, strict=True)], t + drifts[i] * tau
    return q, p


def by_complex_steps(force, tableau, tau, steps, q, p, observable):
    rows = {name: np.array([float(c) for c in getattr(tableau, name)], dtype=complex) for name in ("kick", "drift")}
    found = {}
    for name, row in rows.items():
        found[name] = np.empty(len(row))
        for j in range(len(row)):
            moved = rows | {name: row + 1j * TINY * (np.arange(len(row)) == j)}
            end = end_of_loop(force, tableau, moved["kick"], moved["drift"], tau, steps, q, p)
            found[name][j] = observable(*end).imag / TINY
    return found


CASES = {
    "drift first": ("henon_heiles", henon_heiles, "ruth", 0.1, 12, (0.1, 0.3), (0.2, -0.1)),
    "kick first": ("henon_heiles", henon_heiles, "babs7o7h", 0.6, 12, (0.1, 0.3), (0.2, -0.1)),
    "asymmetric": ("henon_heiles", henon_heiles, "mclachlan_atela_5", 0.3, -12, (0.1, 0.3), (0.2, -0.1)),
    "driven": (DRIVEN, driven, "aba104", 0.5, 8, (1.0,), (0.2,)),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_gradient_has_derivatives_of_the_loop_by_each_coefficient(case):
    system, force, name, tau, t_end, q, p = CASES[case]
    tableau, steps = nh.integrators[name], round(abs(t_end) / tau)

    def observable(q, p):
        return q[0] * p[-1] - p[0] * p[0]

    found = nh.gradient(system, name, tau, observable, t_end=t_end, q0=q, p0=p, coefficients=True)
    wanted = by_complex_steps(force, tableau, t_end / steps, steps, q, p, observable)
    for row in ("kick", "drift"):
        assert found[row].dims == (f"{row}_number",)
        scale = np.abs(wanted[row]).max()
        assert scale > 0.1
        assert found[row].values == pytest.approx(wanted[row], abs=ROUNDING * scale)


def test_members_have_their_own_derivatives_and_others_are_unchanged():
    def observable(q, p):
        return q[0] * p[1]

    given = {"t_end": 12, "q0": [[0.1, 0.3], [0.2, 0.1]], "p0": [0.2, -0.1]}
    found = nh.gradient("henon_heiles", "ruth", 0.1, observable, coefficients=True, **given)
    plain = nh.gradient("henon_heiles", "ruth", 0.1, observable, **given)
    assert (found["q0"] == plain["q0"]).all()
    assert "kick" not in plain
    assert found.kick.dims == ("member", "kick_number")
    alone = nh.gradient("henon_heiles", "ruth", 0.1, observable, coefficients=True, **given | {"q0": [0.2, 0.1]})
    assert found.kick.values[1] == pytest.approx(alone.kick.values, abs=1e-13)


def test_diverged_run_has_no_derivatives():
    found = nh.gradient("henon_heiles", "leapfrog", 3.0, lambda q, p: q[0], t_end=300, coefficients=True)
    assert found.status == "diverged"
    assert np.isnan(found.kick).all()
    assert np.isnan(found.drift).all()


@pytest.mark.parametrize(("name", "what"), [("gauss16", "it has no kicks"), ("chin_4a", "it has no kicks")])
def test_methods_without_plain_kicks_are_refused(name, what):
    with pytest.raises(SettingError, match=what):
        nh.gradient("sho", name, 0.1, lambda q, p: q[0], t_end=10, coefficients=True)


def test_runs_too_long_for_memory_are_refused(monkeypatch):
    monkeypatch.setattr(coefficients, "MOST_NUMBERS", 1000)
    with pytest.raises(SettingError, match=r"coefficients = True is not allowed: up to 62 steps here, .* not 100"):
        nh.gradient("henon_heiles", "ruth", 0.1, lambda q, p: q[0], t_end=10, coefficients=True)
