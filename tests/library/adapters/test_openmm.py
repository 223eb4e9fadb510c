"""Integrators in OpenMM: forces per step, trajectories, heat bath and constraints."""

import re

import numpy as np
import pytest

import nearharmonic as nh

mm = pytest.importorskip("openmm", reason="the adapter needs the extra [openmm]")
unit = mm.unit
from nearharmonic.adapters.openmm import integrator  # noqa: E402  # after importorskip

MASSES = (2.0, 3.0, 5.0)
#: Force constants in kJ/mol/nm^2 and kJ/mol/nm^4.
HARMONIC, QUARTIC, BOND = 400.0, 9000.0, 2500.0
START = np.array([[0.1, 0.02, -0.05], [-0.08, 0.11, 0.03], [0.04, -0.06, 0.12]])
VELOCITIES = np.array([[0.4, -1.0, 0.2], [0.8, 0.3, -0.5], [-0.6, 0.1, 0.9]])
#: A tenth of the shortest period, about 0.3 ps, in ps.
STEP = 0.02
#: Rounding of 100 steps at double precision grows along with the phase: 1e-16 times a few thousand operations.
ROUNDING = 1e-11
BOLTZMANN = 0.0083144626  # kJ/mol/K, CODATA 2018


def force(x):
    found = -HARMONIC * x - 4 * QUARTIC * x**3
    bond = BOND * (x[1] - x[0])
    return found + np.array([bond, -bond, np.zeros(3)])


def wells(counter=None):
    """Three particles in a quartic well, two of them bound by a spring; ``counter`` is called at each force."""
    system = mm.System()
    for mass in MASSES:
        system.addParticle(mass)
    outer = mm.CustomExternalForce(f"{HARMONIC}/2*(x*x + y*y + z*z) + {QUARTIC}*(x^4 + y^4 + z^4)")
    for i in range(3):
        outer.addParticle(i, [])
    system.addForce(outer)
    spring = mm.HarmonicBondForce()
    spring.addBond(0, 1, 0, BOND)
    system.addForce(spring)
    if counter is not None:

        def count(state):
            counter.append(state)
            return 0.0, np.zeros((3, 3))

        system.addForce(mm.PythonForce(count))
    return system


def context(system, chosen, positions=START, velocities=VELOCITIES):
    made = mm.Context(system, chosen, mm.Platform.getPlatformByName("Reference"))
    made.setPositions(positions)
    made.setVelocities(velocities)
    return made


def state_of(run):
    state = run.getState(getPositions=True, getVelocities=True)
    return state.getPositions(asNumpy=True)._value.copy(), state.getVelocities(asNumpy=True)._value.copy()


def sequence(method):
    """Moves of a step from the printed decimals: (operator, coefficient)."""
    tableau = nh.integrators[method]
    other = {"kick": "drift", "drift": "kick"}[tableau.first]
    moves = [(tableau.first, float(tableau.outer[0]))]
    for inner, outer in zip(tableau.inner, tableau.outer[1:], strict=True):
        moves += [(other, float(inner)), (tableau.first, float(outer))]
    return moves


def with_bath(method):
    """The moves with the heat bath: over the whole step inside of a middle drift, or over half a step at both ends."""
    moves = sequence(method)
    if len(moves) > 3:
        return [("bath", 0.5), *moves, ("bath", 0.5)]
    first, (operator, coefficient), last = moves
    half = operator, coefficient / 2
    return [first, half, ("bath", 1.0), half, last]


def cooled(x, v, method, step, friction):
    """One step in numpy with a bath at 0 K."""
    for operator, coefficient in with_bath(method):
        if operator == "kick":
            v = v + coefficient * step * force(x) / np.array(MASSES)[:, None]
        elif operator == "drift":
            x = x + coefficient * step * v
        else:
            v = v * np.exp(-friction * coefficient * step)
    return x, v


class TestForces:
    @pytest.mark.skipif(not hasattr(mm, "PythonForce"), reason="this OpenMM has no PythonForce to count with")
    @pytest.mark.parametrize(("method", "forces"), [("verlet", 1), ("babs7o7h", 7), ("bcss_s4", 4)])
    def test_kicks_share_a_force_in_a_heat_bath(self, method, forces):
        calls = []
        run = context(wells(calls), integrator(method, STEP, temperature=300, friction=1))
        run.getIntegrator().step(1)
        calls.clear()
        run.getIntegrator().step(10)
        assert len(calls) == 10 * forces

    def test_a_barostat_gets_new_forces(self):
        """A volume that changes at each step gives the same positions as a run whose force is asked for each time."""
        ends = []
        for asked in (False, True):
            system, pair = mm.System(), mm.CustomNonbondedForce("500*exp(-4*r)")
            system.setDefaultPeriodicBoxVectors((4, 0, 0), (0, 4, 0), (0, 0, 4))
            pair.setNonbondedMethod(pair.CutoffPeriodic)
            for mass in MASSES:
                system.addParticle(mass)
                pair.addParticle([])
            barostat = mm.MonteCarloBarostat(1, 300, 1)
            for one in (pair, barostat):
                system.addForce(one)
            chosen = integrator("verlet", STEP)
            chosen.setRandomNumberSeed(3)  # for the barostat too
            run = context(system, chosen, START + 1)
            for _ in range(20):
                if asked:  # OpenMM forgets a force when positions are set
                    run.setPositions(state_of(run)[0])
                chosen.step(1)
            ends.append(state_of(run)[0])
        assert run.getState().getPeriodicBoxVolume()._value != 64
        assert np.array_equal(*ends)


