"""The functions of formulas have the same bits on every processor that code is made for."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from function_arguments import arguments, pairs
from nearharmonic.core import native
from nearharmonic.core.functions import double, extended
from nearharmonic.core.functions.arrays import ELEMENTWISE, elementwise
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

            def body(*x, name=name, kind=kind):
                if kind == "double":
                    return [double.FUNCTIONS[name](*x)]
                return extended.FUNCTIONS[name](*zip(x[::2], x[1::2], strict=True))

            values = np.empty((results, len(rows[0])))
            code = elementwise(body, len(rows), width)
            native.loaded(*code, ELEMENTWISE)(np.ascontiguousarray(rows), values)
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
