"""Bad input: invalid arguments raise an error of this package with one sentence before any computation.

Numbers and arrays of every kind have the same exact values in all public functions, or are refused.
"""

import json
import re
from decimal import Decimal
from fractions import Fraction

import gmpy2
import mpmath
import numpy as np
import pandas as pd
import pytest
import xarray as xr

import nearharmonic as nh
from nearharmonic.engine.settings import checked_t_end, checked_tau, steps_of
from nearharmonic.errors import NearharmonicError
from support.bad_input import check_message
from support.results.stated_numbers import ROOT

RUNS_PAGE = (ROOT / "docs/how_to/runs.md").read_text(encoding="utf-8")

FIELDS = {"name": "probe", "V": lambda q: q[0] * q[0] / 2, "q0": ("1",), "p0": ("0",), "t_end": "1"}
UNITS = dict.fromkeys(("q", "p", "t", "energy"), "1")
OBSERVED = {"function": lambda q, p: None, "unit": "1", "meaning": "nothing"}


def endless(q):
    return endless(q)


DECLARATIONS = {
    "array": ({"V": lambda q: np.array([q[0]])}, "V returns an object of type ndarray"),
    "complex": ({"V": lambda q: 1j}, "V returns an object of type complex"),
    "not finite": ({"V": lambda q: q[0] + float("nan")}, "V contains the number nan"),
    "too large an integer": ({"V": lambda q: q[0] * 10**400}, "larger than any double"),
    "endless": ({"V": endless}, "V raises RecursionError"),
    "short gradient": ({"grad_V": lambda q: ()}, "grad_V returns 0 components"),
    "tiny mass": ({"masses": ("1e-400",)}, "no double holds its inverse"),
    "huge start": ({"q0": ("1e400",)}, "q0[0] = '1e400' is larger than any double"),
    "tiny start": ({"q0": ("1e-999999999",)}, "q0[0] = '1e-999999999' is smaller"),
    "unit of nothing": ({"units": UNITS | {"x": "m"}}, "units has 'x', and names the units of q, p, t, energy alone"),
    "invariant that fails": ({"invariants": {"I": lambda q, p: 1 / 0}}, "the invariant I cannot be evaluated"),
    "invariant of nothing": ({"invariants": {"I": lambda q, p: None}}, "expected real numbers"),
    "observable of nothing": (
        {"observables": {"x": nh.Observable(**OBSERVED)}},
        "the observable x cannot be evaluated",
    ),
    "no time": ({"time_dependent": True}, "V takes (q), and is called as V(q, t)"),
}


@pytest.mark.parametrize(("given", "words"), DECLARATIONS.values(), ids=DECLARATIONS)
def test_a_system_that_makes_no_sense_is_refused(given, words):
    """An hour of steps: what is refused only after its work does not end."""
    with pytest.raises(NearharmonicError, match=re.escape(words)) as caught:
        nh.integrate(nh.System(**(FIELDS | given)), "leapfrog", 1e-9)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


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
        (lambda: nh.sweep("sho", "a.toml", [1.0]), "a.toml: no such file. An integrator of your own is a Python file"),
        (lambda: nh.sweep("sho", "ruth", [0.1, -1]), "taus[1] = -1 is not allowed: a finite number above 0"),
        (lambda: nh.integrate("sho", "ruth", 1e-9), "would take 500000000000 steps"),
        (lambda: nh.integrate("sho", "ruth", 0.1, t_end=1e308), "t_end = 1.000e+308 would take"),
        (lambda: nh.integrate("sho", "ruth", 1, precision="extnded"), "Did you mean 'extended'?"),
        (
            lambda: nh.integrate("sho", "ruth", 1, q0=[10**1000]),
            "... (1001 characters) is not allowed: a finite number",
        ),
        (lambda: nh.integrate("sho", "ruth", 1, q0=[10**5000]), "q0[0] = a number of type int is not allowed"),
        (
            lambda: nh.sweep("sho", "ruth", [1], tau_per_stage=[1]),
            "taus = [1] is not allowed: a list of step sizes, or",
        ),
        (lambda: nh.sweep("sho", "ruth", tau_per_stage=[1e-12]), "3 * tau_per_stage[0] = 3e-12"),
        (lambda: nh.integrate("relativistic_oscillator", "srkn_b11", 0.1), "quadratic kinetic energy"),
        (lambda: nh.kappa("ruth", 10**9), "at most 1000"),
        (lambda: nh.integrate("sho", "ruth", 0.1, t=[1, 0.5]), "t[1] = 0.5 is not allowed: a time not earlier"),
        (lambda: nh.ensemble("sho", "ruth", 0.1, q0=np.zeros(9), p0=np.zeros((5, 1))), "array of shape (9,)"),
        (
            lambda: nh.ensemble("sho", "ruth", 0.1, q0=np.zeros((9, 1)), p0=np.zeros((5, 1))),
            "p0 = '5 rows' is not allowed: as many as q0, 9",
        ),
        (lambda: nh.ensemble("sho", "ruth", 1e-5, samples=10**7, q0=np.zeros((10**5, 1))), "a call keeps 8e+09"),
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
        found = nh.sweep("sho", name, tau_per_stage=[0.125, "0.0625"], t_end=6)
        assert found.identical(nh.sweep("sho", name, [stages / 8, stages / 16], t_end=6))


