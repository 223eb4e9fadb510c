"""Exported programs: their texts, read back without a compiler, and their states where a compiler or library is."""

import json
import re
import subprocess
import sys
import tomllib
from dataclasses import fields, replace
from decimal import Decimal
from fractions import Fraction
from importlib.util import find_spec
from itertools import product
from shutil import which
from textwrap import dedent

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic import Tableau, integrators
from nearharmonic.errors import SettingError
from nearharmonic.exchange import TARGETS
from nearharmonic.exchange.files import export
from nearharmonic.exchange.method import comment, identifier
from support.methods.ten_methods import EVERY_METHOD
from support.oracles.word_series import operators_of
from support.projects.exported_programs import TAU, array, check, run, unwrapped, written

PROGRAMS = ("c", "julia", "rebound", "diffrax", "sundials", "fortran")
READERS = {"json": json.loads, "toml": tomllib.loads}


def arrays(tableau, to, text):
    """The rows of kicks and of drifts as a program has them."""
    name = identifier(tableau)
    names = {
        "fortran": ("c_kick", "c_drift"), "sundials": ("ahat", "a"), "rebound": ("KICK", "DRIFT"),
        "diffrax": ("KICK", "DRIFT"),
    }.get(to, (f"{name}_kick", f"{name}_drift"))  # fmt: skip
    return tuple(array(text, one) for one in names)


@EVERY_METHOD
@pytest.mark.parametrize("to", ["json", "toml"])
def test_an_exported_table_reads_back_digit_for_digit(name, to):
    tableau = integrators[name]
    read = READERS[to](export(tableau, to))
    rows = {key: tuple(read.pop(key)) for key in ("kick", "drift")}
    again = Tableau(**rows, **read)
    unsaid = {"note", "benchmarked", "generalised_order"}
    assert all(getattr(again, f.name) == getattr(tableau, f.name) for f in fields(Tableau) if f.name not in unsaid)
    assert again.digest() == tableau.digest()


@EVERY_METHOD
@pytest.mark.parametrize("digits", [1, 16, 33])
def test_rounded_coefficient_error_is_at_most_half_last_unit(name, digits):
    tableau = integrators[name]
    digits = min(digits, tableau.digits)
    read = json.loads(export(tableau, "json", digits))
    assert read["digits"] == digits
    for text, exact in zip(read["kick"] + read["drift"], tableau.kick + tableau.drift, strict=True):
        unit = Fraction(10) ** (Decimal(exact).adjusted() - digits + 1)
        assert abs(Fraction(text) - Fraction(exact)) <= unit / 2
        assert (Fraction(text) / unit).denominator == 1


@EVERY_METHOD
@pytest.mark.parametrize("to", PROGRAMS)
def test_program_has_by_default_doubles_that_our_kernels_have(name, to):
    tableau = integrators[name]
    kick, drift = arrays(tableau, to, export(tableau, to))
    if to == "sundials":  # a zero stands where a stage of ARKODE has no kick or no drift
        if tableau.symmetric:
            kick, drift = (kick, drift[:-1]) if tableau.first == "kick" else (kick[1:], drift)
        else:
            kick = [*kick, "0"]
    assert [float(text) for text in kick] == [float(Fraction(text)) for text in tableau.kick]
    assert [float(text) for text in drift] == [float(Fraction(text)) for text in tableau.drift]


@pytest.mark.parametrize("to", PROGRAMS)
@pytest.mark.parametrize("digits", [5, 17, 30])
def test_a_program_has_the_digits_that_are_asked_for(to, digits):
    tableau = integrators["babps8o7h"]
    data = json.loads(export(tableau, "json", digits))
    kick, drift = arrays(tableau, to, export(tableau, to, digits))
    assert kick == data["kick"]
    assert drift[: len(data["drift"])] == data["drift"]


@EVERY_METHOD
def test_stages_of_sundials_apply_substeps_of_step_in_their_order(name):
    tableau = integrators[name]
    kicks, drifts = arrays(tableau, "sundials", export(tableau, "sundials"))
    applied = [one for a, b in zip(kicks, drifts, strict=True) for one in (("B", float(a)), ("A", float(b)))]
    assert [one for one in applied if one[1]] == [one for one in operators_of(tableau, float) if one[1]]
    assert len(kicks) == tableau.stages + tableau.symmetric  # as many kicks as drifts need no more stages


@EVERY_METHOD
@pytest.mark.parametrize("to", ["rebound", "diffrax", "sundials"])
def test_head_says_if_step_takes_more_force_evaluations_than_stages(name, to):
    tableau = integrators[name]
    (comments,) = re.findall(r"\A((?:(?:#|//) .*\n)+)", export(tableau, to))
    said = re.findall(r" (\d+) times", " ".join(comments.replace("//", "").replace("#", "").split()))
    more = tableau.symmetric if to == "sundials" else tableau.first == "kick"
    assert said == ([str(tableau.stages + 1)] if more else [])


