"""Other libraries on the same systems and the same clock, each used as its users use it.

A function ``attempt(system, t_end, setting)`` prepares a run of a library. It imports the library, so that a missing
one is named as missing, and constructs and compiles what is not timed. :data:`PEERS` has what is timed.
"""

from __future__ import annotations

import ctypes
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib import import_module
from importlib.util import find_spec
from math import isfinite, nan
from pathlib import Path
from shutil import which
from string import Template
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.number import Constant, vector
from nearharmonic.engine.batch import unperturbed
from nearharmonic.exchange.method import method_for
from nearharmonic.integrators import blanes_2013, nielsen_2015
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.recommendation.measure import quiet
from nearharmonic.systems.gradients import SourceTracer, velocity
from nearharmonic.systems.system import System

States = NDArray[np.float64]

#: Maximum number of steps, which ends a diverging run.
MOST_STEPS = 200_000
#: Names of programs instead of modules.
COMPILERS = ("gcc",)
#: Methods of this package that are written without it, one with the drift first and one with the kick first; imported
#: from their files so that the code digest covers these.
ABA864, BAB9 = (
    tableau for tableau in (*blanes_2013.TABLEAUS, *nielsen_2015.TABLEAUS) if tableau.name in ("aba864", "babps9o7h")
)


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """One prepared run over [0, t_end].

    ``run``: timed call for one trajectory from start to end; it returns an object with the final state, without
    energies. ``path``: returns the states (n + 1, 2 d) at the solver's own steps, including the start, and the number
    of force evaluations (NaN if unknown). ``lanes``: timed call in SIMD lanes: ``members`` trajectories at once, each
    equal to the trajectory of ``run``; None if the Python interface of the library has no lanes. ``members``: number of
    trajectories in a call of ``lanes``.
    """

    run: Callable[[], Any]
    path: Callable[[], tuple[States, float]]
    lanes: Callable[[], Any] | None = None
    members: int = 1


@dataclass(frozen=True)
class Peer:
    """One solver of another library.

    ``name``, ``label``: name in files and name in legends. ``module``: the library, as it is imported, or the name of a
    compiler. ``attempt(system, t_end, setting)`` prepares a run. ``settings``: tolerances from coarse to fine; empty
    for step sizes, which come from the common grid. ``stages``: force evaluations per step, which convert step sizes
    per stage to step sizes. ``quadratic_only``: True if the solver needs accelerations that depend only on the
    position, as for T = p.p/2. ``gravity_only``: True if the solver is only for V = -GM/|q|. ``regularised``: True if
    the solver integrates the regularised equations of a system and supports no other system; all other solvers
    integrate the original equations.
    """

    name: str
    label: str
    module: str
    attempt: Callable[[System, float, float], Attempt]
    settings: tuple[float, ...] = ()
    stages: int = 1
    quadratic_only: bool = False
    gravity_only: bool = False
    regularised: bool = False

    @property
    def adaptive(self) -> bool:
        """True if a setting is a tolerance, False if it is a step size."""
        return bool(self.settings)


def start_of(system: System) -> States:
    """Return the initial state (2 d) of ``system``."""
    return np.concatenate(system.start(float))


def gradients_of(system: System) -> tuple[Callable[[States], States], Callable[[States], States]]:
    """Return dT/dp and dV/dq as functions of arrays (d) in numpy."""
    formulas, constants = system.formulas(), system.constants(float)
    if system.unit_masses:
        return lambda p: p, lambda q: np.array(formulas.grad_V(q, *constants))
    return lambda p: np.array(formulas.grad_T(tuple(p), *constants)), lambda q: np.array(formulas.grad_V(q, *constants))


# --- scipy ------------------------------------------------------------------------------------------------------------
#
# scipy's integrators: DOP853 of Hairer, Norsett & Wanner (1993), and LSODA of Petzold (1983), doi:10.1137/0904010.

#: Number of outputs of LSODA's path; it does not return its steps.
ODEINT_OUTPUTS = 1001


