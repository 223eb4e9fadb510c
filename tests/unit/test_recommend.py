"""Which method for which error: read from timings, or measured on the spot, and always with its basis."""

from __future__ import annotations

import json
import re

import pytest

from nearharmonic import store
from nearharmonic.curve import Curve, Point
from nearharmonic.errors import NearharmonicError, ResultFileError, SystemDefinitionError
from nearharmonic.integrators import integrators
from nearharmonic.recommend import lines, load_system, recommend, registry_lines
from nearharmonic.systems import systems
from nearharmonic.work_precision import variables

QUARTIC = """
from nearharmonic.systems import System

SYSTEM = System(
    name="quartic",
    label="quartic oscillator",
    V=lambda q: sum(x**4 for x in q) / 4,
    grad_V=lambda q: tuple(x**3 for x in q),
    q0=("1", "0.5"),
    p0=("0", "1"),
    t_end="10",
    units={"q": "1", "p": "1", "t": "1", "energy": "1"},
    source="made up for this test",
)
"""


def made(method, time, kind="splitting", **setting):
    """A curve that halves its error from 2e-6 to 2e-12 in steps of 1e-3, each taking ten times as long."""
    points = [
        Point(
            evaluations=100.0 * 10**i,
            max_energy_error=2 * 10.0 ** (-6 - 3 * i),
            mean_energy_error=10.0 ** (-6 - 3 * i),
            times={"trajectory": [time * 10**i]},
            **setting,
        )
        for i in range(3)
    ]
    return Curve(method=method, label=method.upper(), kind=kind, points=points)


@pytest.fixture
def results(tmp_path):
    """A folder of results with timings of two methods, a peer and an absent one on the oscillator."""
    curves = [
        made("slow", 1e-4, tau=0.5),
        made("fast", 1e-5, tau=0.25),
        made("theirs", 1e-6, kind="peer", tolerance=1e-9),
        Curve(method="absent", label="Absent", kind="peer", status="not installed"),
    ]
    problems = {"sho": {"system": "sho", "t_end": "500", "measures": ["max", "mean"], "reference": ""}}
    facts = {"measured": "2026-01-02T03:04:05+00:00", "cpu": "Fast 9", "problems": json.dumps(problems)}
    store.write(tmp_path / "cubes/work_precision.h5", {}, facts, groups={"sho": variables(curves, "1")})
    return tmp_path


def test_timings_that_are_there_are_read_and_named(results):
    found = recommend("sho", "1e-9", results=results)
    assert [curve.method for curve, _ in found.order] == ["theirs", "fast", "slow", "absent"]
    assert found.t_end == "500"
    assert found.basis == f"{results}/cubes/work_precision.h5, measured 2026-01-02T03:04:05+00:00 on Fast 9"


def test_the_text_has_setting_evaluations_time_and_ratio_of_each_method(results):
    text = list(lines(recommend("sho", 1e-6, measure="mean", results=results)))
    assert text[0] == "simple harmonic oscillator, t = 500: mean of |H - H0|/|H0| <= 1e-06"
    assert text[2].split() == ["1.", "THEIRS*", "tolerance", "1e-09", "100", "<=", "0.001", "1.00"]
    assert text[3].split() == ["2.", "FAST", "0.25", "100", "<=", "0.01", "10.00"]
    assert "not reached: Absent (not installed)" in text
    assert text[-2] == "* another library, as its users use it"
    assert text[-1].endswith("on Fast 9")


def test_an_error_that_nobody_reaches_is_said_with_the_best_there_is(results):
    text = "\n".join(lines(recommend("sho", 1e-20, results=results)))
    assert "no method reaches this error" in text
    assert "FAST (2.0e-12 at best)" in text


def test_without_timings_each_method_is_measured_on_the_spot(tmp_path):
    found = recommend("sho", 1e-9, results=tmp_path)
    assert {curve.method for curve, _ in found.order} == set(integrators)
    assert found.order[0][1].status == "reached"
    assert found.order[0][1].evaluations > 0
    assert f"measured on the spot ({tmp_path}/cubes/work_precision.h5 has no timings of it" in found.basis
    assert "peers not timed" in found.basis


def test_a_measure_that_the_timings_lack_is_measured(results):
    assert "measured on the spot" in recommend("sho", 1e-6, measure="position", results=results).basis


def test_a_system_of_ones_own_is_measured_on_the_spot(tmp_path):
    (tmp_path / "quartic.py").write_text(QUARTIC)
    found = recommend(str(tmp_path / "quartic.py"), 1e-6, measure="position", results=tmp_path)
    assert found.system.name == "quartic"
    assert found.basis.startswith("measured on the spot (a system of your own)")
    reached = [curve.method for curve, crossing in found.order if crossing.status == "reached"]
    assert "aba864" in reached


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "no such file. A system of your own is a Python file that defines SYSTEM"),
        ("x = 1", "does not define SYSTEM, a nearharmonic.systems.System; it has None"),
        ("SYSTEM = 3", "does not define SYSTEM, a nearharmonic.systems.System; it has 3"),
        ("1 / 0", "cannot be run: ZeroDivisionError: division by zero"),
        ("def", "cannot be run: SyntaxError"),
        (QUARTIC.replace('"10"', '"ten"'), "quartic: t_end = 'ten' is not a finite decimal number"),
    ],
)
def test_a_file_that_is_no_system_is_refused(tmp_path, content, says):
    if content is not None:
        (tmp_path / "mine.py").write_text(content)
    with pytest.raises(SystemDefinitionError, match=re.escape(says)):
        load_system(tmp_path / "mine.py")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"system": "keplr"}, "unknown system 'keplr'. Did you mean 'kepler'?"),
        ({"error": "tiny"}, "error = 'tiny' is not allowed: a finite number above 0"),
        ({"error": "-1"}, "error = '-1' is not allowed"),
        ({"measure": "maximum"}, "measure = 'maximum' is not allowed: one of max, mean, position. Did you mean 'max'?"),
    ],
)
def test_a_bad_question_is_refused_before_anything_is_measured(arguments, says, tmp_path):
    asked = {"system": "sho", "error": "1e-9", "measure": "max"} | arguments
    system, error = asked.pop("system"), asked.pop("error")
    with pytest.raises(NearharmonicError, match=re.escape(says)):
        recommend(system, error, results=tmp_path, **asked)


def test_broken_timings_are_named_and_not_measured_around(tmp_path):
    (tmp_path / "cubes").mkdir()
    (tmp_path / "cubes/work_precision.h5").write_bytes(b"not HDF5")
    with pytest.raises(ResultFileError, match="is truncated or no HDF5 file"):
        recommend("sho", 1e-9, results=tmp_path)


def test_every_integrator_and_system_is_listed():
    for kind, registry in (("integrators", integrators), ("systems", systems)):
        names = [line.split()[0] for line in registry_lines(kind)]
        assert names == ["name", *registry]
