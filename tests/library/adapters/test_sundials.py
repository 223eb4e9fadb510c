"""Methods as tables of SUNDIALS: what ARKODE does with them, in Python, in C, and through its Python interface."""

from __future__ import annotations

import subprocess
from shutil import which

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.exchange.export import arkode_stages as stages
from nearharmonic.exchange.method import nearest_doubles

#: Kick first and drift first; the last two are not symmetric.
METHODS = ("leapfrog", "babs7o7h", "trained_light", "aba864", "srkn_a14", "mclachlan_atela_3", "ruth_s3o3")
EPS = 2.0**-52
LIBRARIES = ("-lsundials_arkode", "-lsundials_nvecserial", "-lsundials_core", "-lm")
STEPS, TAU = 80, 0.25


def rows(method):
    return tuple(np.array(row, dtype=float) for row in stages(nearest_doubles(nh.integrators[method])))


def check(method, q, p):
    ours = nh.integrate("henon_heiles", method, tau=TAU, t_end=STEPS * TAU, summation="plain")
    # Each of 80 (2 s + 1) moves rounds twice, and neighbours part by a factor below ten in this time.
    tolerance = STEPS * (2 * nh.integrators[method].stages + 1) * 10 * EPS
    np.testing.assert_allclose(q, ours.q.values[-1], rtol=0, atol=tolerance)
    np.testing.assert_allclose(p, ours.p.values[-1], rtol=0, atol=tolerance)


PROGRAM = """
#include <arkode/arkode_sprkstep.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>

static int forces;

static int force(sunrealtype t, N_Vector z, N_Vector zdot, void *data)
{
    const sunrealtype *q = N_VGetArrayPointer(z);
    sunrealtype *rate = N_VGetArrayPointer(zdot);
    (void)t; (void)data;
    rate[2] = -(q[0] + 2 * q[0] * q[1]);
    rate[3] = -(q[1] + q[0] * q[0] - q[1] * q[1]);
    forces++;
    return 0;
}

static int velocity(sunrealtype t, N_Vector z, N_Vector zdot, void *data)
{
    (void)t; (void)data;
    N_VGetArrayPointer(zdot)[0] = N_VGetArrayPointer(z)[2];
    N_VGetArrayPointer(zdot)[1] = N_VGetArrayPointer(z)[3];
    return 0;
}

int main(void)
{
    const sunrealtype ahat[] = {%s}, a[] = {%s};
    SUNContext context;
    if (SUNContext_Create(SUN_COMM_NULL, &context)) return 1;
    N_Vector state = N_VNew_Serial(4, context);
    sunrealtype *z = N_VGetArrayPointer(state), t = 0;
    z[0] = 0.3, z[1] = z[2] = 0, z[3] = 0.4;
    void *arkode = SPRKStepCreate(force, velocity, 0, state, context);
    if (SPRKStepSetMethod(arkode, ARKodeSPRKTable_Create(%d, %d, a, ahat))) return 2;
    if (ARKodeSetFixedStep(arkode, 0.25)) return 3;
    for (int step = 0; step < 80; step++)
        if (ARKodeEvolve(arkode, 20, state, &t, ARK_ONE_STEP) < 0) return 4;
    printf("%%.17g %%.17g %%.17g %%.17g %%d\\n", z[0], z[1], z[2], z[3], forces);
    return 0;
}
"""


@pytest.mark.parametrize("method", METHODS)
def test_library_reproduces_our_states_with_a_force_per_stage(method, tmp_path):
    if not which("cc"):
        pytest.skip("there is no C compiler")
    ahat, a = rows(method)
    texts = (", ".join(float(c).hex() for c in row) for row in (ahat, a))
    (tmp_path / "program.c").write_text(PROGRAM % (*texts, a.size, nh.integrators[method].order), encoding="utf-8")
    command = ["cc", "-std=c11", "-o", "program", "program.c", *LIBRARIES]
    compiled = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    if "arkode_sprkstep.h" in compiled.stderr:
        pytest.skip("the C compiler does not know SUNDIALS; CPATH and LIBRARY_PATH tell it where libraries are")
    assert not compiled.returncode, compiled.stderr
    *state, forces = subprocess.run([tmp_path / "program"], capture_output=True, text=True, check=True).stdout.split()
    check(method, [float(x) for x in state[:2]], [float(x) for x in state[2:]])
    # Versions up to 7.5 evaluate the force of the kick of zero of a method with drifts first, 7.9 does not.
    assert int(forces) in (STEPS * np.count_nonzero(ahat), STEPS * ahat.size)
