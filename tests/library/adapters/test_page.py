"""docs/how_to/adapters.md: its Python runs, and its errors are measured again."""

import re
import subprocess
import sys
from functools import partial
from importlib.util import find_spec

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.adapters import PACKAGES
from support.results.stated_numbers import ROOT

PLACE = "docs/how_to/adapters.md"
PAGE = (ROOT / PLACE).read_text(encoding="utf-8")
#: Code by adapter.
BLOCKS = {re.search(r"nh\.adapters\.(\w+)", x)[1]: x for x in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)}
#: Boltzmann's constant in kJ/mol/K, and meV of a kJ/mol.
BOLTZMANN, MILLIELECTRONVOLT = 0.00831446261815324, 10.364269656
FACE_CENTRED = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])


METHODS = ("leapfrog", "babs7o7h", "trained_light")


def rows(heading):
    """Cells of the first table below a heading or the title."""
    table = re.search(r"(?:^\|.*\n)+", PAGE[PAGE.index(f"# {heading}\n") :], re.MULTILINE)[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]


ERRORS = rows("Energy errors")


def module_of(library):
    """Name of the adapter of a library."""
    return library.lower().replace(" ", "_")


def needs(library):
    package = PACKAGES[library]
    return pytest.mark.skipif(find_spec(package.replace("-", "_")) is None, reason=f"{package} is not installed")


# --- energy errors ----------------------------------------------------------------------------------------------------


def places(cells):
    """Corners and centres of faces of cells, in units of a cell."""
    return np.array([corner + np.array(one) for one in np.ndindex(cells, cells, cells) for corner in FACE_CENTRED])


def velocities(masses, energy, cells):
    """Maxwell velocities at kT = ``energy`` without motion of the whole; the potential then takes half of it."""
    found = np.random.default_rng(1).normal(size=(4 * cells**3, 3)) * np.sqrt(energy / masses)
    return found - found.mean(axis=0)


def argon(kelvin, method, step, stages):
    """Largest energy error in meV per atom over 10 ps."""
    import openmm as mm

    system, pair, edge = mm.System(), mm.NonbondedForce(), 4 * 0.526
    system.setDefaultPeriodicBoxVectors((edge, 0, 0), (0, edge, 0), (0, 0, edge))
    pair.setNonbondedMethod(pair.CutoffPeriodic)
    pair.setCutoffDistance(0.9)
    pair.setUseSwitchingFunction(True)
    pair.setSwitchingDistance(0.75)
    pair.setUseDispersionCorrection(False)
    for _ in range(256):
        system.addParticle(39.948)
        pair.addParticle(0, 0.3405, 0.996)
    system.addForce(pair)
    integrator = nh.adapters.openmm.integrator(method, step / 1000)
    context = mm.Context(system, integrator, mm.Platform.getPlatformByName("Reference"))
    context.setPositions(places(4) * 0.526)
    context.setVelocities(velocities(39.948, BOLTZMANN * 2 * kelvin, 4))

    def energy():
        state = context.getState(getEnergy=True)
        return (state.getPotentialEnergy() + state.getKineticEnergy())._value

    start, found = energy(), []
    for _ in range(round(10_000 / step)):
        integrator.step(1)
        found.append(abs(energy() - start))
    return max(found) / 256 * MILLIELECTRONVOLT


def copper(method, step, stages):
    """Largest energy error in meV per atom over 1 ps."""
    from ase import units
    from ase.build import bulk
    from ase.calculators.emt import EMT

    atoms = bulk("Cu", cubic=True) * (3, 3, 3)
    atoms.calc = EMT()
    atoms.set_velocities(velocities(atoms.get_masses()[0], units.kB * 2 * 100, 3))
    dynamics, start, found = nh.adapters.ase.Splitting(atoms, step * units.fs, method), atoms.get_total_energy(), []
    for _ in range(round(1000 / step)):
        dynamics.step()
        found.append(abs(atoms.get_total_energy() - start))
    return 1000 * max(found) / len(atoms)


