"""An integrator as a solver of diffrax, with a pair of terms as its ``SemiImplicitEuler``."""

from __future__ import annotations

from string import Template

from nearharmonic.exchange.method import Coefficients, head, names, remarks_of_python

TERMS = (
    "diffrax: the terms are a pair (velocity, force), the state is a pair (q, p): velocity(t, p, args) is dT/dp and "
    "force(t, q, args) is -dV/dq. The step size is constant; values between steps are interpolated linearly."
)
OWN_FORCE = "A step evaluates the force {count} times: the force at its end is not kept for the next step."
DOUBLES = "JAX computes in double precision at most: digits beyond 17 have no effect."

PROGRAM = Template("""\
$head
# Run: python $name.py

import diffrax
import jax
import jax.numpy as jnp

KICK = (
$kick
)
DRIFT = (
$drift
)


class $Name(diffrax.AbstractSolver):
    \"\"\"The solver; for ``diffrax.diffeqsolve`` with ``diffrax.ConstantStepSize()``.\"\"\"

    term_structure = (diffrax.AbstractTerm, diffrax.AbstractTerm)
    interpolation_cls = diffrax.LocalLinearInterpolation

    def order(self, terms):
        return $order

    def init(self, terms, t0, t1, y0, args):
        return None

    def func(self, terms, t0, y0, args):
        velocity, force = terms
        q, p = y0
        return velocity.vf(t0, p, args), force.vf(t0, q, args)

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        velocity, force = terms
        q, p = y0
        t = t0

        def kick(c, q, p, t):
            return q, moved(p, c, force.vf_prod(t, q, args, force.contr(t0, t1))), t

        def drift(c, q, p, t):
            return moved(q, c, velocity.vf_prod(t, p, args, velocity.contr(t0, t1))), p, t + c * (t1 - t0)

        q, p, t = $outer($OUTER[0], q, p, t)
        for c_$inner, c_$outer in zip($INNER, $OUTER[1:]):
            q, p, t = $inner(c_$inner, q, p, t)
            q, p, t = $outer(c_$outer, q, p, t)
        return (q, p), None, dict(y0=y0, y1=(q, p)), None, diffrax.RESULTS.successful


def moved(x, c, change):
    \"\"\"Return x + c change, leaf by leaf.\"\"\"
    return jax.tree.map(lambda a, b: a + c * b, x, change)


# Example, to be replaced: the Henon-Heiles system, V = (x^2 + y^2)/2 + x^2 y - y^3/3, T = (px^2 + py^2)/2.
def velocity(t, p, args):
    return p


def force(t, q, args):
    x, y = q
    return -jnp.array([x + 2 * x * y, y + x * x - y * y])


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    solution = diffrax.diffeqsolve(
        terms=(diffrax.ODETerm(velocity), diffrax.ODETerm(force)),
        solver=$Name(),
        t0=0,
        t1=20,
        dt0=0.25,
        y0=(jnp.array([0.3, 0.0]), jnp.array([0.0, 0.4])),
        stepsize_controller=diffrax.ConstantStepSize(),
    )
    q, p = solution.ys
    print("q =", *q[-1].tolist())
    print("p =", *p[-1].tolist())
""")


def write(coefficients: Coefficients) -> str:
    """Return the program, whose class has the name of the integrator."""
    called = names(coefficients)
    remarks = [TERMS, *remarks_of_python(coefficients, OWN_FORCE, DOUBLES)]
    return PROGRAM.substitute(
        called,
        head=head(coefficients, "#", *remarks),
        Name=called["name"].capitalize(),
        order=coefficients.tableau.order,
    )
