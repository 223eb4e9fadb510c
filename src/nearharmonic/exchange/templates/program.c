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