def scipy_dop853(system: System, t_end: float, tolerance: float) -> Attempt:
    """``scipy.integrate.solve_ivp(method="DOP853")`` with the right-hand side compiled by numba."""
    from scipy.integrate import solve_ivp

    rhs, start = _compiled_rhs(system, "t, y"), start_of(system)

    def run() -> Any:
        return solve_ivp(rhs, (0.0, t_end), start, method="DOP853", rtol=tolerance, atol=tolerance)

    def path() -> tuple[States, float]:
        solution = run()
        states = solution.y.T.copy()
        if not solution.success:
            states[-1] = nan
        return states, solution.nfev

    return Attempt(run=run, path=path)


def scipy_odeint(system: System, t_end: float, tolerance: float) -> Attempt:
    """``scipy.integrate.odeint`` with the right-hand side compiled by numba."""
    from scipy.integrate import odeint

    rhs, start = _compiled_rhs(system, "y, t"), start_of(system)

    def solve(times: States, **more: Any) -> Any:
        return odeint(rhs, start, times, rtol=tolerance, atol=tolerance, mxstep=MOST_STEPS, **more)

    def path() -> tuple[States, float]:
        states, told = solve(np.linspace(0.0, t_end, ODEINT_OUTPUTS), full_output=True)
        if "successful" not in told["message"]:
            states[-1] = nan
        return states, float(solve(np.array([0.0, t_end]), full_output=True)[1]["nfe"][-1])

    return Attempt(run=lambda: solve(np.array([0.0, t_end])), path=path)


@cache
def _compiled_rhs(system: System, arguments: str) -> Callable[..., States]:
    """Return dy/dt as a function of the state y and the time t, in the order of ``arguments``, compiled by numba."""
    import numba

    unpacked = ", ".join(f"y[{i}]" for i in range(2 * system.dimension))
    space: dict[str, Any] = {"inner": numba.njit(velocity(system)), "array": np.array}
    exec(f"def rhs({arguments}):\n    return array(inner({unpacked}))\n", space)
    rhs: Callable[..., States] = numba.njit(space["rhs"])
    rhs(y=start_of(system), t=0.0)
    return rhs


# --- heyoka -----------------------------------------------------------------------------------------------------------
#
# The adaptive Taylor series (Biscani & Izzo 2021, doi:10.1093/mnras/stab1032), scalar and in batches of lanes.
#
# The equations are the formulas of the system. For V = -GM/|q| there are also the equations that are best for heyoka,
# with ``GM * (x*x + y*y)**-1.5`` written as a power; its own ``model.fixed_centres`` is 4 to 9 % slower than the
# formulas, and ``hamiltonian()`` of the system's potential a quarter slower. ``high_accuracy`` stays off, which is the
# default.
#
# Where a regularisation is known, the regularised equations are the best that users of heyoka can do. With the
# fictitious time s as the variable: u' = v, v' = -dV/du with V of
# :class:`nearharmonic.systems.formulas.RegularisedFormulas`, and t' = |u|^2. heyoka's tolerance is relative to
# the largest component of the state, so t is scaled by ``t_end``. w = -H is a constant, not a component. Two choices
# favour heyoka. The fictitious time at which t = ``t_end`` is computed before the timing, by dense output and Newton's
# method. The timed run ends with (u, v, t), without the map to q and p. Errors refer to q and p.

TAYLOR_TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15)
#: Number of doubles in a batch: a register of AVX-512.
BATCH = 8
#: Iterations of Newton's method for the final fictitious time; four are sufficient.
REPEATS = 8


