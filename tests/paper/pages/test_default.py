"""The default method of docs/start/choosing.md: its energy errors, by a loop of numpy over printed digits."""

import re

import numpy as np
import pytest

import nearharmonic as nh
from support.results.stated_numbers import ROOT

PAGE = (ROOT / "docs/start/choosing.md").read_text(encoding="utf-8")
#: V and its gradient, position and momentum at the start, interval, and highest frequency, by the names in the table.
SYSTEMS = {
    "harmonic oscillator": (lambda q: q @ q / 2, lambda q: q, (1,), (0,), 500, 1),
    "Hénon-Heiles": (
        lambda q: q @ q / 2 + q[0] ** 2 * q[1] - q[1] ** 3 / 3,
        lambda q: q + np.array([2 * q[0] * q[1], q[0] ** 2 - q[1] ** 2]),
        (0.3, 0), (0, 0.4), 500, 1,
    ),
    "FPUT-8": (
        lambda q: sum(d**2 / 2 + d**4 / 40 for d in np.diff(q, prepend=0, append=0)),
        lambda q: -np.diff([d + d**3 / 10 for d in np.diff(q, prepend=0, append=0)]),
        np.sin(np.pi * np.arange(1, 9) / 9).round(6), np.zeros(8), 400, 2 * np.cos(np.pi / 18),
    ),
}  # fmt: skip
METHODS = {"babps8o7h": 0.8, "ruth": 0.3, "leapfrog": 0.1}


@pytest.mark.slow
@pytest.mark.parametrize("name", SYSTEMS)
def test_default_has_the_stated_energy_errors(name):
    V, gradient, q0, p0, t_end, omega = SYSTEMS[name]
    (row,) = re.findall(rf"^\| {name} \|(.*) \|$", PAGE, re.MULTILINE)
    digits = row.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")).replace(" × 10", "e")
    stated = [float(error) for error in digits.split("|")]
    for error, (method, tau) in zip(stated, METHODS.items(), strict=True):
        one, steps = nh.integrators[method], round(t_end * omega / tau)
        rows = {"drift": np.array(one.drift, float), "kick": np.array(one.kick, float)}
        outer, inner = ("drift", "kick") if one.first == "drift" else ("kick", "drift")
        moves = [*zip(rows[outer], rows[inner], strict=False), (rows[outer][-1], 0.0)]
        q, p, worst = np.array(q0, float), np.array(p0, float), 0.0
        start = p @ p / 2 + V(q)
        for _ in range(steps):
            for lengths in moves:
                for kind, length in zip((outer, inner), np.multiply(lengths, t_end / steps), strict=True):
                    q, p = (q + length * p, p) if kind == "drift" else (q, p - length * gradient(q))
            worst = max(worst, abs(p @ p / 2 + V(q) - start) / start)
        assert worst == pytest.approx(error, rel=0.05)
