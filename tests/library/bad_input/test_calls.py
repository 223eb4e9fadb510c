"""Bad calls of the library: each ends with one sentence before any work."""

import inspect
import itertools
import os
import pickle
from decimal import Decimal
from fractions import Fraction
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nearharmonic as nh
from nearharmonic.errors import NearharmonicError
from nearharmonic.exchange.files import read
from nearharmonic.output import store
from support.bad_input import check_message, refused

KIND = "E. bad calls"
#: Values that are no number anywhere.
NO_NUMBERS = [
    "", "ten", "nan", "inf", float("nan"), float("inf"), -float("inf"), "1e999999999", "9" * 10**5, 10**400, "٣", "1_0",
    True, {}, {"a": 1}, b"1", 1j, object(), Decimal("nan"), np.ma.masked, "1e-401", "1 2", lambda: 1,
    np.timedelta64(1, "s"), np.datetime64("2020"), np.bool_(True), np.complex128(1), np.ones(3),
]  # fmt: skip
#: Values that are no positive number, no integer, and no name; arrays of every kind are in tests/library/engine.
NOT_POSITIVE = [*NO_NUMBERS, None, [1], 0, -1, "-5", "0", -0.0, 5e-324, Fraction(-1, 3)]
NO_INTEGERS = [0, -1, 1.5, 10.0, "10", True, [1], 10**9, 10**400, float("nan"), b"1", np.timedelta64(3, "s")]
NO_NAMES = ["", "nobody", None, 5, True, ["ruth"], b"ruth", {}, "../x", "x.py", "/etc", "\0", "kepl\ner", "r" * 10**5]

integrate = partial(nh.integrate, "sho", "ruth")
kepler = partial(nh.integrate, "kepler", "ruth", 10)
ensemble = partial(nh.ensemble, "kepler", "ruth", 10, t_end=100)
prepared = nh.problem("sho", "ruth", t_end=1)

#: Functions of one value, by what they are called in the message, with the values that they refuse.
CALLS = {
    "tau": (integrate, [x for x in NOT_POSITIVE if x is not np.ma.masked]),
    "tau of a prepared run": (prepared, [0, -1, "ten", None, 10**400]),
    "t_end": (lambda x: integrate(0.1, t_end=x), [*NO_NUMBERS, [1], 0, "0", -0.0, 5e-324]),
    "energy_scale": (lambda x: integrate(0.1, t_end=1, energy_scale=x), [0, -1, "nan", "1e999999999", True, [1], b"1"]),
    "samples": (lambda x: integrate(0.1, t_end=1, samples=x), [*NO_INTEGERS, None]),
    "threads": (lambda x: ensemble(q0=[[1e8, 0]], threads=x), NO_INTEGERS),
    "precision": (lambda x: integrate(0.1, precision=x), [*NO_NAMES, "dble"]),
    "summation": (lambda x: integrate(0.1, summation=x), [*NO_NAMES, "kahan"]),
    "energy": (lambda x: integrate(0.1, energy=x), [*NO_NAMES, "samplex"]),
    "split": (lambda x: integrate(0.1, split=x), NO_NAMES),
    "first": (lambda x: integrate(0.1, first=x), [x for x in NO_NAMES if x is not None]),
    "system": (lambda x: nh.integrate(x, "ruth", 0.1), NO_NAMES),
    "integrator": (lambda x: nh.integrate("sho", x, 0.1), NO_NAMES),
    "parameters": (lambda x: kepler(parameters=x), [{"GN": 1}, {"GM": "ten"}, {"GM": None}, {5: 1}, [1], "GM"]),
    "taus": (partial(nh.sweep, "sho", "ruth"), [None, 0.1, [0.1, 0], [0.1, "ten"], itertools.repeat(0.1)]),
    "q0": (lambda x: kepler(q0=x), ["10", 10, [0, 0], [1, None], [True, 1]]),
    "t": (lambda x: integrate(0.1, t_end=1, t=x), [0.5, [2], [-1], [0.5, 0.2], ["nan"]]),
    "deviations": (lambda x: nh.tangent("sho", "ruth", 0.1, deviations=x), [None, 0, 3, -1, 1.5, [[1, 0], [2, 0]]]),
    "start": (lambda x: integrate(0.1, start=x), [5, "x", {}, [1], True]),
    "start of deviations": (lambda x: nh.tangent("sho", "ruth", 0.1, start=x), [5, "x", {}, [1], True]),
    "start of a gradient": (lambda x: nh.gradient("sho", "ruth", 0.1, lambda q, p: q[0], start=x), [5, {}, True]),
    "highest": (partial(nh.kappa, "ruth"), [*NO_INTEGERS, None]),
    "error": (partial(nh.recommend, "sho"), [0, -1, "nan", "1e999999999", None, True, [1]]),
    "measure": (lambda x: nh.recommend("sho", 1e-6, measure=x), ["mx", None, 5, b"max"]),
    "budget": (lambda x: nh.recommend("sho", 1e-6, budget=x), [x for x in NO_INTEGERS if x != 10**9]),
    "samples of deviations": (lambda x: nh.tangent("sho", "ruth", 0.1, samples=x), NO_INTEGERS),
    "split of deviations": (lambda x: nh.tangent("sho", "ruth", 0.1, split=x), [*NO_NAMES, "exact_oscillator"]),
    "observable": (
        lambda x: nh.gradient("sho", "ruth", 0.1, x),
        [*NO_NUMBERS, *NO_NAMES, len, lambda q: q[0], lambda q, p: (q[0], p[0]), lambda q, p: q[3], lambda q, p: None],
    ),
    "split of a gradient": (lambda x: nh.gradient("sho", "ruth", 0.1, lambda q, p: q[0], split=x), NO_NAMES),
    "methods": (lambda x: nh.recommend("sho", 1e-6, methods=x), [np.array("ruth"), ["ruht"], [], [5], "ruht", 5]),
    "path": (store.read, [None, 5, "", "nothing.h5", "a\0b", b"x", "/", "/dev/null", ["x"], "x" * 5000]),
}  # fmt: skip

