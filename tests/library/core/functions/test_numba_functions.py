"""Code of functions of numba: its digest, and what is refused."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from llvmlite import ir

import nearharmonic as nh
from nearharmonic.core.emission import kinds_of, module_of
from nearharmonic.core.reals import NumbaFunctionError, compiled_code
from nearharmonic.core.tracing import Rules
from nearharmonic.engine.kernels import formulas_digest, physics_of
from support.methods.numba_potentials import walled

#: In another order and with other counters, behind a loop that numba did not optimise.
ELSEWHERE = """
from nearharmonic.core.layout import BEGIN
from nearharmonic.core.kernel import compiled_loops
compiled_loops(lambda rows: None, BEGIN)
import nearharmonic as nh
from support.methods import numba_potentials
V, grad_V = numba_potentials.walled([1.0, 2.0, 3.0])
V((0.5,))
V, grad_V = numba_potentials.walled([0.5, 0.1, 0.25])
grad_V((1.0,))
from nearharmonic.engine.kernels import formulas_digest
system = nh.System(name="other name", V=V, grad_V=grad_V, q0=1, p0=0, t_end=20)
print(formulas_digest(system), nh.integrate(system, "ruth", 0.01).q.values[-1, 0].hex())
"""


@pytest.fixture(scope="module")
def walls():
    V, grad_V = walled([0.5, 0.1, 0.25])
    return nh.System(name="walled", V=V, grad_V=grad_V, q0=1, p0=0, t_end=20)


@pytest.mark.slow
def test_another_process_finds_the_same_digest_and_orbit(walls):
    here = formulas_digest(walls), nh.integrate(walls, "ruth", 0.01).q.values[-1, 0].hex()
    places = [str(Path(nh.__file__).parents[1]), str(Path(__file__).parents[3])]
    program = f"import sys; sys.path[:0] = {places!r}\n{ELSEWHERE}"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.stdout.split() == list(here), done.stderr


@pytest.mark.slow
def test_digest_covers_arrays_in_closures_of_functions_that_are_called(walls):
    V, grad_V = walled([0.5, 0.1, 0.25000001])
    assert formulas_digest(walls) != formulas_digest(replace(walls, V=V, grad_V=grad_V))


def test_types_that_numba_knows_leave_digests_alone():
    rules = Rules(physics_of(nh.systems["sho"]), extended=True, compensated=True)
    before = str(module_of(rules, kinds_of(rules, 1), ()))
    ir.global_context.get_identified_type("test.type").set_body(ir.DoubleType())
    assert str(module_of(rules, kinds_of(rules, 1), ())) == before


whole = numba.njit(lambda q: np.sum(q * q) / 2)
both = numba.njit(lambda q: q)
three = numba.njit(lambda q: (1.0, 2.0, 3.0))
misspelt = numba.njit(lambda q: nowhere(q[0]))  # noqa: F821
one_number = numba.njit("float64(float64)")(lambda x: x)
LARGE = np.ones(200_000)
addressed = numba.njit(lambda q: LARGE[int(q[0])] * q[0])


@numba.njit(parallel=True)
def parallel(q):
    total = 0.0
    for i in numba.prange(2):
        total += q[i] ** 2 / 2
    return total


@numba.njit
def printing(q):
    if q[0] < 0:
        print("negative:", q[0])
    return q[0]


@numba.njit
def factorial(n):
    return 1.0 if n <= 1 else n * factorial(n - 1)


recursive = numba.njit(lambda q: factorial(3) * q[0])
REFUSED = {
    "gradient of another length": (whole, three, "grad_V returns UniTuple.*, expected a tuple of 2 real numbers"),
    "gradient that is a number": (whole, whole, r"^V is not compiled .* mul\(UniTuple.*; grad_V returns float64"),
    "value that is an array": (both, both, "^V returns UniTuple.*; V returns array.*, expected one real number"),
    "unknown name": (misspelt, both, "^V is not compiled by numba for a tuple q: NameError: name 'nowhere'"),
    "signature": (one_number, both, "^V is .* for a tuple q: none of its signatures fits; V is .* for an array q"),
    "recursion": (recursive, both, "^V or grad_V calls a function that calls itself: write it as a loop$"),
    "threads": (parallel, both, "^V is compiled with parallel=True"),
    "interpreter": (printing, both, "^V calls the Python interpreter, as print and numba.objmode do: runs cannot$"),
    "address": (addressed, both, "^V refers to an address of this process, by an array of more than a megabyte"),
}  # fmt: skip
#: Cases that take numba half a second.
LONG = {"threads", "interpreter"}


@pytest.mark.slow
@pytest.mark.parametrize("case", [pytest.param(x, marks=[pytest.mark.slow] * (x in LONG)) for x in REFUSED])
def test_functions_that_are_no_potential_are_refused_in_a_sentence(case):
    V, grad_V, message = REFUSED[case]
    with pytest.raises(NumbaFunctionError, match=message):
        compiled_code(V, grad_V, 2, 0)
