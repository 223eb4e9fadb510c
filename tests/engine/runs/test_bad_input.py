"""Bad input: invalid arguments raise an error of this package with one sentence before any computation."""

from __future__ import annotations

import math
import re
from functools import partial

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.errors import NearharmonicError

FIELDS = {"name": "probe", "V": lambda q: q[0] * q[0] / 2, "q0": ("1",), "p0": ("0",), "t_end": "1"}
UNITS = dict.fromkeys(("q", "p", "t", "energy"), "1")
OBSERVED = {"function": lambda q, p: None, "unit": "1", "meaning": "nothing"}


def endless(q):
    return endless(q)


DECLARATIONS = {
    "no name": ({"name": None}, "name = None"),
    "no number": ({"V": lambda q: None}, "V returns None, expected one number: is a return missing?"),
    "array": ({"V": lambda q: np.array([q[0]])}, "V returns an object of type ndarray"),
    "complex": ({"V": lambda q: 1j}, "V returns an object of type complex"),
    "not finite": ({"V": lambda q: q[0] + float("nan")}, "V contains the number nan"),
    "too large an integer": ({"V": lambda q: q[0] * 10**400}, "larger than any double"),
    "exploding": ({"V": lambda q: q[0] ** 100000}, "power 100000, more than 1024 factors"),
    "function of math": ({"V": lambda q: math.sin(q[0])}, "nearharmonic.math"),
    "branch": ({"V": lambda q: q[0] if q[0] > 0 else -q[0]}, "must not branch"),
    "no such coordinate": ({"V": lambda q: q[1]}, "V raises IndexError: tuple index out of range: q has 1 component"),
    "endless": ({"V": endless}, "V raises RecursionError"),
    "no function": ({"V": 3}, "V = 3 is not allowed: a function"),
    "wrong gradient": ({"grad_V": lambda q: (-q[0],)}, "grad_V[0] contradicts V"),
    "short gradient": ({"grad_V": lambda q: ()}, "grad_V returns 0 components"),
    "masses of another number": ({"masses": ("1", "2")}, "masses has 2 entries"),
    "huge mass": ({"masses": ("1e999999999",)}, "masses[0] = '1e999999999'"),
    "tiny mass": ({"masses": ("1e-400",)}, "no double holds its inverse"),
    "start that is NaN": ({"q0": ("nan",)}, "q0[0] = 'nan'"),
    "huge start": ({"q0": ("1e400",)}, "q0[0] = '1e400' is larger than any double"),
    "tiny start": ({"q0": ("1e-999999999",)}, "q0[0] = '1e-999999999' is smaller"),
    "bool": ({"p0": (True,)}, "p0[0] = True"),
    "unit that is a number": ({"units": UNITS | {"q": 1}}, "units['q'] = 1 is not allowed: a string"),
    "unit of nothing": ({"units": UNITS | {"x": "m"}}, "units has 'x', and names the units of q, p, t, energy alone"),
    "parameter of two words": ({"parameters": {"a b": 1}, "V": lambda q, a: q[0]}, "parameters has 'a b'"),
    "units that are none": ({"units": None}, "units = None"),
    "parameter without a name": ({"parameters": {3: 1}, "V": lambda q, a: q[0]}, "parameters = {3: 1}"),
    "invariants in a list": ({"invariants": [1]}, "invariants = [1]"),
    "invariant that is none": ({"invariants": {"I": 3}}, "invariants['I'] = 3"),
    "invariant of a known name": ({"invariants": {"q": lambda q, p: q[0]}}, "invariants has 'q'"),
    "invariant that fails": ({"invariants": {"I": lambda q, p: 1 / 0}}, "the invariant I cannot be evaluated"),
    "invariant of nothing": ({"invariants": {"I": lambda q, p: None}}, "expected real numbers"),
    "observable that is none": ({"observables": {"x": 3}}, "a nearharmonic.Observable"),
    "observable of nothing": (
        {"observables": {"x": nh.Observable(**OBSERVED)}},
        "the observable x cannot be evaluated",
    ),
    "two numbers of coordinates": ({"q0": ("1", "2")}, "q0 has 2 components and p0 1"),
    "late end": ({"t_end": "soon"}, "t_end = 'soon'"),
    "scale of zero": ({"energy_scale": "0"}, "energy_scale = '0' is not positive"),
    "scale that is NaN": ({"energy_scale": "nan"}, "energy_scale = 'nan' is not a finite decimal number"),
    "missing unit": ({"units": {"q": "m", "p": "m"}}, "units lack 't'"),
    "infinite parameter": ({"parameters": {"k": "inf"}, "V": lambda q, k: k * q[0]}, "parameter k = 'inf'"),
    "limit": ({"surface_limit": "x"}, "surface_limit = 'x'"),
    "time_dependent": ({"time_dependent": "yes"}, "time_dependent = 'yes'"),
    "no time": ({"time_dependent": True}, "V takes (q), and is called as V(q, t)"),
}