# --- arrays: all arguments of all public functions --------------------------------------------------------------------


def own(**members):
    """Numbers that a declaration of two coordinates holds."""
    two = {"q0": ("1", "2"), "p0": ("0", "0")}
    made = nh.System(**({"name": "own", "V": lambda q, *k: q[0] * q[1], "t_end": "1"} | two | members))
    return [
        *made.start(Fraction),
        made.T((1.0, 2.0)),
        [*map(str, () if made.frequencies is None else made.frequencies)],
    ]


#: Functions with a dimension of members.
MEMBERS = ("ensemble", "tangent", "gradient")
#: Calls with an array, by function and argument.
ARRAYS = {
    ("integrate", "q0"): lambda x: nh.integrate("henon_heiles", "ruth", 0.5, q0=x, t_end=1),
    ("integrate", "p0"): lambda x: nh.integrate("henon_heiles", "ruth", 0.5, p0=x, t_end=1),
    ("integrate", "parameters"): lambda x: nh.integrate("kepler", "ruth", 10, parameters={"GM": x}, t_end=20),
    ("integrate", "t"): lambda x: nh.integrate("henon_heiles", "ruth", 0.5, t=x, t_end=10),
    ("sweep", "taus"): lambda x: nh.sweep("henon_heiles", "ruth", x, t_end=60),
    ("sweep", "tau_per_stage"): lambda x: nh.sweep("henon_heiles", "ruth", tau_per_stage=x, t_end=60),
    ("sweep", "q0"): lambda x: nh.sweep("henon_heiles", "ruth", [0.5], q0=x, t_end=1),
    ("sweep", "p0"): lambda x: nh.sweep("henon_heiles", "ruth", [0.5], p0=x, t_end=1),
    ("sweep", "parameters"): lambda x: nh.sweep("kepler", "ruth", [10], parameters={"GM": x}, t_end=20),
    ("sweep", "t"): lambda x: nh.sweep("henon_heiles", "ruth", [0.5], t=x, t_end=10),
    ("ensemble", "q0"): lambda x: nh.ensemble("henon_heiles", "ruth", 0.5, q0=x, t_end=1),
    ("ensemble", "p0"): lambda x: nh.ensemble("henon_heiles", "ruth", 0.5, p0=x, t_end=1),
    ("ensemble", "parameters"): lambda x: nh.ensemble("kepler", "ruth", 10, parameters={"GM": x}, t_end=20),
    ("ensemble", "t"): lambda x: nh.ensemble("henon_heiles", "ruth", 0.5, t=x, t_end=10),
    ("problem", "q0"): lambda x: nh.problem("henon_heiles", "ruth", t_end=1)(0.5, q0=x).to_dataset(),
    ("problem", "p0"): lambda x: nh.problem("henon_heiles", "ruth", t_end=1)(0.5, p0=x).to_dataset(),
    ("problem", "parameters"): lambda x: nh.problem("kepler", "ruth", t_end=20)(10, parameters={"GM": x}).to_dataset(),
    ("tangent", "q0"): lambda x: nh.tangent("henon_heiles", "ruth", 0.5, q0=x, t_end=1),
    ("tangent", "p0"): lambda x: nh.tangent("henon_heiles", "ruth", 0.5, p0=x, t_end=1),
    ("tangent", "parameters"): lambda x: nh.tangent("kepler", "ruth", 10, parameters={"GM": x}, t_end=20),
    ("tangent", "deviations"): lambda x: nh.tangent("henon_heiles", "ruth", 0.5, deviations=x, t_end=1),
    ("gradient", "q0"): lambda x: nh.gradient("henon_heiles", "ruth", 0.5, first_coordinate, q0=x, t_end=1),
    ("gradient", "p0"): lambda x: nh.gradient("henon_heiles", "ruth", 0.5, first_coordinate, p0=x, t_end=1),
    ("gradient", "parameters"): lambda x: nh.gradient(
        "kepler", "ruth", 10, first_coordinate, parameters={"GM": x}, t_end=20
    ),
    ("section", "starts"): lambda x: nh.section("henon_heiles", "ruth", 0.5, surface=0, starts=x, t_end=1),
    ("section", "parameters"): lambda x: nh.section(
        "kepler", "ruth", 10, surface=0, parameters={"GM": x}, t_end=20
    ),
    ("System", "q0"): lambda x: own(q0=x),
    ("System", "p0"): lambda x: own(p0=x),
    ("System", "masses"): lambda x: own(masses=x),
    ("System", "frequencies"): lambda x: own(frequencies=x),
}  # fmt: skip
#: Calls that compile or search: what is refused is refused before.
REFUSING = {
    ("stepper", "parameters"): lambda x: nh.stepper("kepler", "ruth", parameters={"GM": x}),
    ("recommend", "q0"): lambda x: nh.recommend("henon_heiles", 1e-3, q0=x),
    ("recommend", "p0"): lambda x: nh.recommend("henon_heiles", 1e-3, p0=x),
    ("tailor", "starts"): lambda x: nh.tailor("henon_heiles", starts=x),
    ("tailor", "window"): lambda x: nh.tailor("henon_heiles", window=x),
}