def lennard_jones(method, step, stages):
    """Largest energy error per atom over 4620 forces, at density 1 and kT = 0.2 in units of the potential."""
    import jax
    from jax_md import energy, quantity, space

    edge = 3 * 4 ** (1 / 3)
    displacement, shift = space.periodic(edge)
    potential = energy.lennard_jones_pair(displacement, r_onset=1.8, r_cutoff=2.3)
    init, apply = nh.adapters.jax_md.nve(potential, shift, step, method)

    def total(state):
        return potential(state.position) + quantity.kinetic_energy(momentum=state.momentum, mass=state.mass)

    def one(state, _):
        state = apply(state)
        return state, total(state)

    state = init(jax.random.PRNGKey(0), jax.numpy.array(places(3) / 3 * edge), kT=0.0)
    state = state.set(momentum=jax.numpy.array(velocities(1.0, 2 * 0.2, 3)))
    _, found = jax.jit(lambda state: jax.lax.scan(one, state, None, length=4620 // stages))(state)
    return float(np.abs(np.asarray(found) - float(total(state))).max()) / 108


def henon_heiles_energy(q, p):
    return (p @ p + q @ q) / 2 + q[0] ** 2 * q[1] - q[1] ** 3 / 3


def henon_heiles_in_diffrax(method, step, stages):
    """Largest energy error over 500 units of time."""
    import diffrax
    import jax.numpy as jnp

    def force(t, q, args):
        return -jnp.stack([q[0] + 2 * q[0] * q[1], q[1] + q[0] ** 2 - q[1] ** 2])

    terms = diffrax.ODETerm(lambda t, p, args: p), diffrax.ODETerm(force)
    steps = round(500 / step)
    saved = diffrax.SaveAt(steps=True, fn=lambda t, y, args: henon_heiles_energy(*y))
    start = jnp.array([0.3, 0.0]), jnp.array([0.0, 0.4])
    solver = nh.adapters.diffrax.Splitting(method)
    run = diffrax.diffeqsolve(terms, solver, 0.0, steps * step, step, start, saveat=saved, max_steps=steps + 2)
    found = np.asarray(run.ys)
    return np.abs(found[np.isfinite(found)] - henon_heiles_energy(*start)).max()


def henon_heiles_in_scipy(method, step, stages):
    """Largest energy error over 77 units of time."""
    from scipy.integrate import solve_ivp

    def field(t, y):
        x, z, u, v = y
        return np.array([u, v, -(x + 2 * x * z), -(z + x * x - z * z)])

    start = 0.3, 0.0, 0.0, 0.4
    run = solve_ivp(field, (0, 77), start, method=nh.adapters.scipy.solver(method, 2), max_step=step)
    found = [henon_heiles_energy(y[:2], y[2:]) for y in run.y.T]
    return np.abs(np.array(found) - found[0]).max()


def quartic_posterior(method, step, stages):
    """Mean over 20 starts of the largest energy error over 15.4 units of time, in 20 dimensions."""
    import mici

    system = mici.systems.EuclideanMetricSystem(
        neg_log_dens=lambda q: q @ q / 2 + np.sum(q**4) / 40,
        grad_neg_log_dens=lambda q: q + q**3 / 10,
        metric=np.ones(20),
    )
    integrator, generator, found = nh.adapters.mici.integrator(system, step, method), np.random.default_rng(1), []
    for _ in range(20):
        state = mici.states.ChainState(pos=generator.normal(size=20), mom=generator.normal(size=20), dir=1)
        start, errors = system.h(state), []
        for _ in range(round(15.4 / step)):
            state = integrator.step(state)
            errors.append(abs(system.h(state) - start))
        found.append(max(errors))
    return np.mean(found)


def planets(method, step, stages):
    """Largest relative energy error to t = 120."""
    import rebound

    simulation = rebound.Simulation()
    simulation.add(m=1.0)
    simulation.add(m=1e-3, a=1.0, e=0.2)
    simulation.add(m=1e-3, a=2.5, e=0.1, inc=0.3)
    simulation.integrator = method if stages == 1 else nh.adapters.rebound.register(method)
    simulation.dt, start, found = step, simulation.energy(), []
    for _ in range(round(120 / step)):
        simulation.steps(1)
        found.append(abs(simulation.energy() / start - 1))
    return max(found)


#: Set-ups by library and system of the table.
SET_UPS = {
    ("OpenMM", "argon, 5 K"): partial(argon, 5),
    ("OpenMM", "argon, 40 K"): partial(argon, 40),
    ("ASE", "copper, 100 K"): copper,
    ("JAX MD", "Lennard-Jones crystal, kT = 0.2"): lennard_jones,
    ("diffrax", "Hénon-Heiles, t = 500"): henon_heiles_in_diffrax,
    ("scipy", "Hénon-Heiles, t = 77"): henon_heiles_in_scipy,
    ("mici", "quartic posterior, 20 dimensions"): quartic_posterior,
    ("REBOUND", "star and two planets"): planets,
}


def measured(library, system, time_of_a_force, method):
    stages = nh.integrators[method].stages
    # REBOUND may change particles between two steps: methods with kicks first take one force more.
    forces = stages + (library == "REBOUND" and stages > 1)
    return float(SET_UPS[library, system](method, time_of_a_force * forces, stages))


def last_digit(text):
    digits, _, exponent = text.partition("e")
    return 10.0 ** (int(exponent) - len(digits.partition(".")[2]))


def test_every_set_up_has_a_row():
    assert {(library, system) for library, system, *_ in ERRORS} == set(SET_UPS)
    assert all(len(row) == 4 + len(METHODS) for row in ERRORS)


@pytest.mark.slow
@pytest.mark.usefixtures("double_precision")
@pytest.mark.filterwarnings("ignore")  # of the libraries, which other tests look at
@pytest.mark.parametrize(
    ("library", "system", "time", "method", "printed"),
    [
        pytest.param(row[0], row[1], row[3], method, cell, marks=needs(module_of(row[0])))
        for row in ERRORS
        for method, cell in zip(METHODS, row[4:], strict=True)
    ],
)
def test_error_of_page_is_measured_again(library, system, time, method, printed):
    found = measured(library, system, float(time.split()[0]), method)
    # Two digits are printed; other versions of a library sum in another order, and crystals amplify it.
    assert abs(found - float(printed)) <= 0.05 * float(printed) + last_digit(printed)


# --- code ------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("library", [pytest.param(name, marks=needs(name)) for name in PACKAGES])
def test_block_of_page_runs_as_printed(library, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", BLOCKS[library]], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