@pytest.mark.parametrize(("given", "words"), DECLARATIONS.values(), ids=DECLARATIONS)
def test_a_system_that_makes_no_sense_is_refused(given, words):
    """An hour of steps: what is refused only after its work does not end."""
    with pytest.raises(NearharmonicError, match=re.escape(words)) as caught:
        nh.integrate(nh.System(**(FIELDS | given)), "leapfrog", 1e-9)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


VALUES = {
    "huge integer": ({"q0": [10**1000]}, "... (1001 characters) is not allowed: a finite number"),
    "integer that Python does not write": ({"q0": [10**5000]}, "q0[0] = a number of type int is not allowed"),
    "bytes": ({"q0": b"1"}, "q0 = b'1'"),
    "huge parameter": ({"parameters": {"GM": 10**400}}, "unknown parameter of sho 'GM'"),
    "complex": ({"p0": np.array([1j])}, "p0 = array([0.+1.j])"),
    "late end": ({"t_end": 1e308}, "t_end = 1.000e+308 would take"),
    "list of steps": ({"tau": [0.1]}, "tau = [0.1]"),
    "array of steps": ({"tau": np.array([0.1])}, "tau = array([0.1])"),
}
CALLS = {
    "integrate": partial(nh.integrate, "sho", "leapfrog"),
    "ensemble": partial(nh.ensemble, "sho", "leapfrog"),
    "problem": lambda tau, t_end, **given: nh.problem("sho", "leapfrog", t_end=t_end)(tau, **given),
}


@pytest.mark.parametrize(("given", "words"), VALUES.values(), ids=VALUES)
@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_values_that_make_no_sense_are_refused_by_every_call(call, given, words):
    with pytest.raises(NearharmonicError, match=re.escape(words)) as caught:
        call(**({"tau": 0.1, "t_end": 1} | given))
    assert len(str(caught.value)) < 700


def test_a_run_is_no_initial_value():
    run = nh.integrate("sho", "leapfrog", 0.1, t_end=1)
    with pytest.raises(NearharmonicError, match=r"q0 = 'a Dataset' is not allowed: .* a run is continued by start="):
        nh.integrate("sho", "leapfrog", 0.1, q0=run)


def test_only_one_trajectory_of_its_own_system_can_be_continued():
    many = nh.ensemble("sho", "leapfrog", 0.1, t_end=1)
    swept = nh.sweep("sho", "leapfrog", [0.1], t_end=1, t=[0.5])
    run = nh.integrate("sho", "leapfrog", 0.1, t_end=1)
    for start in (many, swept, run.isel(sample=-1), run.isel(sample=slice(0, 0)), run.drop_vars("status")):
        with pytest.raises(NearharmonicError, match=r"a Dataset that nearharmonic\.integrate returned"):
            nh.integrate("sho", "leapfrog", 0.1, start=start)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: nh.sweep("keplr", "ruth", [1.0]), "unknown system 'keplr'. Did you mean 'kepler'?"),
        (lambda: nh.sweep("kepler", "ruht", [1.0]), "unknown integrator 'ruht'. Did you mean 'ruth'?"),
        (lambda: nh.sweep("sho", "a.toml", [1.0]), "a.toml: no such file. An integrator of your own is a Python file"),
        (lambda: nh.sweep("sho", "verlt", [1.0]), "unknown integrator 'verlt'. Did you mean 'verlet'?"),
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
        (lambda: nh.sweep("sho", "ruth"), "taus = None is not allowed: a list of step sizes, or tau_per_stage"),
        (
            lambda: nh.sweep("sho", "ruth", [1], tau_per_stage=[1]),
            "taus = [1] is not allowed: a list of step sizes, or",
        ),
        (lambda: nh.sweep("sho", "ruth", tau_per_stage=[0]), "tau_per_stage[0] = 0 is not allowed: a finite number"),
        (lambda: nh.sweep("sho", "ruth", tau_per_stage=[1e-12]), "3 * tau_per_stage[0] = 3e-12"),
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
    as_list = nh.sweep("sho", "ruth", [0.5, 0.25], t_end=10).max_energy_error
    for taus in ((0.5, 0.25), np.array([0.5, 0.25]), iter([0.5, 0.25]), as_list.tau):
        assert (nh.sweep("sho", "ruth", taus, t_end=10).max_energy_error == as_list).all()


