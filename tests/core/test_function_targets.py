"""The functions of formulas have the same bits on every processor that code is made for."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from function_arguments import arguments, evaluated, in_double, in_extended, pairs
from nearharmonic.core import native
from nearharmonic.core.number import FUNCTIONS

ALL = sorted(FUNCTIONS)
PROCESSORS = ("x86-64-v3", "znver2", "generic")


def digests(kinds, width=8, count=300):
    """Digest of the results of each function, doubles and double-doubles, from one piece of code each."""
    found = {}
    for name in ALL:
        for kind, rows, results in (("double", arguments(name, count), 1), ("extended", pairs(name, count), 2)):
            if kind not in kinds:
                continue

            body = in_double(name) if kind == "double" else in_extended(name)
            values = evaluated(body, rows, width, results)
            values[np.isnan(values)] = np.nan  # whose sign is the processor's
            found[name, kind] = hashlib.sha256(values.tobytes()).hexdigest()
    return found


@pytest.mark.parametrize(
    ("processor", "kinds"),
    [
        ("x86-64-v3", ("double",)),
        *(pytest.param(name, ("double", "extended"), marks=pytest.mark.slow) for name in PROCESSORS),
    ],
)
def test_another_processor_computes_the_same_bits(monkeypatch, processor, kinds):
    here = digests(kinds)
    monkeypatch.setenv("NUMBA_CPU_NAME", processor)
    monkeypatch.setenv("NUMBA_CPU_FEATURES", "")
    native.processor.cache_clear()
    try:
        assert digests(kinds) == here
    finally:
        monkeypatch.undo()
        native.processor.cache_clear()
