/* Leapfrog, kick first, of a Fermi-Pasta-Ulam-Tsingou chain and of gravitating bodies, as a C programmer writes it.
   A state is positions, carries of positions, momenta, carries of momenta, as in the kernels. */

#include <math.h>
#include <stdlib.h>

static void chain_force(int n, const double *q, double *force) {
    for (int i = 0; i < n; i++) {
        double left = q[i] - (i > 0 ? q[i - 1] : 0.0), right = (i < n - 1 ? q[i + 1] : 0.0) - q[i];
        force[i] = (right + 0.1 * right * right * right) - (left + 0.1 * left * left * left);
    }
}

static void bodies_force(int n, const double *q, const double *mass, double *force) {
    for (int i = 0; i < 3 * n; i++) force[i] = 0.0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < i; j++) {
            double x = q[3 * i] - q[3 * j], y = q[3 * i + 1] - q[3 * j + 1], z = q[3 * i + 2] - q[3 * j + 2];
            double square = x * x + y * y + z * z, pull = mass[i] * mass[j] / (square * sqrt(square));
            force[3 * i] -= pull * x, force[3 * i + 1] -= pull * y, force[3 * i + 2] -= pull * z;
            force[3 * j] += pull * x, force[3 * j + 1] += pull * y, force[3 * j + 2] += pull * z;
        }
}

static void add_plain(int d, double *x, double h, const double *rate, const double *mass) {
    for (int i = 0; i < d; i++) x[i] += h * (mass ? rate[i] / mass[i / 3] : rate[i]);
}

static void add_compensated(int d, double *x, double *carry, double h, const double *rate, const double *mass) {
    for (int i = 0; i < d; i++) {
        double increment = h * (mass ? rate[i] / mass[i / 3] : rate[i]) + carry[i], total = x[i] + increment;
        carry[i] = increment + (x[i] - total);
        x[i] = total;
    }
}

/* Steps of size tau of a chain of n sites (mass NULL) or of n bodies. */
void leapfrog(long steps, double tau, int n, const double *mass, int compensated, double *state) {
    int d = mass ? 3 * n : n;
    double *q = state, *p = state + 2 * d, *force = malloc(d * sizeof(double));
    if (mass) bodies_force(n, q, mass, force); else chain_force(n, q, force);
    for (long step = 0; step < steps; step++) {
        if (compensated) {
            add_compensated(d, p, p + d, tau / 2, force, NULL);
            add_compensated(d, q, q + d, tau, p, mass);
        } else {
            add_plain(d, p, tau / 2, force, NULL);
            add_plain(d, q, tau, p, mass);
        }
        if (mass) bodies_force(n, q, mass, force); else chain_force(n, q, force);
        if (compensated) add_compensated(d, p, p + d, tau / 2, force, NULL);
        else add_plain(d, p, tau / 2, force, NULL);
    }
    free(force);
}
