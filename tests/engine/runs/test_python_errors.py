"""Python functions raise errors of this package for invalid arguments before any computation."""

from __future__ import annotations

import re

import pytest

import nearharmonic as nh


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: nh.sweep("keplr", "ruth", [1.0]), "unknown system 'keplr'. Did you mean 'kepler'?"),
        (lambda: nh.sweep("kepler", "ruht", [1.0]), "unknown integrator 'ruht'. Did you mean 'ruth'?"),
        (lambda: nh.integrate("sho", ["ruth"], 0.1), "unknown integrator ['ruth']"),
        (lambda: nh.integrate(3, "ruth", 0.1), "unknown system 3"),
        (lambda: nh.sweep("sho", "ruth", []), "taus = [] is not allowed: at least one step size"),
        (lambda: nh.sweep("sho", "ruth", 0.1), "taus = 0.1 is not allowed: a list of step sizes"),
        (lambda: nh.sweep("sho", "ruth", [0.1, -1]), "taus[1] = -1 is not allowed: a finite number above 0"),
        (lambda: nh.integrate("sho", "ruth", float("nan")), "tau = nan"),
        (lambda: nh.integrate("sho", "ruth", 0), "tau = 0"),
        (lambda: nh.integrate("sho", "ruth", 1, t_end="-0"), "t_end = '-0'"),
        (lambda: nh.integrate("sho", "ruth", 1e-9), "would take 500000000000 steps"),
        (lambda: nh.integrate("sho", "ruth", 1, precision="extnded"), "Did you mean 'extended'?"),
        (lambda: nh.integrate("sho", "ruth", 1, summation="kahan"), "one of compensated, plain"),
        (lambda: nh.integrate("sho", "ruth", 1, first="kik"), "Did you mean 'kick'?"),
        (lambda: nh.integrate("relativistic_oscillator", "srkn_b11", 0.1), "quadratic kinetic energy"),
        (lambda: nh.kappa("ruth", 0), "highest = 0"),
        (lambda: nh.kappa("ruth", 10**9), "at most 1000"),
    ],
)
def test_what_makes_no_sense_is_named_with_what_is_allowed(call, words):
    with pytest.raises(nh.NearharmonicError, match=re.escape(words)):
        call()


def test_step_sizes_may_come_in_any_sequence():
    import numpy as np

    as_list = nh.sweep("sho", "ruth", [0.5, 0.25], t_end=10).max_energy_error
    for taus in ((0.5, 0.25), np.array([0.5, 0.25]), iter([0.5, 0.25]), as_list.tau):
        assert (nh.sweep("sho", "ruth", taus, t_end=10).max_energy_error == as_list).all()