@pytest.mark.parametrize("to", TARGETS)
@pytest.mark.parametrize("digits", [0, 77])
def test_digits_that_nobody_knows_are_refused(to, digits):
    with pytest.raises(SettingError, match=f"digits = {digits} is not allowed: an integer from 1 to 76"):
        export(integrators["babps8o7h"], to, digits)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("ruth", "ruth"), ("My method, v2", "my_method_v2"), ("8th", "method_8th"), ("é", "method"), ("x" * 99, "x" * 40)],
)
def test_a_name_becomes_an_identifier_of_every_language(name, expected):
    assert identifier(replace(integrators["ruth"], name=name)) == expected


def test_a_line_of_comment_does_not_swallow_the_next_one():
    assert comment(["a label\nof two lines", "LaTeX \\"], "//") == "// a label of two lines\n// LaTeX \\."


# --- programs read as Python where their compiler or library may be absent --------------------------------------------


#: Kick first and drift first, with and without a harmonic order, and two that require a quadratic kinetic energy.
SIX = ("leapfrog", "ruth", "babps8o7h", "abas5o6h", "srkn_b11", "srkn_a14")
EACH = pytest.mark.parametrize("name", SIX)
#: The few words of a language in which a program is written, as Python.
JULIA = (
    (r"!", ""), (r"^const ", ""), (r"\bRun: .*$", ""),
    (r"^function (.*)$", r"def \1:"),
    (r"^( +)(.*) && return", r"\1if \2: return"),
    (r"&&", "and"), (r"\^", "**"), (r"\b(\d)([a-z])", r"\1 * \2"),
    (r"for step in 1:steps, i in 1:stages", "for step, i in product(range(1, steps + 1), range(1, stages + 1)):"),
    (r"^( +if [^:\n]*)$", r"\1:"),
    (r"^ *end$", ""),
    (r"\blength\b", "len"),
    (r"(\w)\[([^]]+)\]", r"\1[\2 - 1]"),
    (r"(\w) \.\+= h \.\* (\w)$", r"\1[:] = [a + h * b for a, b in zip(\1, \2)]"),
)  # fmt: skip
FORTRAN = (
    (r"!.*$", ""), (r"^ *(?:procedure|real|integer).*::.*$", ""), (r"^ *end .*$", ""), (r"_real_kind", ""),
    (r"\bsubroutine (.*)$", r"def \1:"), (r"\bcall ", ""),
    (r"^( +)if \((.*)\) (return|c = .*)$", r"\1if \2: \3"), (r"\.and\.", "and"),
    (r"do (\w+) = (\w+), (.*)$", r"for \1 in range(\2, \3 + 1):"),
    (r"\b(c_\w+)\(([^)]+)\)", r"\1[\2]"), (r"\b([qp])\((\d)\)", r"\1[\2 - 1]"), (r"^( *)q = ", r"\1q[:] = "),
)  # fmt: skip

C = (
    (r"^.*\*(\w) = N_VGetArrayPointer\(z\)(?: \+ (\d))?;$", r"    \1 = z[\2:]"),
    (r"^.*\*rate = N_VGetArrayPointer\(zdot\);$", "    rate = zdot"),
    (r";$", ""),
)


def as_python(text, words):
    for theirs, ours in words:
        text = re.sub(theirs, ours, text, flags=re.MULTILINE)
    return text


@EACH
def test_the_program_in_julia_gives_our_states(name):
    printed = []
    space = {"product": product, "join": lambda x, between: between.join(map(repr, x))}
    exec(as_python(export(nh.integrators[name], "julia"), JULIA), space | {"println": lambda *x: printed.append(x)})
    check(name, "\n".join("".join(words) for words in printed))