def first_coordinate(q, p):
    return q[0]


class Metres:
    """A number or an array with a unit, as other libraries make them."""

    units = "metre"

    def __init__(self, magnitude):
        self.magnitude = magnitude

    def __array__(self, *_, **__):
        return np.asarray(self.magnitude)

    def __float__(self):
        return float(self.magnitude)

    def __repr__(self):
        return f"{self.magnitude} metre"


#: Arrays that are no numbers in the system's units, made from a list of doubles.
ODD = {
    "differences of times": lambda x: (4 * np.array(x)).astype("m8[ns]"),
    "list of such": lambda x: [np.timedelta64(1, "s")] * len(x),
    "dates": lambda x: (4 * np.array(x)).astype("M8[D]"),
    "truth": lambda x: np.array(x) > 0,
    "list of truth": lambda x: [True] * len(x),
    "complex": lambda x: np.array(x) + 0j,
    "list of complex": lambda x: [complex(y) for y in x],
    "masked": lambda x: np.ma.array(x, mask=[True, *[False] * (len(x) - 1)]),
    "word": lambda x: "ab",
    "words": lambda x: ["a"] * len(x),
    "array of words": lambda x: np.array(["a"] * len(x)),
    "bytes": lambda x: bytes(len(x)),
    "bytearray": lambda x: bytearray(len(x)),
    "memoryview": lambda x: memoryview(bytes(len(x))),
    "array of bytes": lambda x: np.array([b"1"] * len(x)),
    "mapping": dict.fromkeys,
    "keys": lambda x: dict.fromkeys(x).keys(),
    "set": set,
    "nothing": lambda x: [None] * len(x),
    "array of nothing": lambda x: np.array([None] * len(x)),
    "NaN": lambda x: [*x[1:], float("nan")],
    "array of NaN": lambda x: np.array([*x[1:], np.nan]),
    "infinite": lambda x: [*x[1:], float("inf")],
    "larger than doubles": lambda x: [*x[1:], 10**400],
    "with a unit": Metres,
    "list with units": lambda x: [*map(Metres, x)],
    "fields": lambda x: np.array([tuple(x)], [(name, float) for name in "abcd"[: len(x)]]),
    "ragged": lambda x: [x, [*x, 1.0]],
    "three levels": lambda x: [[x]],
    "three dimensions": lambda x: np.array([[x]]),
    "object": lambda x: object(),
    "function": lambda x: first_coordinate,
    "empty": lambda x: [],
    "empty array": lambda x: np.zeros(0),
    "no rows": lambda x: np.zeros((0, len(x))),
    "empty row": lambda x: [[]],
}
#: Arrays of the same numbers.
KEPT = {
    "tuple": tuple, "array": np.array, "single": np.float32, "long": np.longdouble,
    "strided": lambda x: np.repeat(x, 2)[::2], "text": lambda x: [*map(str, x)],
    "array of text": lambda x: np.array([*map(str, x)]), "fractions": lambda x: [*map(Fraction, x)],
    "decimals": lambda x: [*map(Decimal, x)], "array of objects": lambda x: np.array([*map(Fraction, x)]),
    "mpf": lambda x: [*map(mpmath.mpf, x)], "mpfr": lambda x: np.array([*map(gmpy2.mpfr, x)]),
    "mask of nothing": lambda x: np.ma.array(x, mask=False),
    "labelled": lambda x: xr.DataArray(x, attrs={"units": "m"}), "series": pd.Series,
}  # fmt: skip


