"""Times: repeats that take turns, patience that ends, one core that is kept, a processor that is named."""

from __future__ import annotations

import os
from math import inf, isnan

import pytest

from nearharmonic.numerics.clock import Patience, interleaved, pinned, processor, summary


def test_repeats_take_turns():
    seen = []
    interleaved([lambda: seen.append("a"), lambda: seen.append("b")], Patience(least=2, most=3, seconds=inf))
    assert seen == ["a", "b"] * 3


def test_patience_ends_with_time_but_not_before_least_number():
    patience = Patience(least=3, most=9, seconds=1.0, longest=10.0)
    assert patience.goes_on([])
    assert patience.goes_on([4.0, 4.0])  # over the time, under the least number
    assert patience.goes_on([11.0])  # over the longest, but once is no repeat
    assert not patience.goes_on([4.0, 7.0])
    assert not patience.goes_on([0.4, 0.4, 0.4])
    assert patience.goes_on([0.1] * 8)
    assert not patience.goes_on([0.1] * 9)


def test_quartiles_are_kept():
    assert summary([4.0, 1.0, 2.0, 3.0, 5.0]) == (1.0, 2.0, 3.0, 4.0)
    assert all(map(isnan, summary([])))


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system cannot pin")
def test_pinning_keeps_to_one_core_and_gives_the_others_back():
    before = os.sched_getaffinity(0)
    with pinned() as core:
        assert os.sched_getaffinity(0) == {core}
    assert os.sched_getaffinity(0) == before


def test_the_processor_is_named_with_its_clock_and_vectors(tmp_path):
    (tmp_path / "cpuinfo").write_text("model name\t: Fast 9\ncpu MHz\t\t: 2500.0\nflags\t\t: sse avx2 avx512f\n")
    assert processor(tmp_path / "cpuinfo") == "Fast 9, 2.50 GHz, AVX-512"
    assert processor(tmp_path / "none")
