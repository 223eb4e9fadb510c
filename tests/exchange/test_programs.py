"""Exported programs run and reproduce our states of the Hénon-Heiles system, wherever their compiler or library is."""

from __future__ import annotations

import shutil
import subprocess
import sys
from importlib.util import find_spec

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

needs_c = pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler")
needs_fortran = pytest.mark.skipif(not shutil.which("gfortran"), reason="gfortran is not installed")
needs_julia = pytest.mark.skipif(not shutil.which("julia"), reason="julia is not installed")
needs_rebound = pytest.mark.skipif(not find_spec("rebound"), reason="rebound is not installed")
needs_diffrax = pytest.mark.skipif(not find_spec("diffrax"), reason="diffrax is not installed")


def compiles(text, folder, libraries=()):
    """True if the C compiler accepts a small program, which tests what is installed."""
    (folder / "probe.c").write_text(text, encoding="utf-8")
    words = ["cc", "-std=c11", "-o", "probe", "probe.c", *libraries]
    return subprocess.run(words, cwd=folder, capture_output=True, check=False).returncode == 0


def test_the_tolerance_tells_exchanged_roles():
    for name in ROLES:
        tableau = nh.integrators[name]
        other = nh.integrate(
            "henon_heiles", name, tau=TAU, t_end=20, first="drift" if tableau.first == "kick" else "kick"
        )
        with pytest.raises(AssertionError):
            check(name, "q = {} {}\np = {} {}".format(*other.q.values[-1], *other.p.values[-1]))


@needs_c
@pytest.mark.parametrize("name", METHODS)
def test_program_in_c_compiles_without_warnings_and_reproduces_our_states(name, tmp_path):
    file = written(tmp_path, name, "c", "c")
    run(["cc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-o", "program", file], tmp_path)
    check(name, run(["./program"], tmp_path))


@needs_c
@pytest.mark.parametrize("name", ["leapfrog", *ROLES])
def test_program_in_c_with_more_digits_reproduces_our_extended_states(name, tmp_path):
    if not compiles(QUADRUPLE, tmp_path):
        pytest.skip("the C compiler or its library has no _Float128")
    file = written(tmp_path, name, "c", "c", digits=36)
    run(["cc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-o", "program", file], tmp_path)
    check(name, run(["./program"], tmp_path), "extended")


@needs_fortran
@pytest.mark.parametrize(("name", "digits"), [*((name, None) for name in METHODS), *((name, 36) for name in ROLES)])
def test_program_in_fortran_compiles_without_warnings_and_reproduces_our_states(name, digits, tmp_path):
    file = written(tmp_path, name, "fortran", "f90", digits)
    run(["gfortran", "-std=f2008", "-Wall", "-Wextra", "-Werror", "-o", "program", file], tmp_path)
    check(name, run(["./program"], tmp_path), "extended" if digits else "double")


@needs_julia
@pytest.mark.parametrize(("name", "digits"), [*((name, None) for name in ROLES), *((name, 36) for name in ROLES)])
def test_a_program_in_julia_reproduces_our_states(name, digits, tmp_path):
    file = written(tmp_path, name, "julia", "jl", digits)
    check(name, run(["julia", "--startup-file=no", file], tmp_path), "extended" if digits else "double")


@needs_rebound
@pytest.mark.parametrize("name", ["leapfrog", *ROLES, "srkn_a14"])
def test_an_integrator_of_rebound_reproduces_our_states(name, tmp_path):
    check(name, run([sys.executable, written(tmp_path, name, "rebound", "py")], tmp_path))


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
print(errors[0] / errors[1])
"""


@needs_rebound
@pytest.mark.parametrize("name", ROLES)
def test_integrator_of_rebound_moves_its_planets_with_order_of_integrator(name, tmp_path):
    written(tmp_path, name, "rebound", "py")
    (tmp_path / "planets.py").write_text(PLANETS.format(name=name), encoding="utf-8")
    ratio = float(run([sys.executable, "planets.py"], tmp_path))
    assert ratio > 2**4 / 1.5  # order 4 halves the step: 16, less what higher orders add


@needs_diffrax
@pytest.mark.slow  # JAX takes seconds to start
@pytest.mark.parametrize("name", [*ROLES, "srkn_b11"])
def test_a_solver_of_diffrax_reproduces_our_states(name, tmp_path):
    check(name, run([sys.executable, written(tmp_path, name, "diffrax", "py")], tmp_path))


@needs_c
@pytest.mark.parametrize("name", METHODS)
def test_a_table_of_sundials_reproduces_our_states(name, tmp_path):
    if not compiles("#include <arkode/arkode_sprkstep.h>\nint main(void) { return 0; }\n", tmp_path, SUNDIALS):
        pytest.skip("the C compiler does not find SUNDIALS; CPATH and LIBRARY_PATH tell it where")
    file = written(tmp_path, name, "sundials", "c")
    run(["cc", "-std=c99", "-Wall", "-Werror", "-o", "program", file, *SUNDIALS], tmp_path)
    check(name, run(["./program"], tmp_path))