def heyoka_taylor(
    system: System, t_end: float, tolerance: float, *, fast_math: bool = False, power: bool = False
) -> Attempt:
    """Prepare ``heyoka.taylor_adaptive``, whose order follows from the tolerance, and ``taylor_adaptive_batch``.

    ``fast_math`` lets heyoka reorder floating-point operations. ``power`` writes the force GM q (q.q)^(-3/2) as a power
    in place of the formula of the system.
    """
    import heyoka as hy

    names = [f"{letter}{i}" for letter in "qp" for i in range(system.dimension)]
    variables = hy.make_vars(*names)
    if power:
        q, p = variables[: system.dimension], variables[system.dimension :]
        pull = system.constants(float)[0] * sum(x * x for x in q) ** -1.5
        rates = [*p, *(-pull * x for x in q)]
    else:
        rates = velocity(system, functions_of(hy))(*variables)
    return taylor_attempt(list(zip(variables, rates, strict=True)), start_of(system), t_end, tolerance, fast_math)


def taylor_attempt(equations: Sequence[Any], start: States, end: float, tolerance: float, fast_math: bool) -> Attempt:
    """Prepare one trajectory and a batch of equal ones.

    ``equations``: pairs of heyoka's variables and their derivatives. ``start`` (n,): the variables at 0. ``end``: end
    of the interval of the independent variable.
    """
    import heyoka as hy

    starts = np.repeat(start[:, None], BATCH, axis=1)
    solver = hy.taylor_adaptive(equations, list(start), tol=tolerance, fast_math=fast_math)
    batch = hy.taylor_adaptive_batch(equations, starts.copy(), tol=tolerance, fast_math=fast_math)

    def reset() -> None:
        solver.time = 0.0
        solver.state[:] = start

    def run() -> Any:
        reset()
        solver.propagate_until(end)
        return solver.state

    def path() -> tuple[States, float]:
        reset()
        states = [start]
        while solver.time < end and len(states) < MOST_STEPS and np.isfinite(states[-1]).all():
            solver.step(end - solver.time)
            states.append(solver.state.copy())
        return np.array(states), nan

    def lanes() -> Any:
        batch.set_time(0.0)
        batch.state[:] = starts
        batch.propagate_until(end)
        return batch.state

    return Attempt(run=run, path=path, lanes=lanes, members=BATCH)


def functions_of(hy: Any) -> dict[str, Any]:
    """Return the functions of formulas as heyoka's expressions; missing functions use roots and powers."""
    own = ("sqrt", "sin", "cos", "tan", "exp", "log", "atan2", "tanh", "sinh", "cosh", "erf")
    derived = {
        "abs": lambda x: hy.sqrt(x * x),
        "pow": lambda x, y: (x if isinstance(x, hy.expression) else hy.expression(x)) ** y,
        "cbrt": lambda x: x * (x * x) ** (-1 / 3),
        "hypot": lambda x, y: hy.sqrt(x * x + y * y),
    }
    return {name: getattr(hy, name) for name in own} | derived


def heyoka_regularised(system: System, t_end: float, tolerance: float, *, fast_math: bool = False) -> Attempt:
    """As :func:`heyoka_taylor`, on the equations of a regularised system; TimeoutError: the end is not reached."""
    import heyoka as hy

    maps = system.formulas().regularised
    assert maps is not None
    (*u0, w), (*v0, _) = maps.from_physical(*system.start(float), *system.constants(float))
    start = np.array([*u0, *v0, 0.0], dtype=float)
    equations = _equations(hy, system, maps.coordinates, float(w), t_end)
    end = _fictitious_end(hy.taylor_adaptive(equations, list(start), tol=tolerance, fast_math=fast_math))
    attempt = taylor_attempt(equations, start, end, tolerance, fast_math)

    def path() -> tuple[States, float]:
        states, evaluations = attempt.path()
        u, v, _ = np.split(states.T, [len(v0), 2 * len(v0)])
        return np.concatenate([np.array(half) for half in maps.to_physical((*u, float(w)), (*v, 0.0))]).T, evaluations

    return replace(attempt, path=path)