OWN = {"name": "own", "V": lambda q: q[0] * q[0] / 2, "q0": ("1",), "p0": ("0",), "t_end": "1"}
SYSTEMS = {
    "name": ["", None, 5, b"x"],
    "V": [None, 5, "x", lambda: 1, lambda q, p: 1, lambda q: None],
    "q0": [(), ("ten",), ("1", "2"), ("1e999999999",), ("٣",), (None,), {"a": 1}, b"1", (True,), ("1e-401",), ((1,),)],
    "p0": [("nan",), (float("inf"),), ("9" * 10**5,), ((0, (1,), 2),)],
    "t_end": ["", "ten", "nan", None, [1], True, "1e999999999", "1e400", b"1", np.timedelta64(1, "s")],
    "units": [None, {}, {"q": 5}, {"q": "m"}, 5],
    "parameters": [{5: 1}, [1], {"a b": 1}, {"a": "1e999999999"}, {"a": None}],
    "masses": [
        (np.timedelta64(1, "s"),), (np.array(1.0),), ("0",), ("x",), ("1", "2"), ("1e999999999",), (True,), (None,), -5,
        {"a": 1}, (float("nan"),),
    ],
    "frequencies": [("x",), ("-1",), (None,), ("1", "2"), ("1e999999999",), (True,), 5],
    "invariants": [{"q": len}, {"x": 5}, [len], {5: len}],
    "observables": [{"q": len}, {"energy_error": len}, {"x": 5}, [len]],
    "surface_limit": [np.timedelta64(1, "s"), float("nan"), 0, -1, "1", None, True],
    "energy_scale": ["0", "-1", "nan", "x", "1e999999999"],
    "time_dependent": ["yes", 1, None],
    "label": [5],
    "source": [5],
}  # fmt: skip

LEAPFROG = {
    "name": "leap", "order": 2, "first": "kick", "kick": ("0.5", "0.5"), "drift": ("1",), "source": "", "digits": 16,
}  # fmt: skip
TABLEAUS = {
    "name": ["../x", "", None, 5, "a/b", "x" * 101, "a\nb", b"x"],
    "order": [0, 99, 3, True, "2", None, 2.0, 10**400],
    "first": ["both", None, 5, ["kick"], {}],
    "kick": [(), ("0.5",), [0.5], ("nan", "0.5"), ("1e999999999", "0.5"), ("0." + "5" * 10**5, "0.5"), None],
    "drift": [("1", "0"), (True,), ("inf",), ("1.1",), (None,), ("1/1",)],
    "digits": [0, 10**9, True, "16", None, 16.0],
    "label": [5],
    "source": [5, None],
    "note": [5],
    "requires": ["luck", 5],
    "symmetric": ["yes", 5, np.True_, np.ones(3)],
    "square": [np.ones(3), ("1",), 5, ("x", "y")],
}  # fmt: skip

