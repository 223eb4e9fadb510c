"""Contract of all adapters: the states of ``nh.integrate``, forces of a step, changed states, friction, and refusals.

A class for each library takes a method, a step and a force, and starts at (0.3, 0), (0, 0.4) with a mass of 1.
"""

from importlib.util import find_spec

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.adapters import PACKAGES
from nearharmonic.errors import SettingError, UnknownNameError

pytestmark = [
    pytest.mark.usefixtures("double_precision"),
    # ASE 3.23 opens the null device for a log that nobody asks for, and closes it at the end of a `with` alone.
    pytest.mark.filterwarnings("ignore:.*null:ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore:.* is deprecated:DeprecationWarning"),  # sympy, which JAX MD imports
]

TAU = 0.25
#: Kick first and drift first; the last two are not symmetric.
METHODS = (
    "leapfrog", "babs7o7h", "trained_light", "aba864", "abas5o6h", "srkn_a14", "mclachlan_atela_3", "ruth_s3o3",
)  # fmt: skip
EPS = 2.0**-52
START = (0.3, 0.0), (0.0, 0.4)


def henon_heiles(t, q, v):
    return -np.array([q[0] + 2 * q[0] * q[1], q[1] + q[0] ** 2 - q[1] ** 2])


class Force:
    """A force of time, position and velocity, which counts its evaluations."""

    def __init__(self, of=henon_heiles):
        self.of, self.calls = of, 0

    def __call__(self, q, v=None, t=None):
        self.calls += 1
        return np.asarray(self.of(t, np.asarray(q), v))


class InASE:
    def __init__(self, method, step, force):
        import ase
        from ase.calculators.calculator import Calculator, all_changes

        class Field(Calculator):
            implemented_properties = ("energy", "forces")

            def calculate(self, atoms=None, properties=("energy",), system_changes=all_changes):
                super().calculate(atoms, properties, system_changes)
                found = force(atoms.positions[0, :2], atoms.get_momenta()[0, :2])
                self.results = {"energy": 0.0, "forces": np.array([[*found, 0.0]])}

        self.atoms = ase.Atoms("H", positions=[[0, 0, 0]], masses=[1.0])
        self.change(*START)
        self.atoms.calc = Field()
        self.run = nh.adapters.ase.Splitting(self.atoms, step, method).run

    def change(self, q, p):
        self.atoms.positions[0, :2] = q
        self.atoms.set_momenta([[*p, 0]])

    def state(self):
        return self.atoms.positions[0, :2], self.atoms.get_momenta()[0, :2]


class InBlackJAX:
    def __init__(self, method, step, force):
        import jax.numpy as jnp
        from blackjax.mcmc.integrators import new_integrator_state
        from blackjax.mcmc.metrics import gaussian_euclidean

        from support.oracles.counted_jax import counted_density

        density = counted_density(lambda q: 0.0 * q[0], force, [])
        one = nh.adapters.blackjax.integrator(method)(density, gaussian_euclidean(jnp.ones(2)).kinetic_energy)
        self.now, self.step = new_integrator_state(density, *map(jnp.array, START)), lambda state: one(state, step)

    def run(self, steps):
        import jax

        self.now = jax.lax.scan(lambda state, _: (self.step(state), None), self.now, None, length=steps)[0]

    def state(self):
        return self.now.position, self.now.momentum


class InDiffrax:
    def __init__(self, method, step, force):
        import diffrax

        from support.oracles.counted_jax import counted

        self.solver, traced, self.step = nh.adapters.diffrax.Splitting(method), counted(force, []), step
        self.terms = diffrax.ODETerm(lambda t, p, args: p), diffrax.ODETerm(lambda t, q, args: traced(q))

    def run(self, steps):
        import diffrax
        import jax.numpy as jnp

        start = tuple(map(jnp.array, START))
        self.ys = diffrax.diffeqsolve(self.terms, self.solver, 0.0, steps * self.step, self.step, start).ys

    def state(self):
        return self.ys[0][-1], self.ys[1][-1]


