"""Rows and pages of time against error, from curves made by hand whose crossings are points of theirs."""

from __future__ import annotations

import json
from math import isnan

import numpy as np
import pytest

from nearharmonic.output import store
from nearharmonic.recommendation.measure import Solver, variables
from nearharmonic_paper.experiments.work_precision.tables import markdown, rows, time_to_error
from support.cubes.figure_cubes import curves

#: From coarse to fine: errors, and seconds alone, in lanes and with energies. Mean errors are a tenth.
ERRORS = (1e-3, 1e-6, 1e-9)


def curve(name, seconds, errors=ERRORS, kind="splitting"):
    worst, least = np.array(errors), np.array(seconds)
    columns = {"max_energy_error": worst, "mean_energy_error": worst / 10, "evaluations": 1e6 * least}
    columns["tau"] = 0.5 / 2 ** np.arange(worst.size)
    repeats = {}
    for i, time in enumerate(seconds):
        repeats["trajectory", i] = [2 * time, time]
        repeats["lanes", i], repeats["energy", i] = [time / 4, time / 2], [3 * time, 5 * time]
    told = {"columns": columns, "times": repeats, "setup": 2e-5, "sweep": 0.25}
    return Solver(method=name, label=name.title(), kind=kind, **told)


SLOW = curve("slow", (0.001, 0.004, 0.016))
FAST = curve("fast", (0.002, 0.003, 0.005), kind="peer")
COARSE = curve("coarse", (1e-5, 1e-4, 1.5e-3), errors=(1.0, 1e-2, 1e-3))
ABSENT = Solver(method="absent", label="Absent", kind="peer", status="not installed")
SOLVERS = (SLOW, ABSENT, FAST, COARSE)
CURVES = curves(*SOLVERS)
FACTS = {"measured": "today", "cpu": "Fast 9", "pinned_core": "1", "load_average": "0", "clock": "c"}


@pytest.fixture
def found():
    return {(row["measure"], row["target"], row["method"]): row for row in rows("toy", "20", ("max", "mean"), CURVES)}


def test_row_has_costs_of_point_that_meets_its_target(found):
    row = found["max", 1e-6, "slow"]
    assert (row["system"], row["t_end"], row["label"], row["kind"], row["status"]) == (
        "toy",
        "20",
        "Slow",
        "splitting",
        "reached",
    )
    costs = (row["time_ms"], row["lanes_time_ms"], row["energy_time_ms"], row["evaluations"], row["tau"])
    # Logarithms and exponentials on the way to a point round by 1e-15.
    assert costs == pytest.approx((4.0, 1.0, 12.0, 4000.0, 0.25), rel=1e-12)
    assert isnan(row["tolerance"])


def test_row_between_two_points_lies_on_straight_line_of_logarithms(found):
    """1e-6 lies two thirds of the way from a mean of 1e-4 to one of 1e-7: 4^(2/3) times 1 ms, 2^(-2/3) times 0.5."""
    row = found["mean", 1e-6, "slow"]
    assert (row["time_ms"], row["tau"]) == pytest.approx((4 ** (2 / 3), 0.5 * 2 ** (-2 / 3)), rel=1e-12)


def test_ranks_follow_time_and_unreached_methods_have_none(found):
    ranks = {target: {m: found["max", target, m]["rank"] for m in ("slow", "fast", "coarse", "absent")}
             for target in (1e-3, 1e-6, 1e-9, 1e-12)}  # fmt: skip
    assert ranks == {
        1e-3: {"slow": 1, "coarse": 2, "fast": 3, "absent": 0},
        1e-6: {"fast": 1, "slow": 2, "coarse": 0, "absent": 0},
        1e-9: {"fast": 1, "slow": 2, "coarse": 0, "absent": 0},
        1e-12: dict.fromkeys(("fast", "slow", "coarse", "absent"), 0),
    }
    assert found["max", 1e-12, "slow"]["status"] == "not reached"
    assert found["max", 1e-3, "slow"]["status"] == "below throughout"
    assert found["max", 1e-3, "absent"]["method_status"] == "not installed"


@pytest.fixture
def page():
    return markdown("toy", [("20", ("max",), CURVES)], FACTS).splitlines()


def test_page_has_times_and_evaluations_with_fastest_first(page):
    head = page.index("| method | 1e-03 ms | lanes | evaluations | 1e-06 ms | lanes | evaluations | 1e-09 ms | lanes |"
                      " evaluations | 1e-12 ms | lanes | evaluations |")  # fmt: skip
    assert page[head + 2 : head + 4] == [
        "| *Fast* | <= 2 | <= 0.5 | 2000 | 3 | 0.75 | 3000 | 5 | 1.25 | 5000 | - | - | - |",
        "| Slow | <= 1 | <= 0.25 | 1000 | 4 | 1 | 4000 | 16 | 4 | 16000 | - | - | - |",
    ]


def test_the_page_says_by_how_much_a_peer_wins(page):
    """5 ms against 16: 3.2 times as fast."""
    assert "- 1e-03: Slow, <= 1 ms" in page
    assert "- 1e-09: **a peer wins**: Fast, 5 ms, 3.2 times as fast as Slow" in page
    assert "- 1e-12: reached by none" in page
    assert "Fast 9" in "\n".join(page)


def test_page_has_least_nanoseconds_of_each_mode_and_calls_around(page):
    """A microsecond an evaluation alone, a quarter in lanes, three with the energy; 20 us a call, 250 ms a sweep."""
    assert "| Slow | 1e+03 | 250 | 3e+03 | 20 | 250 |" in page
    assert "- Absent: not installed" in page[page.index("## Missing, or ended early") :]


@pytest.mark.slow
def test_task_tells_of_one_system_what_file_has_on_it(tmp_path):
    told = {
        "sho": {"system": "sho", "t_end": "20", "measures": ["max"]},
        "near": {"system": "kepler", "t_end": "5", "measures": ["position"]},
        "far": {"system": "kepler", "t_end": "7", "measures": ["mean", "max"]},
    }
    groups = {name: variables(SOLVERS if name == "far" else [SLOW], "h") for name in told}
    store.write(tmp_path / "times.h5", {}, {**FACTS, "problems": json.dumps(told)}, groups=groups)
    made = time_to_error("kepler", str(tmp_path / "times.h5"))
    lines = made["csv"].records()
    # Four targets for each measure and method: one method near, four far.
    assert [(line["t_end"], line["measure"]) for line in lines] == (
        [("5", "position")] * 4 + [("7", "mean")] * 16 + [("7", "max")] * 16
    )
    assert {line["system"] for line in lines} == {"kepler"}
    times = {(line["measure"], line["target"], line["method"]): line["time_ms"] for line in lines}
    assert (times["max", "1e-09", "fast"], times["max", "1e-09", "absent"]) == ("5", "nan")
    assert times["mean", "1e-06", "slow"] == "2.51984"  # 4^(2/3), to six digits
    assert made["md"].startswith("# Sun-Mercury system: time and evaluations to reach an error\n")
    assert made["md"].count("\n## ") == 3 + 2
