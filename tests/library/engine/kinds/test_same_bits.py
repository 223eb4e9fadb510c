"""Runs of every kind have the same bits whatever function is called, beside other runs, and in parts."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.engine import ensemble
from support.methods.numba_potentials import springs
from support.methods.own_systems import driven, mode, sites
from support.oracles.oscillator_steps import CHAIN

PLAIN, EXTENDED, EXACT = {"summation": "plain"}, {"precision": "extended"}, {"split": "exact_oscillator"}
RNG = np.random.default_rng(5)

ONE, THREE = {"q0": [[1.0], [0.5]], "p0": [[0.0], [0.2]]}, {"q0": [[0.1, 0.2, 0.3]] * 3}
STARTS = {"q0": RNG.uniform(-0.3, 0.3, (5, 2)), "p0": RNG.uniform(-0.3, 0.3, (5, 2))}
TEXTS = {"q0": [["0", "0.1"], ["0.1", "1/7"]], "p0": [["0.1", "1/7"], ["0", "0.4"]]}
PLANETS = {"q0": 60 + 10 * STARTS["q0"], "parameters": {"GM": 1.7 + 0.1 * STARTS["q0"][:, 0]}}
#: Members have steps of their own.
BOUND = {"q0": [[60.0, 3.0], [100.0, 0.0], [40.0, 10.0]], "p0": [[0.0, 0.15], [0.0, 0.05], [-0.05, 0.17]]}
#: System, method, step size, initial values and parameters of members, settings. Most step sizes are short in binary.
KINDS = {
    **{
        f"henon_heiles {method} {how}": ("henon_heiles", method, 0.125, starts, how)
        for how in ({}, PLAIN, EXTENDED) for method, starts in (("aba864", {"p0": TEXTS["p0"]}), ("babps9o7h", STARTS))
    },
    **{f"kepler {how}": ("kepler", "babps9o7h", 100.0, PLANETS, how) for how in ({}, PLAIN, EXTENDED)},
    **{
        f"{system} {split} {how}": (system, "aba864", 0.25, starts, split | how)
        for system, split, starts in (("sho", {}, ONE), ("sho", EXACT, ONE))
        for how in ({}, PLAIN, EXTENDED)
    },
    f"henon_heiles {EXACT} {{}}": ("henon_heiles", "aba864", 0.25, STARTS, EXACT),
    **{
        f"{method} {how}": ("henon_heiles", method, 0.125, TEXTS, how)
        for method, how in (("chin_4a", {}), ("rowlands", PLAIN))
    },
    "regularised": ("kepler_regularised", "babs7o7h", 256.0, BOUND, {}),
}  # fmt: skip
#: More methods with a modified potential, systems of other kinds, and oscillators solved exactly; long in other
#: precisions, whose code all kinds share.
LONGER = {
    "ten sites": (sites(10), "aba864", 0.25, {"q0": [mode(10, k) for k in (1, 2, 5)]}, {}),
    **{
        f"henon_heiles {EXACT} {how}": ("henon_heiles", "aba864", 0.25, STARTS, EXACT | how)
        for how in (PLAIN, EXTENDED)
    },
    **{
        f"{method} {how}": ("henon_heiles", method, 0.125, TEXTS, how)
        for method in nh.modified_integrators for how in ({}, PLAIN, EXTENDED)
        if f"{method} {how}" not in KINDS
    },
    "processed, with parameters": ("kepler", "rowlands", 16.0, PLANETS, {}),
    **{
        f"driven {how}": (driven(), "aba864", 0.25, ONE | {"parameters": {"F": [0.5, 1.5], "w": [0.7, 0.3]}}, how)
        for how in ({}, EXTENDED)
    },
    "loops": (sites(70), "aba864", 0.25, {"q0": [mode(70, k) for k in (1, 2, 5)]}, {}),
    "numba": (springs(), "ruth", 0.125, {"q0": RNG.uniform(-1, 1, (5, 1)), "parameters": {"k": np.arange(1, 6)}}, {}),
    "regularised, plain sums": ("kepler_regularised", "babs7o7h", 256.0, BOUND, PLAIN),
    **{
        f"{method} {how} {len(starts['q0'])}": (system, method, 0.25, starts, EXACT | how)
        for system, method, starts in (
            ("sho", "babps9o7h", ONE), ("henon_heiles", "babps9o7h", STARTS), (CHAIN.system, "aba864", THREE),
            (CHAIN.system, "babps9o7h", THREE),
        )
        for how in ({}, PLAIN, EXTENDED)
    },
}  # fmt: skip


def marks_of(name):
    if name in KINDS:
        return []
    return [pytest.mark.slow if LONGER[name][-1].items() <= EXACT.items() else pytest.mark.long]


def every(*left_out):
    kinds = [
        pytest.param(*kind, id=name, marks=marks_of(name))
        for name, kind in (KINDS | LONGER).items()
        if kind[0] not in left_out
    ]
    return pytest.mark.parametrize(("system", "method", "tau", "members", "how"), kinds)


def assert_same(found, expected, names):
    for name in names:
        np.testing.assert_array_equal(found[name], expected[name], name)


@every()
def test_every_call_gives_the_bits_of_integrate(system, method, tau, members, how, monkeypatch):
    """An ensemble in blocks, and a prepared problem, which is called again and again."""
    monkeypatch.setattr(ensemble, "BLOCK", 2)
    how = how | {"t_end": 40 * tau, "samples": 3}
    many = nh.ensemble(system, method, tau, threads=1, **members, **how)
    problem = pickle.loads(pickle.dumps(nh.problem(system, method, **how)))
    for i in range(many.sizes["member"]):
        own = {key: {k: v[i] for k, v in x.items()} if key == "parameters" else x[i] for key, x in members.items()}
        problem(2 * tau)  # another step size, and the system's own start
        alone, found = nh.integrate(system, method, tau, **own, **how), problem(tau, **own)
        found = found if i else pickle.loads(pickle.dumps(found))
        names = ("q", "p", "energy_error", "max_energy_error", "initial_energy", "status")
        assert_same(many.isel(member=i), alone, names)
        assert found.to_dataset().drop_attrs().identical(alone.drop_attrs())
        names = ("q", "p", "t", "tau", "steps", "status", "max_energy_error", "evaluations")
        assert_same({name: getattr(found, name) for name in names}, alone, names)
    assert problem(tau).to_dataset().drop_attrs().identical(nh.integrate(system, method, tau, **how).drop_attrs())


@pytest.mark.slow
@every()
def test_neither_lanes_nor_samples_change_the_bits_of_a_run(system, method, tau, members, how):
    """The energies of processed states are measured at the samples; each sample of a regularised run takes forces."""
    how = how | {"t_end": 40 * tau}
    taus, times = [tau * factor for factor in (1, 0.5, 2, 0.25, 0.7)], [20.3 * tau, 40 * tau]
    swept, swept_at = nh.sweep(system, method, taus, **how), nh.sweep(system, method, taus, t=times, **how)
    for i, one in enumerate(taus):
        run, few = (nh.integrate(system, method, one, samples=n, **how) for n in (1000, 2))
        found = nh.integrate(system, method, one, t=times, **how)
        names = ("q", "p", "energy_error")
        assert_same(swept_at.isel(tau=i), found, (*names, "max_energy_error", "evaluations"))
        for other in (few, found):
            assert_same(other.isel(sample=-1), run.isel(sample=-1), (*names, "t", "steps"))
        processed = nh.integrators[method].processed
        assert_same(swept.isel(tau=i), run if processed else few, ("max_energy_error", "evaluations", "status"))
        if processed:
            continue
        assert few.max_energy_error == run.max_energy_error
        # The mean is summed in other blocks: a thousand roundings of its sum.
        assert few.mean_energy_error.item() == pytest.approx(run.mean_energy_error.item(), rel=1e-13)
        if system != "kepler_regularised":  # else there is a sample at each step, in doubles for many coordinates
            close, errors = 1e-6 if run.sizes["component"] > 8 else 1e-13, np.abs(run.energy_error.values[1:])
            assert run.max_energy_error.item() == pytest.approx(errors.max(), rel=close, abs=0)
            assert run.mean_energy_error.item() == pytest.approx(errors.mean(), rel=close, abs=0)


@every("kepler_regularised")
def test_a_run_in_two_parts_has_the_bits_of_one(system, method, tau, members, how):
    """The last step of a regularised run is shortened."""
    whole = nh.integrate(system, method, tau, t_end=40 * tau, samples=2, **how)
    half = nh.integrate(system, method, tau, t_end=20 * tau, samples=2, **how)
    rest = nh.integrate(system, method, tau, t_end=20 * tau, samples=333, start=half, **how)
    names = ["q", "p", "energy_error", *(name for name in ("q_low", "p_low") if name in whole)]
    assert_same(rest.isel(sample=-1), whole.isel(sample=-1), names)
    assert_same(rest.isel(sample=0), half.isel(sample=-1), ("q", "p"))
    # Relative to the energy of the first start, which is a double-double; that of many coordinates is a double.
    close = 1e-6 if whole.sizes["component"] > 8 else 1e-12
    assert rest.energy_error[0].item() == pytest.approx(half.energy_error[-1].item(), rel=close, abs=0)
    assert (rest.t[0], rest.t[-1]) == (half.t[-1], whole.t[-1])
    if not nh.integrators[method].processed:
        assert max(half.max_energy_error, rest.max_energy_error) == whole.max_energy_error


@pytest.mark.parametrize(
    "kind",
    [
        "kepler {}",
        f"henon_heiles {EXACT} {{}}",
        *(
            pytest.param(kind, marks=pytest.mark.slow)
            for kind in ("ten sites", *(f"henon_heiles {EXACT} {how}" for how in (PLAIN, EXTENDED)))
        ),
    ],
)
def test_the_energy_is_measured_when_it_was_asked_for(kind):
    """Far above rounding, that of ten sites is measured in doubles at every step."""
    system, method, tau, _, how = (KINDS | LONGER)[kind]
    each, few, none = (
        nh.integrate(system, method, tau, t_end=80 * tau, samples=9, energy=energy, **how)
        for energy in ("every", "samples", "none")
    )
    assert_same(each, few, ("q", "p", "energy_error")[: 2 if kind == "ten sites" else 3])
    assert_same(each, none, ("q", "p"))
    assert few.max_energy_error == np.abs(few.energy_error).max() < each.max_energy_error
    assert few.mean_energy_error.item() == pytest.approx(np.abs(few.energy_error[1:]).mean().item(), rel=1e-15)
    assert np.isnan(none.energy_error).all()
    assert np.isnan([none.max_energy_error, none.mean_energy_error, none.initial_energy]).all()