class InJAXMD:
    def __init__(self, method, step, force):
        import jax

        from support.oracles.counted_jax import counted

        traced = counted(force, [])
        init, self.apply = nh.adapters.jax_md.nve(
            lambda R, **_: traced(R[0])[None], lambda R, dR, **_: R + dR, step, method
        )
        self.now = init(jax.random.PRNGKey(0), jax.numpy.zeros((1, 2)), kT=0.0)
        self.change(*START)

    def change(self, q, p):
        import jax.numpy as jnp

        self.now = self.now.set(position=jnp.array([q]), momentum=jnp.array([p]))

    def run(self, steps):
        import jax

        self.now = jax.lax.scan(lambda state, _: (self.apply(state), None), self.now, None, length=steps)[0]

    def state(self):
        return self.now.position[0], self.now.momentum[0]


class InMici:
    def __init__(self, method, step, force):
        import mici

        class Field(mici.systems.EuclideanMetricSystem):
            def dh1_dpos(self, state):
                return -force(state.pos, state.mom)

        given = {"neg_log_dens": lambda q: 0.0, "grad_neg_log_dens": lambda q: -force(q), "metric": np.ones(2)}
        kind = mici.systems.EuclideanMetricSystem if force.of is henon_heiles else Field
        self.integrator = nh.adapters.mici.integrator(kind(**given), step, method)
        self.now = mici.states.ChainState(pos=np.zeros(2), mom=np.zeros(2), dir=1)
        self.change(*START)

    def change(self, q, p):
        self.now.pos, self.now.mom = np.array(q), np.array(p)

    def run(self, steps):
        for _ in range(steps):
            self.now = self.integrator.step(self.now)

    def state(self):
        return self.now.pos, self.now.mom


class InOpenMM:
    def __init__(self, method, step, force):
        import openmm as mm

        integrator, system = nh.adapters.openmm.integrator(method, step), mm.System()
        system.addParticle(1.0)

        def computed(state):
            q = state.getPositions(asNumpy=True)._value[0, :2]
            return 0.0, np.array([[*force(q), 0.0]])

        if hasattr(mm, "PythonForce"):
            system.addForce(mm.PythonForce(computed))
        else:  # older versions compute the same force, and count nothing
            field = mm.CustomExternalForce("(x*x + y*y)/2 + x*x*y - y*y*y/3")
            field.addParticle(0, [])
            system.addForce(field)
        self.context = mm.Context(system, integrator, mm.Platform.getPlatformByName("Reference"))
        self.run = integrator.step
        self.change(*START)

    def change(self, q, p):
        self.context.setPositions([[*q, 0]])
        self.context.setVelocities([[*p, 0]])

    def state(self):
        state = self.context.getState(getPositions=True, getVelocities=True)
        return tuple(get(asNumpy=True)._value[0, :2] for get in (state.getPositions, state.getVelocities))


class InREBOUND:
    def __init__(self, method, step, force):
        import rebound

        self.simulation = rebound.Simulation()
        self.simulation.add(m=1.0)
        self.change(*START)

        def additional(pointer):
            one = pointer.contents.particles[0]
            one.ax, one.ay = force(one.xyz[:2], np.array(one.vxyz[:2]), pointer.contents.t)

        self.simulation.additional_forces = additional
        self.simulation.integrator, self.simulation.dt = nh.adapters.rebound.register(method), step
        self.run = self.simulation.steps

    def change(self, q, p):
        one = self.simulation.particles[0]
        (one.x, one.y), (one.vx, one.vy) = q, p

    def state(self):
        one = self.simulation.particles[0]
        return one.xyz[:2], one.vxyz[:2]


class InScipy:
    def __init__(self, method, step, force):
        end = 64 * (step if isinstance(step, float) and np.isfinite(step) else 1.0)
        field = lambda t, y: np.array([*y[2:], *force(y[:2], y[2:], t)])  # noqa: E731
        self.solver = nh.adapters.scipy.solver(method, 2)(field, 0.0, (*START[0], *START[1]), end, max_step=step)

    def change(self, q, p):
        self.solver.y = np.array([*q, *p])

    def run(self, steps):
        for _ in range(steps):
            self.solver.step()

    def state(self):
        return self.solver.y[:2], self.solver.y[2:]