def _equations(hy: Any, system: System, coordinates: int, w: float, t_end: float) -> list[tuple[Any, Any]]:
    """Return the derivatives of (u, v, t/t_end) by s, as in this package; without perturbation if its strength is 0."""
    d = coordinates - 1
    given = system.regularisation
    assert given is not None
    if given.strength is not None and float(system.parameters[given.strength].value) == 0:
        system = unperturbed(system)
    names = [*(f"u{i}" for i in range(d)), *(f"v{i}" for i in range(d)), "t"]
    variables = hy.make_vars(*names)
    u, v = variables[:d], variables[d:-1]
    # The momentum of w is -t/4.
    *rates, clock = velocity(system, functions_of(hy))(*u, hy.expression(w), *v, hy.expression(0.0))
    return list(zip(variables, [*rates[:d], *rates[d + 1 :], -4 / t_end * clock], strict=True))


def _fictitious_end(solver: Any) -> float:
    """Return the s at which the last component of the state, which increases, is 1."""
    for _ in range(MOST_STEPS):
        before = solver.time
        solver.step(write_tc=True)
        if not isfinite(solver.state[-1]):
            raise ArithmeticError("the run has left its orbit")
        if solver.state[-1] >= 1:
            break
    else:
        raise TimeoutError
    series = solver.tc[-1]
    h = solver.time - before
    for _ in range(REPEATS):
        h -= (np.polyval(series[::-1], h) - 1) / np.polyval(np.polyder(series[::-1]), h)
    return float(before + h)


# --- rebound ----------------------------------------------------------------------------------------------------------
#
# Its own gravity in C for V = -GM/|q|, other forces as C functions compiled by numba.
#
# IAS15 is by Rein & Spiegel (2015), doi:10.1093/mnras/stu2164. WHFast is omitted: for two bodies it uses the
# closed form of the ellipse. A force in Python instead of C would dominate the time: the leapfrog of order 8 would take
# about a hundred times as long.

#: Time limit of a path in seconds: the steps of IAS15 can become extremely small if a force passes through 0.
PATH_SECONDS = 2.0
#: First step of an adaptive run, as a fraction of the interval.
FIRST_STEP = 1e-4


def rebound_attempt(system: System, t_end: float, setting: float, *, integrator: str) -> Attempt:
    """Prepare IAS15 with a tolerance as its epsilon, or steps of the leapfrog composed to order 8."""
    adaptive = integrator == "ias15"
    options: dict[str, float] = {"epsilon": setting} if adaptive else {"order": 8}
    steps = 0 if adaptive else max(1, round(t_end / setting))
    keys, start = _keys(system), start_of(system).tolist()

    def begin(simulation: Any) -> Any:
        """Set time, first step and integrator, which resets its state; return the body, at its start."""
        simulation.integrator = integrator
        for key, value in options.items():
            setattr(simulation.integrator, key, value)
        simulation.t, simulation.dt = 0.0, t_end / steps if steps else t_end * FIRST_STEP
        body = simulation.particles[-1]
        for key, value in zip(keys, start, strict=True):
            setattr(body, key, value)
        return body

    def run() -> Any:
        body = begin(prepared)
        if steps:
            prepared.steps(steps)
        else:
            prepared.integrate(t_end)
        return body

    def path() -> tuple[States, float]:
        count = ctypes.c_double()
        simulation = rebound_simulation(system, count)
        if system.gravity:  # rebound does not count evaluations; an additional force that only counts does this
            simulation.additional_forces = compiled_force(None).address
        body, states, deadline = begin(simulation), [start_of(system)], time.perf_counter() + PATH_SECONDS
        while len(states) <= steps if steps else simulation.t < t_end:
            if steps or simulation.t + simulation.dt < t_end:
                simulation.steps(1)
            else:
                simulation.integrate(t_end)
            states.append(np.array([getattr(body, key) for key in keys]))
            if not np.isfinite(states[-1]).all():
                break
            if time.perf_counter() > deadline:
                raise TimeoutError(f"{integrator} is not at the end after {PATH_SECONDS} s")
        return np.array(states), count.value

    prepared = rebound_simulation(system, ctypes.c_double())
    return Attempt(run=run, path=path)