class TestTrajectories:
    def test_verlet_is_the_leapfrog_of_openmm(self):
        half_a_step_back = VELOCITIES - STEP / 2 * force(START) / np.array(MASSES)[:, None]
        theirs = context(wells(), mm.VerletIntegrator(STEP), velocities=half_a_step_back)
        ours = context(wells(), integrator("velocity_verlet", STEP * 1000 * unit.femtosecond))
        for run in (ours, theirs):
            run.getIntegrator().step(100)
        assert np.allclose(state_of(ours)[0], state_of(theirs)[0], rtol=0, atol=ROUNDING)

    def test_particles_without_mass_stay(self):
        system = wells()
        system.setParticleMass(2, 0)
        run = context(system, integrator("babs7o7h", STEP, temperature=300, friction=1))
        run.getIntegrator().step(5)
        assert np.array_equal(state_of(run)[0][2], START[2])


class TestHeatBath:
    @pytest.mark.parametrize("method", ["verlet", "babs7o7h", "babps8o7h", "bcss_s4", "ruth_s3o3"])
    def test_bath_acts_in_the_middle_or_at_both_ends(self, method):
        """At 0 K the bath multiplies velocities by exp(-friction time)."""
        run = context(wells(), integrator(method, STEP, temperature=0, friction=5))
        x, v = START, VELOCITIES
        for _ in range(20):
            run.getIntegrator().step(1)
            x, v = cooled(x, v, method, STEP, 5)
        assert np.allclose(state_of(run)[0], x, rtol=0, atol=ROUNDING)
        assert np.allclose(state_of(run)[1], v, rtol=0, atol=1e2 * ROUNDING)  # velocities are of order 10

    @pytest.mark.parametrize("method", ["verlet", "babs7o7h", "bcss_s4"])
    def test_variances_of_an_oscillator_are_those_of_the_scheme(self, method):
        """The closed form: verlet with the bath is BAOAB, whose positions have the exact variance kT / k."""
        count, mass, constant, kelvin = 1000, 4.0, 900.0, 250.0
        angle = 0.6 * nh.integrators[method].stages if method != "verlet" else 1.2
        step = angle * np.sqrt(mass / constant)
        system, well = mm.System(), mm.CustomExternalForce(f"{constant}/2*(x*x + y*y + z*z)")
        for i in range(count):
            system.addParticle(mass)
            well.addParticle(i, [])
        system.addForce(well)
        chosen = integrator(method, step, temperature=kelvin, friction=1 / step, seed=5)
        run = context(system, chosen, np.zeros((count, 3)), np.zeros((count, 3)))
        chosen.step(20)  # exp(-2 * 20) of the start is left
        x, v = [], []
        for _ in range(20):
            chosen.step(3)
            x.append(np.mean(state_of(run)[0] ** 2) * constant / (BOLTZMANN * kelvin))
            v.append(np.mean(state_of(run)[1] ** 2) * mass / (BOLTZMANN * kelvin))
        expected = stationary_variances(method, angle, np.exp(-1))
        if method == "verlet":
            assert np.allclose(expected, (1, 1 - 1.2**2 / 4), rtol=0, atol=1e-12)
        # 20 samples of 3000 numbers, correlated over about two samples; five standard deviations.
        assert np.allclose((np.mean(x), np.mean(v)), expected, rtol=5 * np.sqrt(2 / (3000 * 10)))

    def test_same_seed_gives_same_trajectory(self):
        ends = []
        for seed in (11, 11, 12):
            run = context(wells(), integrator("babs7o7h", STEP, temperature=300, friction=1, seed=seed))
            run.getIntegrator().step(5)
            ends.append(state_of(run)[0])
        assert np.array_equal(ends[0], ends[1])
        assert not np.allclose(ends[0], ends[2], atol=1e-4)

    def test_changed_temperature_takes_effect(self):
        run = context(wells(), integrator("babs7o7h", STEP, temperature=300, friction=1, seed=4))
        run.getIntegrator().setGlobalVariableByName("kT", 0)
        run.getIntegrator().setGlobalVariableByName("friction", 5)
        run.getIntegrator().step(1)
        assert np.allclose(state_of(run)[0], cooled(START, VELOCITIES, "babs7o7h", STEP, 5)[0], rtol=0, atol=ROUNDING)


