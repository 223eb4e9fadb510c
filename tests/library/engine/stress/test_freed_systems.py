"""Systems and machine code that are no longer used are freed, and those that a call still needs are not."""

from __future__ import annotations

import gc
import subprocess
import sys
import weakref

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.engine.batch import single_steps
from nearharmonic.engine.numbers import standard_parameters, standard_start
from nearharmonic.engine.setup import Setup
from nearharmonic.systems.remembered import remembered
from support.methods.own_systems import spring


def used(name):
    """A system that every public function has used."""
    made = spring(name, frequencies=("1",), invariants={"H": lambda q, p: (q[0] ** 2 + p[0] ** 2) / 2})
    nh.integrate(made, "ruth", 0.5)
    nh.integrate(made, "ruth", 0.5, split="exact_oscillator")
    nh.sweep(made, "leapfrog", [0.5, 1.0])
    nh.ensemble(made, "ruth", 0.5, q0=[[1.0], [2.0]])
    nh.problem(made, "ruth")(0.5)
    return made


def test_a_system_that_is_no_longer_used_is_freed():
    """But for the last one, whose formulas are known until those of the next are."""
    known = [weakref.ref(used(name)) for name in ("one", "two", "three")]
    gc.collect()
    assert [one() is None for one in known[:2]] == [True, True]


def prepared(system):
    """A batch of one step that is ready to run."""
    setup = Setup(system, "ruth", t_end=1)
    start, parameters = standard_start(system, False)[None, :].copy(), standard_parameters(system)[None, :]
    return setup.batch(setup.moves([setup.end]), single_steps(1), np.zeros(1, np.int64), start, parameters)


def test_a_prepared_batch_outlives_the_system_it_was_made_for():
    batch, other = prepared(spring("shortlived")), prepared(nh.systems["sho"])
    used("next")
    gc.collect()
    for one in (batch, other):
        one.run()
    assert np.array_equal(batch.filled.states, other.filled.states)
    assert batch.filled.states[0, 1, 0] != 1.0


@pytest.mark.slow
def test_a_stepper_outlives_the_system_it_was_made_for():
    step = nh.stepper(spring("shortlived"), "ruth", summation="plain")
    used("next")
    gc.collect()
    q, p = np.array([1.0]), np.array([0.0])
    step(q, p, 0.5)
    run = nh.integrate("sho", "ruth", 0.5, t_end=0.5, summation="plain")
    assert (q[0], p[0]) == (run.q[-1, 0].item(), run.p[-1, 0].item())


def test_results_are_remembered_by_the_system_itself():
    asked = []

    @remembered
    def doubled(system, number, *, more=0):
        asked.append(system.name)
        return 2 * number + more

    one, two = spring("one"), spring("two")
    assert [doubled(one, 1), doubled(two, 1), doubled(one, 1), doubled(one, 1, more=1)] == [2, 2, 2, 3]
    assert (asked, doubled.misses) == (["one", "two", "one"], 3)
    del two
    gc.collect()
    assert doubled.misses == 2
    doubled.cache_clear()
    assert (doubled(one, 1), asked[3:]) == (2, ["one"])


#: KiB that the memory of a process grows by for each of 40 systems that are used and dropped.
GROWTH = """
import gc
import psutil
import nearharmonic as nh
memory = psutil.Process().memory_info
for k in range(60):
    if k == 20:
        before = gc.collect() * 0 + memory().rss
    one = nh.System(name=f"number {k}", V=lambda q, a=k % 3 + 1: a * q[0] ** 2 / 2, q0=["1"], p0=["0"], t_end="1")
    nh.integrate(one, "ruth", 0.5)
    del one
gc.collect()
print((memory().rss - before) / 1024 / 40)
"""


@pytest.mark.slow
def test_sixty_dropped_systems_leave_no_memory_behind():
    """A kernel and its engine take 300 KiB; the allocator keeps 40 KiB of the memory that is freed."""
    found = subprocess.run([sys.executable, "-c", GROWTH], check=True, capture_output=True, text=True, timeout=300)
    assert float(found.stdout) < 100