def rebound_simulation(system: System, count: ctypes.c_double) -> Any:
    """Return a simulation at the start, the moving body last; ``count`` counts evaluations of a compiled force."""
    import rebound

    made = rebound.Simulation()
    particle = dict(zip(_keys(system), start_of(system), strict=True))
    if system.gravity:
        (made.G,) = system.constants(float)
        made.add(m=1.0)
        made.add(m=0.0, **particle)
    else:
        made.gravity = "none"
        made.add(m=1.0, **particle)
        made.additional_forces = compiled_force(system).address
    made.extras, made._extras_ref = ctypes.addressof(count), count  # the reference keeps the double alive
    return made


def _keys(system: System) -> tuple[str, ...]:
    """Return rebound's names of the components of a state (2 d)."""
    d = system.dimension
    return ("x", "y", "z")[:d] + ("vx", "vy", "vz")[:d]


@cache
def compiled_force(system: System | None) -> Any:
    """Compile a C function of a ``reb_simulation`` with numba that sets the acceleration of its first particle.

    It adds 1 to the double that ``extras`` of the simulation points to; if ``system`` is None, it does only that. It
    reads simulation and particle as arrays of eight-byte words, at the offsets of rebound's own ctypes definitions.
    """
    import numba
    import rebound

    def word(structure: Any, name: str) -> int:
        return int(getattr(structure, name).offset) // 8

    space: dict[str, Any] = {}
    body = [f"simulation[{word(rebound.Simulation, 'extras')}][0] += 1.0"]
    if system is not None:
        space["velocity"] = numba.njit(velocity(system), error_model="numpy")
        state = [f"particle[{word(rebound.Particle, key)}]" for key in _keys(system)]
        body += [f"particle = simulation[{word(rebound.Simulation, '_particles')}]"]
        body += [f"rates = velocity({', '.join(state)})"]
        accelerations = ("ax", "ay", "az")[: system.dimension]
        body += [
            f"particle[{word(rebound.Particle, key)}] = rates[{i}]"
            for i, key in enumerate(accelerations, start=system.dimension)
        ]
    exec("def force(simulation):\n" + "".join(f"    {line}\n" for line in body), space)
    doubles = numba.types.CPointer(numba.types.float64)
    return numba.cfunc(numba.types.void(numba.types.CPointer(doubles)), error_model="numpy")(space["force"])


# --- diffrax ----------------------------------------------------------------------------------------------------------
#
# Dopri8 (Kidger 2022, arXiv:2202.02435) with adaptive steps, in double precision on the processor. The equations are
# the formulas of the system. JAX compiles the whole integration, without gradients.

#: Maximum number of steps of a path, and evaluations per step; the first is the last of the previous step.
LONGEST_PATH, STAGES = 2**15, 13


def diffrax_dopri8(system: System, t_end: float, tolerance: float) -> Attempt:
    """``diffrax.diffeqsolve`` with ``Dopri8`` and a ``PIDController``, under ``jax.jit``."""
    import diffrax
    import jax

    last, every = _compiled_solver(system)
    start = start_of(system)

    def run() -> States:
        with jax.enable_x64(True):
            return np.asarray(last(start, t_end, tolerance))

    def path() -> tuple[States, float]:
        with jax.enable_x64(True):
            solution = every(start, t_end, tolerance)
            steps, attempted = (int(solution.stats[f"num_{which}steps"]) for which in ("accepted_", ""))
            states = np.concatenate([start[None], np.asarray(solution.ys)[:steps]])
            reached = bool(solution.result == diffrax.RESULTS.successful)
        if not reached:
            states[-1] = nan
        return states, float(STAGES * attempted)

    for call in (run, path):
        call()  # the first call for a system compiles
    return Attempt(run=run, path=path)


