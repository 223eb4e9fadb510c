"""Compiled code is found again only for what it was compiled from: every change that matters makes other code."""

from __future__ import annotations

import importlib.metadata
import importlib.util
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

import nearharmonic as nh
from kept_loops import keep_loops
from nearharmonic.core.formulas import fingerprint
from nearharmonic.core.rules import Rules
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.kernels import kernel_of, physics_of
from nearharmonic.engine.regularised import landing_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.systems.regularisation import Regularisation, RegularisedFormulas

OSCILLATOR = nh.systems["sho"]


@pytest.fixture(scope="module")
def own_cache(tmp_path_factory):
    """A folder for the kernels of this file, which it compiles once."""
    folder = tmp_path_factory.mktemp("kernels")
    with pytest.MonkeyPatch.context() as patch:
        keep_loops(folder)
        patch.setenv("NEARHARMONIC_CACHE_DIR", str(folder))
        kernel_of.cache_clear()
        yield folder
    kernel_of.cache_clear()


def run(system, **settings):
    """The run as a process finds it that has loaded no kernel yet."""
    kernel_of.cache_clear()
    return integrate_batch(
        system, nh.integrators["ruth"], t_end=Fraction(10), steps=[50], samples=2, numerics=Numerics(**settings)
    )


def test_a_potential_that_changes_while_its_gradient_stays_gets_its_own_code(own_cache):
    """V + 3/2 has the same orbits; H0 = 1/2 becomes 2, so that relative errors become a quarter."""
    first = run(OSCILLATOR)
    before = set(own_cache.iterdir())
    raised = run(replace(OSCILLATOR, V=lambda q: OSCILLATOR.V(q) + Fraction(3, 2)))
    assert set(own_cache.iterdir()) > before
    assert first.energy[0] == 0.5
    assert raised.energy[0] == 2
    assert np.array_equal(raised.q, first.q)
    # Both energies are double-double: the ratio is rounded twice, by 2^-53 of itself.
    assert raised.max_energy_error[0] == pytest.approx(first.max_energy_error[0] / 4, rel=1e-15)


def test_kernels_with_and_without_the_energy_at_every_step_share_a_cache(own_cache):
    """Only the first knows the mean over the steps; between two samples the error of an oscillator is larger."""
    kinds = "every", "samples"
    first, second = ({energy: run(OSCILLATOR, energy=energy, look=50) for energy in kinds} for _ in range(2))
    for paths in (first, second):
        assert paths["every"].mean_energy_error[0] > 0
        assert np.isnan(paths["samples"].mean_energy_error[0])
        assert paths["every"].max_energy_error[0] > paths["samples"].max_energy_error[0] > 0


class HalfSteps(RegularisedFormulas):
    """Maps whose fictitious time runs as if each orbit were half as large."""

    def inverse_axis(self, x, *parameters):
        return 2 * super().inverse_axis(x, *parameters)


def test_systems_that_differ_in_the_time_map_alone_get_their_own_code(own_cache):
    """Steps of the fictitious time are those of physical time over the semi-major axis: half of it, half as many."""
    own = nh.systems["kepler_regularised"]
    system, other = (replace(own, regularisation=Regularisation(gravity="GM")) for _ in range(2))
    maps = other.formulas().regularised
    halved = HalfSteps(maps.regularisation, maps.gravity, maps.dimension)
    vars(other)["_formulas"] = replace(other.formulas(), regularised=halved)
    steps = {}
    for key, one in (("own", system), ("halved", other), ("own again", system)):
        landing_of.cache_clear()
        steps[key] = nh.integrate(one, "ruth", 100, t_end=20000, samples=2).steps.item()
    assert steps["own"] == steps["own again"]
    assert steps["halved"] == pytest.approx(steps["own"] / 2, abs=1)


def core_digest_of_a_fresh_process():
    """``core_digest()`` of the module loaded anew, with nothing remembered."""
    spec = importlib.util.find_spec("nearharmonic.core.native")
    fresh = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(fresh)
    return fresh.core_digest()


@pytest.mark.parametrize("compiler", ["numba", "llvmlite"])
def test_another_version_of_a_compiler_makes_other_code(monkeypatch, compiler):
    here, version = core_digest_of_a_fresh_process(), importlib.metadata.version
    assert core_digest_of_a_fresh_process() == here
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "9.9" if name == compiler else version(name))
    assert core_digest_of_a_fresh_process() != here


def test_an_energy_that_is_seen_in_doubles_alone_gets_its_own_code():
    """Of many coordinates, the energy error at every step is looked at in doubles first, by a formula of its own."""
    chain = nh.System(name="nine", V=lambda q: sum(x**2 / 2 + x**4 for x in q), q0=["1"] * 9, p0=["0"] * 9, t_end="10")
    physics = physics_of(chain)
    kept, other = (
        fingerprint(Rules(replace(physics, balanced_T=T), extended=False, compensated=True))
        for T in (physics.balanced_T, lambda p, *parameters: 2 * physics.balanced_T(p, *parameters))
    )
    assert kept != other