@EACH
def test_the_program_in_fortran_gives_our_states(name):
    text = export(nh.integrators[name], "fortran")
    # Arrays begin with 0 and hold as many numbers as their bounds say.
    rows = {f"c_{key}": list(map(float, array(text, f"c_{key}"))) for key in ("kick", "drift")}
    ends = dict(re.findall(r"parameter :: (c_\w+)\(0:([^)]*)\) =", text))
    stages = int(re.search(r"parameter :: stages = (\d+)", text)[1])
    assert {key: eval(end, {"stages": stages}) + 1 for key, end in ends.items()} == {k: len(r) for k, r in rows.items()}
    space = rows | {"stages": stages}
    bodies = re.findall(r"^  subroutine (?!substep).*?^  end subroutine", text, flags=re.MULTILINE | re.DOTALL)
    for body in bodies:
        exec(dedent(as_python(body, FORTRAN)), space)
    main = re.search(r"^program example.*", text, flags=re.MULTILINE | re.DOTALL)[0]
    given = re.findall(r"([qp])\(2\) = \[(.*?)\]", as_python(main, FORTRAN[3:4]))
    space |= {key: np.array([float(x) for x in values.split(",")]) for key, values in given}
    exec(as_python(re.search(r"^  call (.*)$", main, flags=re.MULTILINE)[1], FORTRAN), space)
    shown = re.findall(r'"(. =)", (\w)', main)
    check(name, "\n".join(" ".join([label, *map(repr, map(float, space[key]))]) for label, key in shown))


@pytest.mark.slow
@EACH
def test_the_table_of_sundials_gives_our_states(name):
    """As sprkStep_TakeStep: a stage kicks with ahat, then drifts with a; a table is of (stages, order, a, ahat)."""
    text = unwrapped(export(nh.integrators[name], "sundials"))
    stages, order, *rows = re.search(r"ARKodeSPRKTable_Create\((.*)\)", text)[1].split(", ")
    drifts, kicks = (list(map(float, array(text, row))) for row in rows)
    assert [int(stages), int(order)] == [len(kicks), nh.integrators[name].order]
    assert {re.search(rf" {row}\[(\d+)\]", text)[1] for row in rows} == {stages}
    rates = re.findall(r"^static int (force|velocity)\(.*?\n{\n(.*?)    return", text, flags=re.MULTILINE | re.DOTALL)
    bodies = {key: dedent(as_python(body, C)) for key, body in rates}
    first, second = re.search(r"SPRKStepCreate\((\w+), (\w+), 0, state", text).groups()
    z = np.full(4, np.nan)
    for line in re.findall(r"^    (z\[.*);", text, flags=re.MULTILINE):
        exec(line, {"z": z})
    steps = int(re.search(r"step < (\d+); step", text)[1])
    tau = float(re.search(r"ARKodeSetFixedStep\(arkode, (.*?)\)", text)[1])
    for _, stage in product(range(steps), zip(kicks, drifts, strict=True)):
        for key, c in zip((first, second), stage, strict=True):
            exec(bodies[key], {"z": z, "zdot": (rate := np.zeros(4))})
            z += c * tau * rate
    check(name, re.sub(r"z\[(\d)\]", lambda found: repr(float(z[int(found[1])])), "q = z[0] z[1]\np = z[2] z[3]"))
    assert re.findall(r"\(double\)(z\[\d\])", text) == ["z[0]", "z[1]", "z[2]", "z[3]"]


# --- programs that are compiled and run -------------------------------------------------------------------------------


#: One of each role.
ROLES = ("babps8o7h", "abas5o6h")
QUADRUPLE = """
#define __STDC_WANT_IEC_60559_TYPES_EXT__
#include <stdlib.h>
int main(void) { char text[64]; return strfromf128(text, sizeof text, "%g", 1.0f128) < 0; }
"""
SUNDIALS = ("-lsundials_arkode", "-lsundials_nvecserial", "-lsundials_core", "-lm")

DOUBLE, EXTENDED = (None,), (None, 36)
STRICT = ("-Wall", "-Wextra", "-Werror", "-o", "program")
#: Target -> suffix, methods, digits, what has to be there, and the command that compiles or runs a file.
LANGUAGES = {
    "c": ("c", SIX, DOUBLE, which("cc"), ("cc", "-std=c99", "-pedantic", *STRICT)),
    "c, quadruple": ("c", ("leapfrog", *ROLES), (36,), which("cc"), ("cc", "-std=c11", *STRICT)),
    "fortran": ("f90", SIX, DOUBLE, which("gfortran"), ("gfortran", "-std=f2008", *STRICT)),
    "fortran, quadruple": ("f90", ROLES, (36,), which("gfortran"), ("gfortran", "-std=f2008", *STRICT)),
    "julia": ("jl", ROLES, EXTENDED, which("julia"), ("julia", "--startup-file=no")),
    "rebound": ("py", ("leapfrog", *ROLES, "srkn_a14"), DOUBLE, find_spec("rebound"), (sys.executable,)),
    "diffrax": ("py", (*ROLES, "srkn_b11"), DOUBLE, find_spec("diffrax"), (sys.executable,)),
    "sundials": ("c", SIX, DOUBLE, which("cc"), ("cc", "-std=c99", "-Wall", "-Werror", "-o", "program")),
}
#: A small program that tests what is installed beside a compiler.
PROBES = {
    "c, quadruple": (QUADRUPLE, "-std=c11"),
    "sundials": ("#include <arkode/arkode_sprkstep.h>\nint main(void) { return 0; }\n", "-std=c11", *SUNDIALS),
}