def plain(function, argument):
    """Valid numbers: as many as a row has, or one for a parameter of all runs."""
    if argument == "parameters" and function not in MEMBERS:
        return [0.25]
    return [0.25, 0.5, 0.75, 1.0] if argument in ("deviations", "starts") else [0.25, 0.5]


@pytest.mark.parametrize("odd", ODD.values(), ids=ODD)
def test_no_function_takes_an_odd_array_for_numbers(odd):
    for key, call in {**ARRAYS, **REFUSING}.items():
        value = odd(plain(*key))
        with pytest.raises(NearharmonicError) as caught:
            pytest.fail(f"{key}: {call(value)}")
        check_message(str(caught.value))


#: A section compiles its step.
KEYS = [pytest.param(key, marks=[pytest.mark.slow] * (key[0] == "section")) for key in ARRAYS]


@pytest.mark.parametrize("key", [one for one in KEYS if one.values[0][1] != "frequencies"], ids="-".join)
def test_arrays_of_every_kind_are_the_same_numbers(key):
    call, given = ARRAYS[key], plain(*key)
    expected = call(given)
    for kind, convert in KEPT.items():
        if (key[0], kind) == ("System", "labelled"):  # whose entries are arrays
            continue
        found = call(convert(given))
        assert found.equals(expected) if isinstance(found, xr.Dataset) else found == expected, kind


SHAPES = [
    (), (1,), (2,), (3,), (4,), (1, 1), (1, 2), (2, 1), (2, 2), (3, 2), (2, 3), (1, 4), (2, 4), (5, 4), (1, 1, 2),
    (0,), (0, 2), (0, 4), (2, 0),
]  # fmt: skip
SIZES = {"d": {2}, "2 d": {4}, "k": {1, 2, 3, 4}, "1": {1}, "n": set(range(1, 9)), "M": set(range(1, 9))}


def allowed_shapes(function, argument):
    """Shapes for two coordinates that the table of docs/how_to/runs.md allows, as sets of sizes."""
    (cells,) = [
        line.strip("|").split("|")
        for line in RUNS_PAGE.splitlines()
        if line.startswith("|") and f"`{argument}`" in line.split("|")[1] and f"`{function}`" in line.split("|")[2]
    ]
    return [
        [SIZES[size.strip()] for size in text.split(",") if size.strip()] for text in re.findall(r"\((.*?)\)", cells[1])
    ]


