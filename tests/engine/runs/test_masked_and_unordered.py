"""Masked entries, bytes, mappings and sets where numbers belong: every call that reads a list refuses them."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.errors import NearharmonicError

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
