"""What all adapters share: the states of ``nh.integrate``, forces of a step, and methods and steps that are refused.

A driver of each library takes a method, a step and a number of steps, and runs Hénon-Heiles from (0.3, 0), (0, 0.4). It
returns the last q and p, and the number of forces that the library has asked for.
"""

from __future__ import annotations

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.errors import SettingError, UnknownNameError

pytestmark = [
    pytest.mark.usefixtures("double_precision"),
    # ASE 3.23 opens the null device for a log that nobody asks for, and closes it at the end of a `with` alone.
    pytest.mark.filterwarnings("ignore:.*null:ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

TAU = 0.25
#: Kick first and drift first; the last two are not symmetric.
METHODS = (
    "leapfrog", "babs7o7h", "trained_light", "aba864", "abas5o6h", "srkn_a14", "mclachlan_atela_3", "ruth_s3o3",
)  # fmt: skip
EPS = 2.0**-52


class Force:
    """The force of Hénon-Heiles, which counts its evaluations."""

    def __init__(self):
        self.calls = 0

    def __call__(self, q):
        self.calls += 1
        x, y = q
        return -np.array([x + 2 * x * y, y + x * x - y * y])


def in_ase(method, step, steps):
    ase = pytest.importorskip("ase")
    from ase.calculators.calculator import Calculator, all_changes

    force = Force()

    class HenonHeiles(Calculator):
        implemented_properties = ("energy", "forces")

        def calculate(self, atoms=None, properties=("energy",), system_changes=all_changes):
            super().calculate(atoms, properties, system_changes)
            self.results = {"energy": 0.0, "forces": np.array([[*force(atoms.positions[0, :2]), 0.0]])}

    atoms = ase.Atoms("H", positions=[[0.3, 0, 0]], masses=[1.0], momenta=[[0, 0.4, 0]])
    atoms.calc = HenonHeiles()
    nh.adapters.ase.Splitting(atoms, step, method).run(steps)
    return atoms.positions[0, :2], atoms.get_momenta()[0, :2], force.calls


def in_blackjax(method, step, steps):
    pytest.importorskip("blackjax", exc_type=ImportError)
    import jax
    import jax.numpy as jnp
    from blackjax.mcmc.integrators import new_integrator_state
    from blackjax.mcmc.metrics import gaussian_euclidean

    from support.oracles.counted_jax import counted_density

    force = Force()
    density = counted_density(lambda q: 0.0 * q[0], force, [])
    one = nh.adapters.blackjax.integrator(method)(density, gaussian_euclidean(jnp.ones(2)).kinetic_energy)
    state = new_integrator_state(density, jnp.array([0.3, 0.0]), jnp.array([0.0, 0.4]))
    state = jax.lax.scan(lambda state, _: (one(state, step), None), state, None, length=steps)[0]
    return np.asarray(state.position), np.asarray(state.momentum), force.calls


def in_diffrax(method, step, steps):
    diffrax = pytest.importorskip("diffrax", exc_type=ImportError)
    import jax.numpy as jnp

    from support.oracles.counted_jax import counted

    force, solver = Force(), nh.adapters.diffrax.Splitting(method)
    traced = counted(force, [])
    terms = diffrax.ODETerm(lambda t, p, args: p), diffrax.ODETerm(lambda t, q, args: traced(q))
    start = jnp.array([0.3, 0.0]), jnp.array([0.0, 0.4])
    q, p = diffrax.diffeqsolve(terms, solver, 0.0, steps * step, step, start).ys
    return np.asarray(q[-1]), np.asarray(p[-1]), force.calls


def in_jax_md(method, step, steps):
    pytest.importorskip("jax_md", exc_type=ImportError)
    import jax
    import jax.numpy as jnp

    from support.oracles.counted_jax import counted

    force = Force()
    traced = counted(force, [])
    init, apply = nh.adapters.jax_md.nve(lambda R, **_: traced(R[0])[None], lambda R, dR, **_: R + dR, step, method)
    state = init(jax.random.PRNGKey(0), jnp.array([[0.3, 0.0]]), kT=0.0).set(momentum=jnp.array([[0.0, 0.4]]))
    state = jax.lax.scan(lambda state, _: (apply(state), None), state, None, length=steps)[0]
    return np.asarray(state.position[0]), np.asarray(state.momentum[0]), force.calls


def in_mici(method, step, steps):
    mici = pytest.importorskip("mici")
    force = Force()
    system = mici.systems.EuclideanMetricSystem(
        neg_log_dens=lambda q: 0.0, grad_neg_log_dens=lambda q: -force(q), metric=np.ones(2)
    )
    integrator = nh.adapters.mici.integrator(system, step, method)
    state = mici.states.ChainState(pos=np.array([0.3, 0.0]), mom=np.array([0.0, 0.4]), dir=1)
    for _ in range(steps):
        state = integrator.step(state)
    return state.pos, state.mom, force.calls


def in_openmm(method, step, steps):
    mm = pytest.importorskip("openmm")
    integrator, force, system = nh.adapters.openmm.integrator(method, step), Force(), mm.System()
    if not hasattr(mm, "PythonForce"):
        pytest.skip("this OpenMM has no PythonForce to count with")
    system.addParticle(1.0)

    def computed(state):
        q = state.getPositions(asNumpy=True)._value[0, :2]
        return 0.0, np.array([[*force(q), 0.0]])

    system.addForce(mm.PythonForce(computed))
    context = mm.Context(system, integrator, mm.Platform.getPlatformByName("Reference"))
    context.setPositions([[0.3, 0, 0]])
    context.setVelocities([[0, 0.4, 0]])
    integrator.step(steps)
    state = context.getState(getPositions=True, getVelocities=True)
    q, p = (found(asNumpy=True)._value[0, :2] for found in (state.getPositions, state.getVelocities))
    return q, p, force.calls


def in_rebound(method, step, steps):
    rebound = pytest.importorskip("rebound", minversion="5")
    force, simulation = Force(), rebound.Simulation()
    simulation.add(m=1.0, x=0.3, y=0.0, vx=0.0, vy=0.4)

    def additional(pointer):
        moved = pointer.contents.particles[0]
        moved.ax, moved.ay = force((moved.x, moved.y))

    simulation.additional_forces = additional
    simulation.integrator, simulation.dt = nh.adapters.rebound.register(method), step
    simulation.steps(steps)
    (one,) = simulation.particles
    return one.xyz[:2], one.vxyz[:2], force.calls


def in_scipy(method, step, steps):
    solve_ivp = pytest.importorskip("scipy.integrate").solve_ivp
    force, solver = Force(), nh.adapters.scipy.solver(method, 2)
    end = steps * (step if isinstance(step, float) and np.isfinite(step) else 1.0)
    start = (0.3, 0.0, 0.0, 0.4)
    found = solve_ivp(lambda t, y: [*y[2:], *force(y[:2])], (0, end), start, method=solver, max_step=step)
    assert found.success
    assert found.nfev == force.calls
    return found.y[:2, -1], found.y[2:, -1], force.calls


def in_sundials(method, step, steps):
    pytest.importorskip("sundials4py")
    from sundials4py import arkode, core

    table, force = nh.adapters.sundials.table(method), Force()
    made, context = core.SUNContext_Create(core.SUN_COMM_NULL)
    assert made == core.SUN_SUCCESS
    state = core.N_VNew_Serial(4, context)
    z = core.N_VGetArrayPointer(state)
    z[:] = [0.3, 0.0, 0.0, 0.4]

    def kicked(t, vector, rates, _):
        core.N_VGetArrayPointer(rates)[2:] = force(core.N_VGetArrayPointer(vector)[:2])
        return 0

    def drifted(t, vector, rates, _):
        core.N_VGetArrayPointer(rates)[:2] = core.N_VGetArrayPointer(vector)[2:]
        return 0

    memory = arkode.SPRKStepCreate(kicked, drifted, 0.0, state, context)
    assert arkode.SPRKStepSetMethod(memory.get(), table) == arkode.ARK_SUCCESS
    assert arkode.ARKodeSetFixedStep(memory.get(), step) == arkode.ARK_SUCCESS
    for _ in range(steps):
        status, _ = arkode.ARKodeEvolve(memory.get(), steps * step, state, arkode.ARK_ONE_STEP)
        assert status >= 0
    return np.array(z[:2]), np.array(z[2:]), force.calls


#: Drivers by the name of the library as it writes itself.
DRIVERS = {
    "ASE": in_ase, "BlackJAX": in_blackjax, "diffrax": in_diffrax, "JAX MD": in_jax_md, "mici": in_mici,
    "OpenMM": in_openmm, "REBOUND": in_rebound, "scipy": in_scipy, "SUNDIALS": in_sundials,
}  # fmt: skip
COMPILED = {"BlackJAX", "diffrax", "JAX MD", "REBOUND"}
#: Libraries that take a step with the method, and the name of the step.
STEPS = {"ASE": "step", "JAX MD": "step", "mici": "step", "OpenMM": "step", "scipy": "max_step"}


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
    [
        pytest.param(library, name, marks=[pytest.mark.slow] * (library in COMPILED and name != "babs7o7h"))
        for library in DRIVERS
        for name in METHODS
        if library != "BlackJAX" or nh.integrators[name].symmetric
    ],
)
def test_states_are_those_of_integrate_at_a_force_a_stage(library, method):
    _, _, fewer = DRIVERS[library](method, TAU, 12)
    q, p, forces = DRIVERS[library](method, TAU, 15)
    tableau = nh.integrators[method]
    # Forces of the start, and those that are compared at other velocities, are in both runs.
    assert (forces - fewer) / 3 in forces_of_step(library, tableau)
    ours = nh.integrate("henon_heiles", method, TAU, t_end=15 * TAU, summation="plain")
    # Each of 15 (2 s + 1) moves rounds twice, and neighbours part by a factor below three in this time.
    tolerance = 15 * (2 * tableau.stages + 1) * 2 * 3 * EPS
    np.testing.assert_allclose(q, ours.q.values[-1], rtol=0, atol=tolerance)
    np.testing.assert_allclose(p, ours.p.values[-1], rtol=0, atol=tolerance)


@pytest.mark.parametrize("library", DRIVERS)
def test_unfit_methods_are_refused(library):
    with pytest.raises(UnknownNameError, match="'babs7o7h'"):
        DRIVERS[library]("babs7o7", TAU, 1)
    with pytest.raises(SettingError, match=f"modified potentials .*{library} has no hook"):
        DRIVERS[library]("chin_4a", TAU, 1)
    with pytest.raises(SettingError, match=f"cannot run in {library}"):
        DRIVERS[library]("rowlands", TAU, 1)


@pytest.mark.parametrize("step", [0, -0.1, np.nan, np.inf, True, "fast", [0.1], np.zeros(2)], ids=str)
@pytest.mark.parametrize("library", STEPS)
def test_bad_step_is_refused(library, step):
    with pytest.raises(SettingError, match=rf"{STEPS[library]} = "):
        DRIVERS[library]("leapfrog", step, 1)