@cache
def _compiled_solver(system: System) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Functions of the initial state, the end and the tolerance: the final state, and a solution with every step."""
    import diffrax
    import jax

    names = ("sqrt", "sin", "cos", "tan", "exp", "log", "atan2", "tanh", "sinh", "cosh", "hypot", "cbrt", "pow")
    functions = {name: getattr(jax.numpy, name) for name in names} | {"erf": jax.scipy.special.erf}
    rates = velocity(system, functions)

    def vector_field(t: Any, y: Any, args: Any) -> Any:
        return jax.numpy.stack(rates(*y))

    def solve(y0: Any, t_end: Any, tolerance: Any, save: Any) -> Any:
        return diffrax.diffeqsolve(
            diffrax.ODETerm(vector_field), diffrax.Dopri8(), 0.0, t_end, None, y0, saveat=save, max_steps=LONGEST_PATH,
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance), throw=False,
        )  # fmt: skip

    return (
        jax.jit(lambda y0, t_end, tolerance: solve(y0, t_end, tolerance, diffrax.SaveAt(t1=True)).ys[-1]),
        jax.jit(lambda y0, t_end, tolerance: solve(y0, t_end, tolerance, diffrax.SaveAt(steps=True))),
    )


# --- pyhamsys ---------------------------------------------------------------------------------------------------------


def pyhamsys_bm6(system: System, t_end: float, step: float) -> Attempt:
    """The sixth-order composition BM6 of Blanes & Moan (2002), doi:10.1016/S0377-0427(01)00492-7, flows in numpy."""
    from pyhamsys import HamSys, Parameters

    start = start_of(system)
    grad_T, grad_V = gradients_of(system)
    count = [0]

    def chi(h: float, t: float, y: States) -> States:
        q, p = np.split(y, 2)
        count[0] += 1
        p = p - h * grad_V(q)
        return np.concatenate((q + h * grad_T(p), p))

    def chi_star(h: float, t: float, y: States) -> States:
        q, p = np.split(y, 2)
        count[0] += 1
        q = q + h * grad_T(p)
        return np.concatenate((q, p - h * grad_V(q)))

    flows = HamSys(ndof=system.dimension, chi=chi, chi_star=chi_star)
    settings = Parameters(step=step, solver="BM6", display=False)
    ends = np.array([0.0, t_end])

    def path() -> tuple[States, float]:
        states: list[States] = []
        count[0] = 0
        flows.integrate(start, ends, settings, command=lambda t, y: states.append(y.copy()))
        return np.array(states), count[0]

    return Attempt(run=lambda: flows.integrate(start, ends, settings), path=path)


# --- Methods of this package written without a library: in numpy, and as a loop in C compiled with gcc ----------------


def numpy_splitting(tableau: Tableau) -> Callable[[System, float, float], Attempt]:
    """Return the method ``tableau`` in numpy; the next step reuses the force of the last kick."""

    def attempt(system: System, t_end: float, step: float) -> Attempt:
        steps = max(1, round(t_end / step))
        tau, start = t_end / steps, start_of(system)
        grad_T, grad_V = gradients_of(system)
        moves = [(move.flow == "kick", move.coefficient * tau) for move in method_for("numpy", tableau).flows]

        def run(seen: Callable[[States, States], None] = lambda q, p: None) -> tuple[States, States]:
            q, p = np.split(start.copy(), 2)
            force: States | None = grad_V(q)
            for _ in range(steps):
                for kicks, length in moves:
                    if kicks:
                        force = grad_V(q) if force is None else force
                        p = p - length * force
                    else:
                        q, force = q + length * grad_T(p), None
                seen(q, p)
            return q, p

        def path() -> tuple[States, float]:
            states = [start]
            run(lambda q, p: states.append(np.concatenate((q, p))))
            return np.array(states), tableau.stages * steps + 1

        return Attempt(run=run, path=path)

    return attempt


#: The compiler may contract products and sums, which is its default.
FLAGS = ("-O3", "-march=native", "-ffp-contract=fast", "-shared", "-fPIC")
#: The last kick of a step and the first kick of the next are merged.
PROGRAM = Template("""\
#include <math.h>