#: Files of coefficients, by their names and contents.
COEFFICIENTS = {
    "twice.json": '{"kick": ["1"], "kick": ["1"], "drift": ["1"]}',
    "nested.json": "[" * 10**5,
    "nested.toml": "kick = " + "[" * 5000 + "]" * 5000,
    "list.json": "[1]",
    "empty.json": "",
    "empty.toml": "",
    "empty.csv": "",
    "long.csv": "kick," + "1" * 140_000 + "\ndrift,1\n",
    "quote.csv": 'kick,"' + "x" * 140_000,
    "twice.csv": "kick,1\nkick,1\n",
    "zero.csv": "kick,0\ndrift,1\n",
    "huge.json": '{"kick": ["1e999999999"], "drift": ["1"], "first": "kick"}',
    "digits.json": '{"kick": [' + "1" * 10**4 + '], "drift": ["1"], "first": "kick"}',
    "large.json": " " * (10**6 + 1),
    "order.json": '{"kick": ["1"], "drift": ["1"], "first": "kick", "order": 1e999}',
    "key.json": '{"kik": ["1"]}',
    "unicode.json": '{"kick": ["\\u0663"], "drift": ["1"], "first": "kick"}',
    "bool.json": '{"kick": [true], "drift": ["1"], "first": "kick"}',
    "first.json": '{"kick": ["1"], "drift": ["1"], "first": {"a": 1}}',
    "name.json": '{"kick": ["1"], "drift": ["1"], "first": "kick", "name": 5}',
    "syntax.py": "TABLEAU = (",
    "raises.py": "1 / 0",
    "nothing.py": "",
    "words.txt": "kick",
}


def shortened(value):
    try:
        return repr(value)[:40]
    except ValueError:
        return type(value).__name__


def test_a_bad_argument_is_refused_before_any_work(trials, here):
    bad = trials(KIND)
    for key, (call, values) in CALLS.items():
        for value in values:
            with bad.case(f"{key} = {shortened(value)}"):
                refused(partial(call, value))


DECLARATIONS = {
    "system": (SYSTEMS, lambda given: nh.integrate(nh.System(**OWN | given), "ruth", 0.5)),
    "tableau": (TABLEAUS, lambda given: nh.Tableau(**LEAPFROG | given)),
}


@pytest.mark.parametrize(("members", "declare"), DECLARATIONS.values(), ids=DECLARATIONS)
def test_a_bad_member_of_a_declaration_is_refused(trials, here, members, declare):
    bad = trials(KIND)
    for key, values in members.items():
        for value in values:
            with bad.case(f"{key} = {shortened(value)}"):
                refused(partial(declare, {key: value}))


def test_a_file_without_coefficients_is_refused(trials, here):
    bad = trials(KIND)
    for name, content in COEFFICIENTS.items():
        path = here / name
        path.write_text(content, encoding="utf-8")
        with bad.case(name):
            refused(partial(read, str(path)))
    os.mkfifo(here / "pipe.json")
    for path in (here, here / "pipe.json", here / "missing.json", here / "here", Path("/dev/zero")):
        with bad.case(path):
            refused(partial(read, str(path)))


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=12) | st.binary(max_size=4)
    | st.decimals() | st.complex_numbers(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=2),
    max_leaves=4,
)  # fmt: skip
ARGUMENTS = ["t_end", "precision", "summation", "first", "samples", "q0", "p0", "parameters", "energy", "energy_scale"]


@pytest.mark.slow
def test_any_argument_is_accepted_or_refused_in_one_line(trials, here):
    bad = trials(KIND)

    @settings(max_examples=100, database=None, derandomize=True)
    @given(st.sampled_from(ARGUMENTS), VALUES)
    def check(key, value):
        with bad.case(f"{key} = {shortened(value)}"):
            try:
                integrate(0.1, **{"t_end": 1, key: value})
            except NearharmonicError as error:
                check_message(str(error))

    check()


#: Unknown keywords of functions, and the nearest arguments.
KEYWORDS = {
    "integrate": ("q_0", "q0"), "problem": ("t", "t_end"), "System": ("gradV", "grad_V"), "tangent": ("taus", "tau"),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted({x for x in nh.__all__ if callable(getattr(nh, x))} - {"NearharmonicError"}))
def test_unknown_keywords_are_answered_with_the_arguments(name):
    function, (word, nearest) = getattr(nh, name), KEYWORDS.get(name, ("x7", None))
    known = [key for key in inspect.signature(function).parameters if key != "self"]
    text = refused(lambda: function(**{word: 1}), f"{name} has no argument '{word}'.")
    assert f" Arguments: {', '.join(known)[:80]}" in text
    assert nearest is None or f"Did you mean '{nearest}'?" in text
    with pytest.raises(TypeError):
        function(**{word: 1})
    assert pickle.loads(pickle.dumps(function)) is function


def test_unknown_keyword_of_a_prepared_run_is_answered():
    refused(lambda: prepared(0.1, q=1), "problem has no argument 'q'. Did you mean 'q0'?")


def test_type_errors_inside_of_a_function_remain_as_they_are():
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'tau'"):
        nh.integrate("sho", "ruth")