class InSUNDIALS:
    def __init__(self, method, step, force):
        from sundials4py import arkode, core

        table, (made, context) = nh.adapters.sundials.table(method), core.SUNContext_Create(core.SUN_COMM_NULL)
        assert made == core.SUN_SUCCESS
        self.vector, self.context, self.taken, self.step = core.N_VNew_Serial(4, context), context, 0, step
        self.z = core.N_VGetArrayPointer(self.vector)
        self.z[:] = [*START[0], *START[1]]

        def kicked(t, vector, rates, _):
            core.N_VGetArrayPointer(rates)[2:] = force(core.N_VGetArrayPointer(vector)[:2])
            return 0

        def drifted(t, vector, rates, _):
            core.N_VGetArrayPointer(rates)[:2] = core.N_VGetArrayPointer(vector)[2:]
            return 0

        self.memory = arkode.SPRKStepCreate(kicked, drifted, 0.0, self.vector, context)
        assert arkode.SPRKStepSetMethod(self.memory.get(), table) == arkode.ARK_SUCCESS
        assert arkode.ARKodeSetFixedStep(self.memory.get(), step) == arkode.ARK_SUCCESS

    def run(self, steps):
        from sundials4py import arkode

        for _ in range(steps):
            end = steps * self.step
            assert arkode.ARKodeEvolve(self.memory.get(), end, self.vector, arkode.ARK_ONE_STEP)[0] >= 0

    def state(self):
        return np.array(self.z[:2]), np.array(self.z[2:])


#: Runs by the name of the library as it writes itself.
RUNS = {
    "ASE": InASE, "BlackJAX": InBlackJAX, "diffrax": InDiffrax, "JAX MD": InJAXMD, "mici": InMici,
    "OpenMM": InOpenMM, "REBOUND": InREBOUND, "scipy": InScipy, "SUNDIALS": InSUNDIALS,
}  # fmt: skip
COMPILED = {"BlackJAX", "diffrax", "JAX MD", "REBOUND"}
#: Libraries that take a step with the method, and the name of the step.
STEPS = {"ASE": "step", "JAX MD": "step", "mici": "step", "OpenMM": "step", "scipy": "max_step"}


def cases(libraries, *methods):
    """Parameters of each library and method; a library that is not installed is skipped by name."""
    found = []
    for library in libraries:
        package = PACKAGES[library.lower().replace(" ", "_")].replace("-", "_")
        absent = pytest.mark.skipif(find_spec(package) is None, reason=f"{library} is not installed")
        for given in [(name,) for name in methods] or [()]:
            marks = [absent, *[pytest.mark.slow] * (library in COMPILED and given not in [(), ("babs7o7h",)])]
            found.append(pytest.param(library, *given, marks=marks, id="-".join([library, *given])))
    return found


def ran(library, method, steps, force):
    run = RUNS[library](method, TAU, force)
    run.run(steps)
    return [np.array(part) for part in run.state()]


def forces_of_step(library, tableau):
    """Possible numbers of forces: the stages, and one more where a library keeps no force between two steps."""
    kick_first = tableau.first == "kick"
    own = {
        "BlackJAX": [not kick_first],  # the state holds the density at the end of each step
        "REBOUND": [kick_first and tableau.symmetric],  # particles may change between two steps
        # Versions up to 7.5 evaluate the force of the kick of zero of a method with drifts first, 7.9 does not.
        "SUNDIALS": [True] if kick_first and tableau.symmetric else [False, tableau.symmetric],
    }
    return [tableau.stages + more for more in own.get(library, [False])]