enum { stages = $stages };
static const double kick[stages + 1] = { $kick };
static const double drift[stages] = { $drift };

static inline void kicked(double h, const double *q, double *p)
{
$kicked
}

static inline void drifted(double h, double *q, const double *p)
{
$drifted
}

/* `steps` steps of length tau, from state to state: the positions, then the momenta. */
void integrate(long steps, double tau, double *state)
{
    double q[$d], p[$d];
    for (int k = 0; k < $d; k++) { q[k] = state[k]; p[k] = state[$d + k]; }
    kicked(kick[0] * tau, q, p);
    for (long step = 1; step <= steps; step++) {
        for (int i = 0; i < stages; i++) {
            drifted(drift[i] * tau, q, p);
            kicked((i == stages - 1 && step < steps ? kick[stages] + kick[0] : kick[i + 1]) * tau, q, p);
        }
    }
    for (int k = 0; k < $d; k++) { state[k] = q[k]; state[$d + k] = p[k]; }
}

/* The state after each step, the first row being the start. */
void path(long steps, double tau, double *states)
{
    for (long step = 0; step < steps; step++) {
        double *next = states + (step + 1) * 2 * $d;
        for (int k = 0; k < 2 * $d; k++) next[k] = next[k - 2 * $d];
        integrate(1, tau, next);
    }
}
""")


class CTracer(SourceTracer):
    """A symbolic number that records each operation as one line of C."""

    __slots__ = ()

    def __abs__(self) -> SourceTracer:
        return self._line(f"fabs({self.name})")

    def whole_power(self, exponent: int) -> SourceTracer:
        product = " * ".join([self.name] * abs(exponent)) or "1.0"
        return self._line(product if exponent >= 0 else f"1.0 / ({product})")


def c_text(system: System, tableau: Tableau) -> str:
    """Return the text of a C program with ``integrate(steps, tau, state)`` for a method that begins with a kick."""
    kick, drift = (", ".join(map(repr, row)) for row in tableau.rows_double())
    return PROGRAM.substitute(
        stages=tableau.stages, kick=kick, drift=drift, d=system.dimension,
        kicked=_substep(system, "grad_V", "q", "p[{}] -= h * {};"),
        drifted=_substep(system, "grad_T", "p", "q[{}] += h * {};"),
    )  # fmt: skip


def _substep(system: System, gradient: str, of: str, update: str) -> str:
    lines: list[str] = []
    entries = tuple(CTracer(f"{of}[{i}]", lines) for i in range(system.dimension))
    rates = vector(system.formulas(), gradient, entries, *system.constants(Constant))
    text = [rate.name if isinstance(rate, SourceTracer) else repr(float(rate)) for rate in rates]
    updates = [update.format(i, name) for i, name in enumerate(text)]
    return "\n".join(f"    {line}" for line in (*(f"const double {line};" for line in lines), *updates))


@cache
def _compiled_loop(system: System) -> Any:
    """Return the compiled and loaded program."""
    with TemporaryDirectory() as folder:
        library = Path(folder) / "loop.so"
        command = ["gcc", *FLAGS, "-x", "c", "-", "-o", str(library), "-lm"]
        subprocess.run(command, input=c_text(system, BAB9), text=True, check=True, capture_output=True)
        loaded = ctypes.CDLL(str(library))
    for function in (loaded.integrate, loaded.path):
        function.argtypes = (ctypes.c_long, ctypes.c_double, ctypes.c_void_p)
        function.restype = None
    return loaded


def c_loop(system: System, t_end: float, step: float) -> Attempt:
    """BAB's9o7H in C, called with an array that holds the state."""
    program, start = _compiled_loop(system), start_of(system)
    steps = max(1, round(t_end / step))
    tau, state = t_end / steps, start.copy()
    address = state.ctypes.data

    def run() -> States:
        state[:] = start
        program.integrate(steps, tau, address)
        return state

    def path() -> tuple[States, float]:
        states = np.empty((steps + 1, start.size))
        states[0] = start
        program.path(steps, tau, states.ctypes.data)
        return states, BAB9.stages * steps + 1

    return Attempt(run=run, path=path)


