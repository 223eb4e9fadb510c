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