def test_the_tolerance_tells_exchanged_roles():
    for name in ROLES:
        tableau = nh.integrators[name]
        other = nh.integrate(
            "henon_heiles", name, tau=TAU, t_end=20, first="drift" if tableau.first == "kick" else "kick"
        )
        with pytest.raises(AssertionError):
            check(name, "q = {} {}\np = {} {}".format(*other.q.values[-1], *other.p.values[-1]))


CASES = [
    pytest.param(
        language, name, digits,
        marks=pytest.mark.skipif(not there, reason=f"{language.partition(',')[0]} or its compiler is not installed"),
    )
    for language, (_, methods, numbers, there, _) in LANGUAGES.items() for name in methods for digits in numbers
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("language", "name", "digits"), CASES)
def test_an_exported_program_reproduces_our_states_without_warnings(language, name, digits, tmp_path):
    suffix, _, _, _, command = LANGUAGES[language]
    if language in PROBES:
        text, *words = PROBES[language]
        (tmp_path / "probe.c").write_text(text, encoding="utf-8")
        probe = ["cc", *words[:1], "-o", "probe", "probe.c", *words[1:]]
        if subprocess.run(probe, cwd=tmp_path, capture_output=True, check=False).returncode:
            pytest.skip(f"the C compiler does not know {language}; CPATH and LIBRARY_PATH tell it where libraries are")
    file = written(tmp_path, name, language.partition(",")[0], suffix, digits)
    printed = run([*command, file, *(SUNDIALS if language == "sundials" else ())], tmp_path)
    if "program" in command:
        printed = run(["./program"], tmp_path)
    check(name, printed, "extended" if digits else "double")


PLANETS = """
import rebound
import {name}

simulation = rebound.Simulation()
simulation.add(m=1.0)
simulation.add(m=1e-3, a=1.0, e=0.2)
simulation.add(m=1e-3, a=2.5, e=0.1, inc=0.3)
simulation.integrator = "nearharmonic_{name}"
errors, start = [], simulation.energy()
for dt in (0.2, 0.1):
    run = simulation.copy()
    run.dt = dt
    run.steps(round(20 / dt))
    assert abs(run.t - 20) < 1e-12
    errors.append(abs(run.energy() / start - 1))
# v' = t from 0 to 2 ends at 2 exactly in a method of order 2, and at another number if times are wrong.
driven = rebound.Simulation()
driven.add(m=1.0)
driven.additional_forces = lambda given: setattr(given.contents.particles[0], "ax", given.contents.t)
driven.integrator, driven.dt = "nearharmonic_{name}", 0.25
driven.steps(8)
assert abs(driven.particles[0].vx - 2) < 1e-12
print(errors[0] / errors[1])
"""


@pytest.mark.skipif(not find_spec("rebound"), reason="rebound is not installed")
@pytest.mark.parametrize("name", ROLES)
def test_integrator_of_rebound_moves_its_planets_with_order_of_integrator(name, tmp_path):
    written(tmp_path, name, "rebound", "py")
    (tmp_path / "planets.py").write_text(PLANETS.format(name=name), encoding="utf-8")
    ratio = float(run([sys.executable, "planets.py"], tmp_path))
    assert ratio > 2**4 / 1.5  # order 4 halves the step: 16, less what higher orders add


#: v' = t from 0 to 2 ends at 2 exactly in a method of order 2, and at another number if times are wrong.
DRIVEN = """
import diffrax
import jax
import {name}

terms = diffrax.ODETerm(lambda t, p, args: p), diffrax.ODETerm(lambda t, q, args: t + 0 * q)
start, solver = (jax.numpy.zeros(1), jax.numpy.zeros(1)), {name}.{Name}()
print(solver.order(terms), diffrax.diffeqsolve(terms, solver, 0.0, 2.0, 0.25, start).ys[1][-1, 0])
"""


@pytest.mark.slow
@pytest.mark.skipif(not find_spec("diffrax"), reason="diffrax is not installed")
@pytest.mark.parametrize("name", ROLES)
def test_exported_solver_of_diffrax_evaluates_forces_at_the_time_of_positions(name, tmp_path):
    written(tmp_path, name, "diffrax", "py")
    (tmp_path / "driven.py").write_text(DRIVEN.format(name=name, Name=name.capitalize()), encoding="utf-8")
    order, velocity = run([sys.executable, "driven.py"], tmp_path).split()
    assert int(order) == nh.integrators[name].order
    assert float(velocity) == pytest.approx(2, rel=1e-6)