@pytest.mark.parametrize(
    ("library", "method"),
    [one for one in cases(RUNS, *METHODS) if one.values[0] != "BlackJAX" or nh.integrators[one.values[1]].symmetric],
)
def test_states_are_those_of_integrate_at_a_force_a_stage(library, method):
    fewer, force = Force(), Force()
    ran(library, method, 12, fewer)
    q, p = ran(library, method, 15, force)
    tableau = nh.integrators[method]
    if force.calls or library != "OpenMM":  # older versions of OpenMM cannot count
        # Forces of the start, and those that are compared at other velocities, are in both runs.
        assert (force.calls - fewer.calls) / 3 in forces_of_step(library, tableau)
    ours = nh.integrate("henon_heiles", method, TAU, t_end=15 * TAU, summation="plain")
    # Each of 15 (2 s + 1) moves rounds twice, and neighbours part by a factor below three in this time.
    tolerance = 15 * (2 * tableau.stages + 1) * 2 * 3 * EPS
    np.testing.assert_allclose(q, ours.q.values[-1], rtol=0, atol=tolerance)
    np.testing.assert_allclose(p, ours.p.values[-1], rtol=0, atol=tolerance)


@pytest.mark.parametrize(
    ("library", "method"),
    cases(["ASE", "JAX MD", "mici", "OpenMM", "REBOUND", "scipy"], "leapfrog", "babs7o7h", "abas5o6h"),
)
def test_changed_state_takes_a_fresh_force(library, method):
    run, fresh = (RUNS[library](method, TAU, Force()) for _ in range(2))
    run.run(3)
    for one in (run, fresh):
        one.change((0.1, -0.2), (0.3, 0.2))
        one.run(3)
    np.testing.assert_allclose(run.state(), fresh.state(), rtol=0, atol=1e-13)  # a batch of forces may round otherwise


@pytest.mark.parametrize(("library", "method"), cases(["REBOUND", "scipy"], *METHODS))
def test_force_is_evaluated_at_the_time_of_positions(library, method):
    """x'' = -x + cos 2t from rest at 0 has the solution (cos t - cos 2t) / 3."""

    def error(step):
        run = RUNS[library](method, step, Force(lambda t, q, v: -q + np.cos(2 * t)))
        run.change((0.0, 0.0), (0.0, 0.0))
        run.run(round(3.2 / step))
        return abs(run.state()[0][0] - (np.cos(3.2) - np.cos(6.4)) / 3)

    order = min(nh.integrators[method].order, 5)  # the error of order six is near rounding
    assert error(0.2) / error(0.1) > 2 ** (order - 0.5)


#: Forces that depend on velocities: at all states, or at some.
FRICTION = {
    "difference of velocities": lambda q, v: 0.3 * (v[::-1] - v),  # vanishes if all velocities are equal
    "weak": lambda q, v: -1e-3 * v,
    "where x < 0.2": lambda q, v: -v * (q[0] < 0.2),
    "above a speed": lambda q, v: -v * (abs(v) > 5),  # faster than the particle
}


@pytest.mark.parametrize("drag", FRICTION)
@pytest.mark.parametrize(
    ("library", "method"), cases(["ASE", "mici", "REBOUND", "scipy"], "leapfrog", "babs7o7h", "aba864")
)
def test_friction_is_refused(library, method, drag):
    force = Force(lambda t, q, v: henon_heiles(t, q, v) + FRICTION[drag](q, v))
    with pytest.raises((SettingError, RuntimeError), match=r"depends? on (the )?(velocities|momenta)"):
        ran(library, method, 40, force)


@pytest.mark.parametrize("library", cases(RUNS))
def test_unfit_methods_are_refused(library):
    with pytest.raises(UnknownNameError, match="'babs7o7h'"):
        RUNS[library]("babs7o7", TAU, Force())
    with pytest.raises(SettingError, match=f"modified potentials .*{library} has no hook"):
        RUNS[library]("chin_4a", TAU, Force())
    with pytest.raises(SettingError, match=f"cannot run in {library}"):
        RUNS[library]("rowlands", TAU, Force())


@pytest.mark.parametrize("step", [0, -0.1, np.nan, np.inf, True, "fast", [0.1], np.zeros(2)], ids=str)
@pytest.mark.parametrize("library", cases(STEPS))
def test_bad_step_is_refused(library, step):
    with pytest.raises(SettingError, match=rf"{STEPS[library]} = "):
        RUNS[library]("leapfrog", step, Force())
