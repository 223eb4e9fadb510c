$head
// SUNDIALS 7.1 or newer; sunrealtype is the type that SUNDIALS is configured for. Compile and run:
// cc -O2 -o $name $name.c -lsundials_arkode -lsundials_nvecserial -lsundials_core -lm && ./$name

#include <arkode/arkode_sprkstep.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>

// For SPRKStepSetMethod; ARKodeSPRKTable_Free frees it.
ARKodeSPRKTable ${name}_table(void)
{
    // kicks
    const sunrealtype ahat[$stages] = {
$ahat
    };
    // drifts
    const sunrealtype a[$stages] = {
$a
    };
    return ARKodeSPRKTable_Create($stages, $order, a, ahat);
}

// Example, to be replaced: the Henon-Heiles system, V = (x^2 + y^2)/2 + x^2 y - y^3/3, T = (px^2 + py^2)/2.
// The state is z = (x, y, px, py); force sets dp/dt alone, velocity sets dq/dt alone, and ARKODE zeroes the rest.
static int force(sunrealtype t, N_Vector z, N_Vector zdot, void *user_data)
{
    const sunrealtype *q = N_VGetArrayPointer(z);
    sunrealtype *rate = N_VGetArrayPointer(zdot);
    rate[2] = -(q[0] + 2 * q[0] * q[1]);
    rate[3] = -(q[1] + q[0] * q[0] - q[1] * q[1]);
    return 0;
}

static int velocity(sunrealtype t, N_Vector z, N_Vector zdot, void *user_data)
{
    const sunrealtype *p = N_VGetArrayPointer(z) + 2;
    sunrealtype *rate = N_VGetArrayPointer(zdot);
    rate[0] = p[0];
    rate[1] = p[1];
    return 0;
}

static void check(int failed, const char *what)
{
    if (failed) {
        fprintf(stderr, "%s failed\n", what);
        exit(1);
    }
}

int main(void)
{
    SUNContext context;
    check(SUNContext_Create(SUN_COMM_NULL, &context), "SUNContext_Create");
    N_Vector state = N_VNew_Serial(4, context);
    sunrealtype *z = N_VGetArrayPointer(state);
    z[0] = SUN_RCONST(0.3);
    z[1] = z[2] = 0;
    z[3] = SUN_RCONST(0.4);

    void *arkode = SPRKStepCreate(force, velocity, 0, state, context);
    check(arkode == NULL, "SPRKStepCreate");
    ARKodeSPRKTable table = ${name}_table();
    check(SPRKStepSetMethod(arkode, table), "SPRKStepSetMethod");
    check(ARKodeSetFixedStep(arkode, SUN_RCONST(0.25)), "ARKodeSetFixedStep");

    sunrealtype t = 0;
    for (int step = 0; step < 80; step++)
        check(ARKodeEvolve(arkode, 20, state, &t, ARK_ONE_STEP) < 0, "ARKodeEvolve");
    printf("q = %.17g %.17g\n", (double)z[0], (double)z[1]);
    printf("p = %.17g %.17g\n", (double)z[2], (double)z[3]);

    ARKodeFree(&arkode);
    ARKodeSPRKTable_Free(table);
    N_VDestroy(state);
    SUNContext_Free(&context);
    return 0;
}