#: Tolerances of scipy, whose smallest is 2.3e-14.
SCIPY_TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 3e-14)
#: Forms of the equations for heyoka: endings of names, labels without and with ``fast_math``, and systems.
HEYOKA: tuple[tuple[str, tuple[str, str], Callable[..., Attempt], dict[str, bool]], ...] = (
    ("", ("heyoka (adaptive Taylor)", "heyoka, fast_math"), heyoka_taylor, {}),
    ("_power", ("heyoka, force as a power", "heyoka, power, fast_math"), partial(heyoka_taylor, power=True),
     {"gravity_only": True}),
    ("_regularised", ("heyoka, regularised equations", "heyoka, regularised, fast_math"), heyoka_regularised,
     {"regularised": True}),
)  # fmt: skip
#: Every peer by name, in the order of legends. The default tolerance of IAS15 is 1e-9.
PEERS = {
    peer.name: peer
    for peer in (
        Peer("scipy_dop853", "scipy solve_ivp (DOP853, numba)", "scipy", scipy_dop853, SCIPY_TOLERANCES),
        Peer("scipy_odeint", "scipy odeint (LSODA, numba)", "scipy", scipy_odeint, SCIPY_TOLERANCES),
        *(
            Peer(f"heyoka{form}{ending}", label, "heyoka", partial(attempt, fast_math=bool(ending)), TAYLOR_TOLERANCES,
                 **only)
            for form, labels, attempt, only in HEYOKA
            for ending, label in zip(("", "_fast_math"), labels, strict=True)
        ),
        Peer("rebound_ias15", "rebound IAS15", "rebound", partial(rebound_attempt, integrator="ias15"),
             (1e-2, 1e-4, 1e-6, 1e-9), quadratic_only=True),
        Peer("rebound_leapfrog8", "rebound leapfrog, order 8", "rebound",
             partial(rebound_attempt, integrator="leapfrog"), stages=17, quadratic_only=True),
        Peer("diffrax_dopri8", "diffrax Dopri8 (JAX, compiled)", "diffrax", diffrax_dopri8, SCIPY_TOLERANCES[:-1]),
        Peer("pyhamsys_bm6", "pyhamsys BM6", "pyhamsys", pyhamsys_bm6, stages=20),
        *(
            Peer(f"numpy_{tableau.name}", f"{tableau.label} in plain numpy", "numpy", numpy_splitting(tableau),
                 stages=tableau.stages)
            for tableau in (ABA864, BAB9)
        ),
        Peer(f"c_{BAB9.name}", f"{BAB9.label}, a plain loop in C", "gcc", c_loop, stages=BAB9.stages),
    )
}  # fmt: skip

#: Every library, as it is imported, and every compiler.
LIBRARIES = tuple(dict.fromkeys(peer.module for peer in PEERS.values()))


def is_installed(library: str) -> bool:
    """Return True if ``library``, a compiler or a module, exists; the module is not imported."""
    return (which(library) if library in COMPILERS else find_spec(library)) is not None


def missing(library: str) -> str:
    """Return the reason why ``library`` cannot be used, for a table; empty if it can."""
    if library in COMPILERS:
        return "" if is_installed(library) else "not installed"
    try:
        with quiet():
            import_module(library)
    except ModuleNotFoundError:
        return "not installed"
    except (ImportError, OSError) as error:
        return f"cannot be imported: {error}"
    return ""


def version_of(library: str) -> str:
    """Return the installed version of ``library``."""
    from importlib.metadata import PackageNotFoundError, version

    if library in COMPILERS:
        return subprocess.run([library, "-dumpfullversion"], check=True, capture_output=True, text=True).stdout.strip()
    try:
        return version(library)
    except PackageNotFoundError:
        return "unknown"