def stationary_variances(method, step, kept):
    """Variances of q and p of p.p/2 + q.q/2 at kT = 1; ``kept`` is left of a velocity after a step. A fixed point."""
    matrix, noise = np.eye(2), np.zeros((2, 2))
    for operator, c in with_bath(method):
        moves = {"kick": [[1, 0], [-c * step, 1]], "drift": [[1, c * step], [0, 1]], "bath": [[1, 0], [0, kept**c]]}
        move = moves[operator]
        noise = np.array(move) @ noise @ np.array(move).T
        noise[1, 1] += 1 - kept ** (2 * c) if operator == "bath" else 0
        matrix = np.array(move) @ matrix
    found = np.linalg.solve(np.eye(4) - np.kron(matrix, matrix), noise.ravel()).reshape(2, 2)
    return found[0, 0], found[1, 1]


class TestConstraints:
    def dumbbell(self, method, steps):
        """A rigid dumbbell in a plane quartic well over 0.4 ps."""
        system = mm.System()
        for mass in MASSES[:2]:
            system.addParticle(mass)
        system.addConstraint(0, 1, 0.15)
        well = mm.CustomExternalForce(f"{HARMONIC}/2*(x*x + 2*y*y) + {QUARTIC}*x^4")
        for i in range(2):
            well.addParticle(i, [])
        system.addForce(well)
        chosen = integrator(method, 0.4 / steps)
        chosen.setConstraintTolerance(1e-13)
        return context(system, chosen, [[0.1, 0, 0], [0.1, 0.15, 0]], [[1.0, 0.5, 0], [-2.0, 0.5, 0]])

    @pytest.mark.parametrize("method", ["verlet", "babs7o7h", "bcss_s4"])
    def test_rigid_dumbbell_follows_its_equations(self, method):
        """The equations in the centre of mass and the angle, solved to 1e-12 by another library."""
        integrate = pytest.importorskip("scipy.integrate", reason="the oracle is scipy's").solve_ivp
        (m1, m2), length = MASSES[:2], 0.15
        total, inertia = m1 + m2, m1 * m2 / (m1 + m2) * length**2
        arms = (-m2 / total * length, m1 / total * length)

        def change(t, y):
            normal, along = np.array([np.cos(y[2]), np.sin(y[2])]), np.array([-np.sin(y[2]), np.cos(y[2])])
            places = [y[:2] + arm * normal for arm in arms]
            forces = [np.array([-HARMONIC * x - 4 * QUARTIC * x**3, -2 * HARMONIC * z]) for x, z in places]
            turning = sum(arm * (along @ one) for arm, one in zip(arms, forces, strict=True)) / inertia
            return [*y[3:], *(sum(forces) / total), turning]

        start = [0.1, m2 / total * length, np.pi / 2, (m1 - 2 * m2) / total, 0.5, 3.0 / length]
        y = integrate(change, (0, 0.4), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        exact = [y[:2] + arm * np.array([np.cos(y[2]), np.sin(y[2])]) for arm in arms]
        errors = []
        for steps in (40, 80):
            run = self.dumbbell(method, steps)
            run.getIntegrator().step(steps)
            x, v = state_of(run)
            errors.append(np.abs(x[:, :2] - exact).max())
            apart = x[1] - x[0]
            assert np.isclose(np.linalg.norm(apart), length, rtol=1e-12)
            assert abs(apart @ (v[1] - v[0])) < 1e-12
        assert errors[0] < 2e-2
        assert np.log2(errors[0] / errors[1]) > 1.8  # order 2 of RATTLE, or more where its part is small

    def test_virtual_sites_are_refused(self):
        system = wells()
        system.addParticle(0)
        system.setVirtualSite(3, mm.TwoParticleAverageSite(0, 1, 0.5, 0.5))
        with pytest.raises(nh.NearharmonicError, match="particle 3 is a virtual site"):
            integrator("babs7o7h", STEP, system=system)
        assert integrator("babs7o7h", STEP, system=wells()).getStepSize()._value == STEP


class TestSettings:
    @pytest.mark.parametrize(
        ("key", "settings"),
        [
            ("step", {"step": 1 * unit.nanometer}),
            ("step", {"step": None}),
            ("friction", {"temperature": 300}),
            ("friction", {"friction": 1}),
            ("friction", {"temperature": 300, "friction": -1}),
            ("friction", {"temperature": 300, "friction": 1 * unit.picosecond}),
            ("temperature", {"temperature": -1, "friction": 1}),
            ("temperature", {"temperature": float("nan"), "friction": 1}),
            ("seed", {"temperature": 300, "friction": 1, "seed": 0}),
            ("seed", {"temperature": 300, "friction": 1, "seed": 1.5}),
            ("seed", {"seed": 1}),
            ("system", {"system": "water"}),
        ],
    )
    def test_a_bad_setting_raises_an_error(self, key, settings):
        with pytest.raises(nh.NearharmonicError, match=re.escape(f"{key} = ")):
            integrator("babs7o7h", **({"step": STEP} | settings))
