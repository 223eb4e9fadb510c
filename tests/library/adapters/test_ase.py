"""Integrators in ASE: trajectories, constraints, files, and the trial of methods."""

import re

import numpy as np
import pytest

import nearharmonic as nh
import nearharmonic.adapters

ase = pytest.importorskip("ase", reason="the adapter needs the extra [ase]")
from ase import units  # noqa: E402  # after importorskip
from ase.calculators.calculator import CalculationFailed, Calculator, all_changes  # noqa: E402
from ase.calculators.mixing import SumCalculator  # noqa: E402
from ase.constraints import FixAtoms, FixBondLengths, FixCartesian, FixedLine, FixedPlane, Hookean  # noqa: E402
from ase.io import read  # noqa: E402
from ase.md.verlet import VelocityVerlet  # noqa: E402

from nearharmonic.adapters.ase import Splitting, recommend  # noqa: E402

# ASE 3.23 opens the null device for a log that nobody asks for, and closes it at the end of a `with` alone.
pytestmark = [
    pytest.mark.filterwarnings("ignore:.*null:ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

MASSES = np.array([1.0, 16.0, 40.0])
START = np.array([[0.1, 0.02, -0.05], [-0.08, 0.11, 0.03], [0.04, -0.06, 0.12]])
MOMENTA = np.array([[0.3, -0.5, 0.1], [0.8, 0.3, -1.5], [-0.6, 1.1, 0.9]])
#: Force constants in eV per square and fourth power of an angstrom; the shortest period is 8.9 fs, 0.87 of ASE's unit.
HARMONIC, QUARTIC, BOND = 20.0, 80.0, 15.0
STEP = 0.05
#: Rounding of 100 steps at double precision grows along with the phase: 1e-16 times a few thousand operations.
ROUNDING = 1e-11


def potential(q):
    bond = sum((q[i] - q[i + 3]) ** 2 for i in range(3))
    return HARMONIC / 2 * sum(x * x for x in q) + QUARTIC * sum(x**4 for x in q) + BOND / 2 * bond


class Wells(Calculator):
    """A calculator of quartic wells and a spring that counts its calls."""

    implemented_properties = ("energy", "forces")

    def __init__(self):
        super().__init__()
        self.calls = 0

    def calculate(self, atoms=None, properties=("energy",), system_changes=all_changes):
        super().calculate(atoms, properties, system_changes)
        self.calls += 1
        x = atoms.positions
        bond = BOND * (x[1] - x[0])
        forces = -HARMONIC * x - 4 * QUARTIC * x**3  # warns of an overflow, as calculators do
        forces[:2] += [bond, -bond]
        self.results = {"energy": potential(x.ravel().tolist()), "forces": forces}


def wells(**more):
    atoms = ase.Atoms("H3", positions=START, masses=MASSES, momenta=MOMENTA, **more)
    atoms.set_momenta(MOMENTA)  # those along constraints are 0 now
    atoms.calc = Wells()
    return atoms


def state_of(atoms):
    return np.array([atoms.get_positions(), atoms.get_momenta()])


def largest_error(atoms, method, time_of_a_force, forces):
    """Largest energy error in meV per atom."""
    stages = nh.integrators[method].stages
    dynamics, start, found = Splitting(atoms, time_of_a_force * stages, method), atoms.get_total_energy(), []
    for _ in range(forces // stages):
        dynamics.step()
        found.append(abs(atoms.get_total_energy() - start))
    return 1000 * max(found) / len(atoms)


class TestTrajectories:
    @pytest.mark.parametrize("constraint", [[], [FixAtoms([1]), Hookean(a1=0, a2=2, rt=0.1, k=5.0)]])
    def test_verlet_is_velocity_verlet_of_ase(self, constraint):
        ours, theirs = wells(constraint=constraint), wells(constraint=constraint)
        Splitting(ours, STEP, "verlet").run(20)
        VelocityVerlet(theirs, STEP).run(20)
        assert np.allclose(state_of(ours), state_of(theirs), rtol=0, atol=ROUNDING)

    def test_trajectory_and_log_are_those_of_ase(self, tmp_path):
        places = {}
        for name, make in (("ours", Splitting), ("theirs", VelocityVerlet)):
            places[name] = tmp_path / f"{name}.traj", tmp_path / f"{name}.log"
            files = dict(zip(("trajectory", "logfile"), map(str, places[name]), strict=True))
            method = ["verlet"] if make is Splitting else []
            with make(wells(), STEP, *method, **files, loginterval=2) as dynamics:
                dynamics.run(6)
        assert places["ours"][1].read_text() == places["theirs"][1].read_text()
        ours, theirs = (read(place, ":") for place, _ in places.values())
        assert len(ours) == 4
        assert [one.get_potential_energy() for one in ours] == [one.get_potential_energy() for one in theirs]

    def test_drift_first_writes_energies_and_forces(self, tmp_path):
        atoms = wells()
        with Splitting(atoms, STEP, "bcss_s4", trajectory=str(tmp_path / "a.traj"), loginterval=3) as dynamics:
            dynamics.run(6)
        last = read(tmp_path / "a.traj")
        assert last.get_potential_energy() == atoms.get_potential_energy()
        assert np.array_equal(last.get_forces(), atoms.get_forces())

    def test_trajectory_names_the_method(self, tmp_path):
        from ase.io.trajectory import Trajectory

        with Splitting(wells(), STEP, "babs7o7h", trajectory=str(tmp_path / "a.traj")) as dynamics:
            dynamics.run(1)
        with Trajectory(str(tmp_path / "a.traj")) as written:
            assert written.description["method"] == "babs7o7h"


class TestConstraints:
    @pytest.mark.parametrize("method", ["verlet", "babs7o7h", "bcss_s4"])
    def test_fixed_atoms_stay_and_others_keep_energy(self, method):
        errors = []
        for step in (STEP, STEP / 2):
            atoms = wells(constraint=FixAtoms([2]))
            dynamics, start, found = Splitting(atoms, step, method), atoms.get_total_energy(), []
            for _ in range(round(1 / step)):
                dynamics.step()
                found.append(abs(atoms.get_total_energy() - start))
            assert np.array_equal(atoms.positions[2], START[2])
            assert not atoms.get_momenta()[2].any()
            errors.append(max(found))
        assert np.log2(errors[0] / errors[1]) > nh.integrators[method].order - 0.3

    @pytest.mark.parametrize(
        ("constraint", "free"),
        [
            (FixCartesian([0], [True, False, False]), [[0, 1, 1]]),
            (FixedPlane([0], [0, 0, 1]), [[1, 1, 0]]),
            (FixedLine([0], [0, 1, 0]), [[0, 1, 0]]),
        ],
    )
    def test_linear_constraints_are_a_smaller_system(self, constraint, free):
        """Coordinates of the potential separate except along the bond, so a mask of forces is the oracle."""
        atoms = wells(constraint=constraint)
        mask = np.array([*free, [1, 1, 1], [1, 1, 1]])
        x, p = START, MOMENTA * mask
        atoms.set_momenta(p)
        Splitting(atoms, STEP, "babs7o7h").run(20)
        tableau, calculator = nh.integrators["babs7o7h"], Wells()
        for _ in range(20):
            for kick, drift in zip(tableau.kick, (*tableau.drift, "0"), strict=True):
                forces = calculator.get_forces(ase.Atoms("H3", positions=x))
                p = p + mask * float(kick) * STEP * forces
                x = x + float(drift) * STEP * p / MASSES[:, None]
        assert np.allclose(state_of(atoms), [x, p], rtol=0, atol=ROUNDING)

    def test_fixed_bonds_are_refused(self):
        with pytest.raises(nh.NearharmonicError, match="FixBondLengths: a drift"):
            Splitting(wells(constraint=FixBondLengths([(0, 1)])), STEP, "verlet")
        atoms = wells()
        dynamics = Splitting(atoms, STEP, "verlet")
        atoms.set_constraint(FixBondLengths([(0, 1)]))
        with pytest.raises(nh.NearharmonicError, match="FixBondLengths: a drift"):
            dynamics.run(1)

    @pytest.mark.parametrize("mass", [0.0, -1.0, float("nan")])
    def test_masses_of_moving_atoms_are_positive(self, mass):
        atoms = wells()
        atoms.set_masses([1, mass, 1])
        with pytest.raises(nh.NearharmonicError, match="mass of atom 1 = "):
            Splitting(atoms, STEP, "verlet")

    @pytest.mark.filterwarnings("ignore:Zero mass")  # of ASE
    def test_fixed_atoms_may_have_no_mass(self):
        atoms = wells(constraint=FixAtoms([1]))
        atoms.set_masses([1, 0, 1])
        Splitting(atoms, STEP, "babs7o7h").run(3)
        assert np.array_equal(atoms.positions[1], START[1])
        assert np.isfinite(state_of(atoms)).all()


class Friction(Wells):
    """Springs with a force that depends on velocities in a part of the states."""

    def __init__(self, drag):
        super().__init__()
        self.drag = drag

    def calculate(self, atoms=None, properties=("energy",), system_changes=all_changes):
        super().calculate(atoms, properties, system_changes)
        self.results["forces"] = self.results["forces"] + self.drag(atoms.positions, atoms.get_velocities())


class TestVelocities:
    def test_friction_in_a_sum_of_calculators_is_refused(self):
        atoms = wells()
        atoms.calc = SumCalculator([Wells(), Friction(lambda x, v: -v)])
        with pytest.raises(nh.NearharmonicError, match="depend on velocities"):
            recommend(atoms, 20.0, time=1.0)

    def test_noise_of_a_calculator_is_no_friction(self):
        noise = np.random.default_rng(2)
        atoms = wells()
        atoms.calc = Friction(lambda x, v: 1e-6 * noise.normal(size=x.shape))
        Splitting(atoms, STEP, "babs7o7h").run(100)


class TestSettings:
    def test_timestep_of_ase_is_another_name_of_step(self):
        atoms, same = wells(), wells()
        Splitting(atoms, timestep=STEP, method="babs7o7h").run(2)
        Splitting(same, STEP, "babs7o7h").run(2)
        assert np.array_equal(state_of(atoms), state_of(same))
        with pytest.raises(nh.NearharmonicError, match="timestep = "):
            Splitting(wells(), STEP, "babs7o7h", timestep=STEP)
        with pytest.raises(nh.NearharmonicError, match="unknown integrator"):
            Splitting(wells(), timestep=STEP)


class TestRecommend:
    def test_steps_found_meet_the_bound_in_a_run(self):
        atoms = wells()
        found = recommend(atoms, 20.0, time=2.0, methods=["verlet", "bcss_s4"])
        assert found.sizes["rank"] == 2
        assert (np.diff(found.forces_per_picosecond.values) >= 0).all()
        for name, step, error, cost in zip(
            found.integrator.values, found.step.values, found.max_energy_error.values,
            found.forces_per_picosecond.values, strict=True,
        ):  # fmt: skip
            stages = nh.integrators[str(name)].stages
            forces = stages * max(20, round(2.0 / (step * units.fs)))
            time_of_a_force = step * units.fs / stages
            assert np.isclose(largest_error(wells(), str(name), time_of_a_force, forces), error, rtol=1e-6)
            assert error <= 20
            assert np.isclose(cost, stages / step * 1000)
            larger = time_of_a_force * np.linspace(1.01, 1.06, 6)
            assert any(largest_error(wells(), str(name), one, forces) > 20 for one in larger)

    def test_call_runs_at_the_step_found(self):
        atoms = wells()
        found = recommend(atoms, 20.0, time=2.0, methods=["leapfrog", "babs7o7h"])
        context = {"nh": nh, "ase": ase, "atoms": atoms}
        dynamics = eval(found.attrs["call"], context)
        assert dynamics.method.tableau.name == str(found.integrator.values[0])
        assert 0.999 * found.step.values[0] < dynamics.dt / units.fs <= found.step.values[0]

    def test_atoms_of_the_user_stay(self):
        atoms = wells(constraint=FixAtoms([2]), info={"name": "mine"})
        atoms.calc = Wells()
        calculator, arrays = atoms.calc, {key: value.copy() for key, value in atoms.arrays.items()}
        recommend(atoms, 20.0, time=1.0, methods=["babs7o7h"])
        assert atoms.calc is calculator
        assert atoms.info == {"name": "mine"}
        assert atoms.arrays.keys() == arrays.keys()
        assert all(value.tobytes() == arrays[key].tobytes() for key, value in atoms.arrays.items())

    def test_momenta_of_fixed_atoms_have_no_part(self):
        found = []
        for projected in (True, False):
            atoms = wells(constraint=FixAtoms([2]))
            atoms.set_momenta(MOMENTA, apply_constraint=projected)
            found.append(recommend(atoms, 20.0, time=0.5, methods=["babs7o7h"]))
        assert found[0].drop_attrs().identical(found[1].drop_attrs())

    @pytest.mark.parametrize("method", ["babs7o7h", "bcss_s4"])
    def test_forces_of_trials_are_counted(self, method):
        atoms = wells()
        found = recommend(atoms, 20.0, time=1.0, methods=[method])
        # The first run of a kick first method shares its first force with the first energy.
        assert atoms.calc.calls == found.attrs["forces"] + (method == "bcss_s4")

    def test_a_bound_that_none_meets_raises_an_error(self):
        with pytest.raises(nh.NearharmonicError, match=r"no method of verlet, bcss_s4 keeps .* 90 forces"):
            recommend(wells(), 1e-6, time=2.0, methods=["verlet", "bcss_s4"], budget=90)

    def test_methods_that_miss_are_named(self):
        found = recommend(wells(), 1e-3, time=1.0, methods=["verlet", "trained_fine"], budget=400)
        assert found.integrator.values.tolist() == ["trained_fine"]
        assert found.attrs["missed"] == "verlet"

    def test_a_failed_calculation_misses_the_bound(self):
        class Fails(Wells):
            def calculate(self, atoms=None, properties=("energy",), system_changes=all_changes):
                super().calculate(atoms, properties, system_changes)
                if abs(atoms.positions).max() > 0.5:
                    raise CalculationFailed("electrons do not converge")

        atoms = wells()
        atoms.calc = Fails()
        atoms.set_momenta(MOMENTA)
        assert recommend(atoms, 20.0, time=1.0, methods=["babs7o7h"]).sizes["rank"] == 1

    @pytest.mark.parametrize(
        ("key", "settings"),
        [
            ("error_per_atom", {"error_per_atom": 0}), ("error_per_atom", {"error_per_atom": "small"}),
            ("time", {"time": float("inf")}), ("methods", {"methods": "verlet"}), ("methods", {"methods": []}),
            ("budget", {"budget": 0}), ("budget", {"budget": 1.5}), ("atoms", {"atoms": "Cu"}),
            ("atoms", {"atoms": ase.Atoms("H3", positions=START)}),
        ],
    )  # fmt: skip
    def test_a_bad_setting_raises_an_error(self, key, settings):
        given = {"atoms": wells(), "error_per_atom": 20.0, **settings}
        with pytest.raises(nh.NearharmonicError, match=re.escape(f"{key} = ")):
            recommend(**given)

    def test_atoms_at_rest_raise_an_error(self):
        atoms = wells()
        atoms.set_momenta(0 * MOMENTA)
        with pytest.raises(nh.NearharmonicError, match="momenta of the temperature"):
            recommend(atoms, 1.0)
