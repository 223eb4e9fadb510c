"""Exported programs run and reproduce our states of the Hénon-Heiles system, wherever their compiler or library is."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from shutil import which

import pytest

import nearharmonic as nh
from support.projects.exported_programs import TAU, check, run, written

#: Kick first and drift first, with and without a harmonic order, and two that require a quadratic kinetic energy.
METHODS = ("leapfrog", "ruth", "babps8o7h", "abas5o6h", "srkn_b11", "srkn_a14")
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
    "c": ("c", METHODS, DOUBLE, which("cc"), ("cc", "-std=c99", "-pedantic", *STRICT)),
    "c, quadruple": ("c", ("leapfrog", *ROLES), (36,), which("cc"), ("cc", "-std=c11", *STRICT)),
    "fortran": ("f90", METHODS, DOUBLE, which("gfortran"), ("gfortran", "-std=f2008", *STRICT)),
    "fortran, quadruple": ("f90", ROLES, (36,), which("gfortran"), ("gfortran", "-std=f2008", *STRICT)),
    "julia": ("jl", ROLES, EXTENDED, which("julia"), ("julia", "--startup-file=no")),
    "rebound": ("py", ("leapfrog", *ROLES, "srkn_a14"), DOUBLE, find_spec("rebound"), (sys.executable,)),
    "diffrax": ("py", (*ROLES, "srkn_b11"), DOUBLE, find_spec("diffrax"), (sys.executable,)),
    "sundials": ("c", METHODS, DOUBLE, which("cc"), ("cc", "-std=c99", "-Wall", "-Werror", "-o", "program")),
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
    pytest.param(language, name, digits, marks=[pytest.mark.slow] * (language == "diffrax"))  # JAX starts in seconds
    for language, (_, methods, numbers, *_) in LANGUAGES.items() for name in methods for digits in numbers
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("language", "name", "digits"), CASES)
def test_an_exported_program_reproduces_our_states_without_warnings(language, name, digits, tmp_path):
    suffix, _, _, installed, command = LANGUAGES[language]
    if not installed:
        pytest.skip(f"{language.partition(',')[0]} or its compiler is not installed")
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
