"""An integrator as a program in C99: arrays, a function that takes steps, and the Hénon-Heiles system as an example."""

from __future__ import annotations

from string import Template

from nearharmonic.exchange.method import COEFFICIENTS_DOUBLE_DIGITS as DOUBLE_DIGITS
from nearharmonic.exchange.method import Coefficients, head, names

QUADRUPLE = (
    "More than 17 digits are for quadruple precision, _Float128 of GCC and glibc, which holds 36 of them at most."
)

PROGRAM = Template("""\
$head
// Compile and run: cc -std=c11 -O2 -o $name $name.c && ./$name

$includes

typedef $real real;

enum { ${name}_stages = $stages };

static const real ${name}_$outer[${name}_stages + 1] = {
$outer_rows
};

static const real ${name}_$inner[${name}_stages] = {
$inner_rows
};

// Your system, as two functions: kick(h, q, p) does p -= h dV/dq(q), drift(h, q, p) does q += h dT/dp(p).
typedef void substep(real h, real *q, real *p);

// Takes `steps` steps of length tau, from q and p to q and p.
void ${name}_steps(substep *kick, substep *drift, real tau, long steps, real *q, real *p)
{
    if (steps < 1)
        return;
    $outer(${name}_$outer[0] * tau, q, p);
    for (long step = 1; step <= steps; step++) {
        for (int i = 0; i < ${name}_stages; i++) {
            $inner(${name}_$inner[i] * tau, q, p);
            real c = ${name}_$outer[i + 1];
            if (i == ${name}_stages - 1 && step < steps)
                c += ${name}_$outer[0]; // the last $outer of this step and the first of the next are one
            $outer(c * tau, q, p);
        }
    }
}

// Example, to be replaced: the Henon-Heiles system, V = (x^2 + y^2)/2 + x^2 y - y^3/3, T = (px^2 + py^2)/2.
static void henon_heiles_kick(real h, real *q, real *p)
{
    real x = q[0], y = q[1];
    p[0] -= h * (x + 2 * x * y);
    p[1] -= h * (y + x * x - y * y);
}

static void henon_heiles_drift(real h, real *q, real *p)
{
    q[0] += h * p[0];
    q[1] += h * p[1];
}

$show

int main(void)
{
    real q[2] = {0.3$suffix, 0}, p[2] = {0, 0.4$suffix};
    ${name}_steps(henon_heiles_kick, henon_heiles_drift, 0.25, 80, q, p);
    show("q", q);
    show("p", p);
    return 0;
}
""")

SHOW_DOUBLE = """\
static void show(const char *label, const real *x)
{
    printf("%s = %.17g %.17g\\n", label, x[0], x[1]);
}"""

SHOW_QUADRUPLE = """\
static void show(const char *label, const real *x)
{
    char first[64], second[64];
    strfromf128(first, sizeof first, "%.36g", x[0]);
    strfromf128(second, sizeof second, "%.36g", x[1]);
    printf("%s = %s %s\\n", label, first, second);
}"""


def write(coefficients: Coefficients) -> str:
    """Return the program, in quadruple precision if the coefficients have more digits than a double."""
    quadruple = coefficients.digits > DOUBLE_DIGITS
    suffix = "f128" if quadruple else ""
    feature = "#define __STDC_WANT_IEC_60559_TYPES_EXT__ // for strfromf128\n"
    return PROGRAM.substitute(
        names(coefficients, f"{{}}{suffix}"),
        head=head(coefficients, "//", *([QUADRUPLE] if quadruple else [])),
        includes=f"{feature}#include <stdio.h>\n#include <stdlib.h>" if quadruple else "#include <stdio.h>",
        real="_Float128" if quadruple else "double",
        suffix=suffix,
        show=SHOW_QUADRUPLE if quadruple else SHOW_DOUBLE,
    )