@pytest.mark.parametrize("key", KEYS, ids="-".join)
def test_shapes_are_those_of_the_page(key):
    """Numbers ascend, as times do, and masses are a diagonal matrix."""
    allowed, fits = allowed_shapes(*key), []
    for shape in SHAPES:
        values = np.eye(2) / 2 if shape == (2, 2) else np.arange(1, np.prod(shape) + 1).reshape(shape) / 16
        if key[1] == "frequencies":
            values = values.astype(str)
        try:
            ARRAYS[key](values)
        except NearharmonicError:
            continue
        fits.append(shape)
    expected = [x for x in SHAPES if any(len(x) == len(y) and all(map(set.__contains__, y, x)) for y in allowed)]
    assert fits == expected


#: 96 and 61 binary digits, of which a double has 53.
LONG, LONGER = 2**60 + 1, 3**60
EXACT = {
    "int64": (np.int64(LONG), Fraction(LONG)),
    "longdouble": (np.longdouble(LONG) / np.longdouble(2**60), Fraction(LONG, 2**60)),
    "mpf": (mpmath.ldexp(mpmath.mpf(LONGER, prec=96), -90), Fraction(LONGER, 2**90)),
    "mpfr": (gmpy2.mpfr(gmpy2.mpq(LONGER, 2**90), 96), Fraction(LONGER, 2**90)),
    "text": ("1.0000000000000000000000000000000000000001", 1 + Fraction(1, 10**40)),
    "array of text": (np.array("1.0000000000000000000000000000000000000001"), 1 + Fraction(1, 10**40)),
}


@pytest.mark.filterwarnings("ignore:energy='none' checks nothing")  # of a step of 2^60
@pytest.mark.parametrize(("value", "expected"), EXACT.values(), ids=EXACT)
def test_digits_below_a_double_are_kept_everywhere(value, expected):
    """A pair of doubles holds 106 binary digits: a decimal of 40 places is off by 2^-106 at most."""
    within = Fraction(1, 2**106) * abs(expected)
    scalar = value.item() if isinstance(value, np.ndarray) else value
    for q0 in (value, np.array([value]), [scalar]):
        run = nh.integrate("sho", "ruth", 1, t_end=1, q0=q0, precision="extended")
        assert abs(Fraction(run.q.values[0, 0]) + Fraction(run.q_low.values[0, 0]) - expected) <= within
    run = nh.integrate("kepler", "ruth", 1, t_end=1, parameters={"GM": value})
    assert Fraction(json.loads(run.parameters)["GM"]) == expected
    run = nh.integrate("sho", "ruth", scalar, t_end=scalar, energy="none")
    assert Fraction(run.t_end) == expected
    assert nh.problem("sho", "ruth", t_end=scalar, energy="none").t_end == run.t_end
    made = nh.System(name="own", V=lambda q: q[0], q0=[scalar], p0=["0"], t_end="1", masses=[scalar])
    assert Fraction(made.q0[0]) == expected
    assert made.T((mpmath.mpf(1),)) == 1 / (2 * expected)


# --- The checks that functions and configs share: what passes, and in which words the rest is refused


@pytest.mark.parametrize("value", [0.25, "0.25", "2.5e-1", np.float64(0.25), np.float32(0.25), Decimal("0.25")])
def test_a_positive_number_passes_in_any_guise(value):
    assert checked_tau(value) == 0.25
    assert checked_t_end(value) == "0.25"


def test_t_end_keeps_all_its_digits():
    assert checked_t_end("87660.123456789012345678901") == "87660.123456789012345678901"


@pytest.mark.parametrize(
    ("t_end", "tau", "steps"),
    [("500", 0.25, 2000), ("500", 0.3, 1667), ("1", 3.0, 1), ("500", 400.0, 1), ("500", 300.0, 2)],
)
def test_steps_are_rounded_to_nearest_integer_of_at_least_one(t_end, tau, steps):
    assert steps_of(t_end, tau) == steps


def test_the_division_into_steps_is_exact():
    tau = 1e-6
    assert steps_of("1000", tau) == round(Fraction(1000) / Fraction(tau))