def test_step_sizes_per_stage_are_multiplied_by_the_stages():
    """Ruth's method has three kicks that no other step shares, and BAB's8o7H eight."""
    for name, stages in (("ruth", 3), ("babps8o7h", 8)):
        found = nh.sweep("sho", name, tau_per_stage=[0.125, "0.0625"], t_end=10)
        assert found.identical(nh.sweep("sho", name, [stages / 8, stages / 16], t_end=10))


# --- masked, unordered ------------------------------------------------------------------------------------------------

#: Tens of millions of steps: a value that is refused only after the work does not end.
TAU = 1e-6
MASKED = np.ma.array([0.3, 0.1], mask=[True, False])

one = partial(nh.integrate, "henon_heiles", "leapfrog", TAU)
many = partial(nh.ensemble, "henon_heiles", "leapfrog", TAU)
sweep = partial(nh.sweep, "henon_heiles", "leapfrog")
orbit = partial(nh.integrate, "kepler", "leapfrog", TAU)
orbits = partial(nh.ensemble, "kepler", "leapfrog", TAU)
prepared = partial(nh.problem("henon_heiles", "leapfrog"), TAU)

READERS = {
    "q0": lambda x: one(q0=x),
    "p0": lambda x: one(p0=x),
    "q0 of a prepared run": lambda x: prepared(q0=x),
    "q0 of a sweep": lambda x: sweep([TAU], q0=x),
    "q0 of an ensemble": lambda x: many(q0=x),
    "a row of an ensemble": lambda x: many(q0=[[0.3, 0.1], x]),
    "a parameter": lambda x: orbit(parameters={"GM": x}),
    "a parameter of an ensemble": lambda x: orbits(parameters={"GM": x}),
    "t": lambda x: one(t=x),
    "t of a sweep": lambda x: sweep([TAU], t=x),
    "t of an ensemble": lambda x: many(t=x),
    "taus": sweep,
    "start of a system": lambda x: nh.System(name="s", V=lambda q: q[0] * q[1], q0=x, p0=("0", "0"), t_end="1"),
    "masses": lambda x: nh.System(name="s", V=lambda q: q[0], q0=("0", "0"), p0=("0", "0"), t_end="1", masses=x),
    "frequencies": lambda x: nh.System(
        name="s", V=lambda q: q[0], q0=("0", "0"), p0=("0", "0"), t_end="1", frequencies=x
    ),
}
UNORDERED = {
    "bytes": b"ab", "bytearray": bytearray(b"ab"), "memoryview": memoryview(b"ab"), "mapping": {0.1: 1, 0.2: 1},
    "keys": {0.1: 1, 0.2: 1}.keys(), "set": {0.1, 0.2},
}  # fmt: skip


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_a_masked_entry_is_no_number(read):
    with pytest.raises(NearharmonicError, match="masked"):
        read(MASKED)


@pytest.mark.parametrize("value", UNORDERED.values(), ids=UNORDERED)
@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_bytes_mappings_and_sets_are_no_lists(read, value):
    with pytest.raises(NearharmonicError):
        read(value)


@pytest.mark.parametrize("call", [lambda: one(t_end=MASKED), lambda: nh.System(
    name="s", V=lambda q: q[0], q0=("0",), p0=("0",), t_end=MASKED)])  # fmt: skip
def test_a_message_stays_on_one_line(call):
    with pytest.raises(NearharmonicError) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_a_mask_that_hides_nothing_is_accepted():
    start, times = np.ma.array([0.3, 0.1], mask=False), np.ma.array([0.5, 1.0])
    masked = nh.integrate("henon_heiles", "ruth", 0.1, t_end=1, q0=start, t=times)
    plain = nh.integrate("henon_heiles", "ruth", 0.1, t_end=1, q0=start.data, t=times.data)
    assert np.array_equal(masked.q, plain.q)
    assert np.array_equal(nh.sweep("sho", "ruth", times, t_end=2).steps, [4, 2])
    given = nh.ensemble("kepler", "ruth", 100, t_end=200, parameters={"GM": np.ma.array([1.0, 2.0])})
    assert given.parameter_GM.values.tolist() == [1, 2]
