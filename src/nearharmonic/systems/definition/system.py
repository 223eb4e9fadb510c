"""Definition of a separable Hamiltonian system H(q, p) = T(p) + V(q)."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

from nearharmonic.core.formulas.chain import Chain
from nearharmonic.core.formulas.expression.graph import Graph
from nearharmonic.core.formulas.number import Constant, vector
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.registry.user_module import pickled
from nearharmonic.systems.definition.arguments import check_arguments
from nearharmonic.systems.definition.declaration import check_members, check_numbers, written_frequencies
from nearharmonic.systems.definition.energies import Energies
from nearharmonic.systems.definition.extended import DerivedGradient
from nearharmonic.systems.definition.quantities import Vector
from nearharmonic.systems.formulas.formulas import Formulas, formulas_of, regularised_formulas
from nearharmonic.systems.formulas.kinetic_energy import MassKineticEnergy, of_masses, quadratic_grad_T, quadratic_T
from nearharmonic.systems.numba.potential import potential_of

#: Members of a system that hold for its V and T alone.
DECLARED = ("harmonic", "gravity", "exact_position", "position_t_end", "frequencies")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)  # formulas have no equality but identity
class System(Energies):
    """A separable Hamiltonian with its standard initial value problem.

    ``V(q, *parameters)`` and ``T(p)`` or ``T(p, *parameters)`` return a scalar. They use only ``+ - * /``, powers,
    ``abs`` and the functions of :mod:`nearharmonic.math`, never a branch on a value, so that one text serves floats,
    numpy arrays, mpmath numbers and the kernels' scalars, SIMD lanes and double-doubles. Kernels take a float literal
    for the shortest decimal that it prints as: 0.1 is one tenth in every precision, ``q[0] / 3`` more precise than
    ``0.3333333333333333 * q[0]``, and a number of more digits a parameter.

    ``grad_V(q, *parameters)`` and ``grad_T(p)`` return a tuple as long as ``q``. If left out, they are derived; if
    given, they are compared with V and T at first use. With ``time_dependent``, ``V(q, t, *parameters)`` and
    ``grad_V(q, t, *parameters)`` depend on the time; :meth:`formulas` are those of the extended autonomous system.

    V and grad_V may both be functions decorated with ``numba.njit``, of a tuple or an array of floats: these may
    branch, and are compiled as they are, for double precision. See :mod:`nearharmonic.systems.numba.potential`.

    ``masses`` makes T = p.M^-1 p / 2, in place of T and grad_T: a tuple of d decimal strings, fractions or names of
    parameters, or a constant symmetric positive definite matrix (d, d) of strings and fractions. Without ``masses`` and
    T the masses are 1.

    ``q0``, ``p0``, ``t_end`` and the parameters are decimal strings, exact, rounded once per precision; numbers mean
    the decimals that they print as, and a parameter may be given by its value alone. ``units`` names the units of
    ``q``, ``p``, ``t`` and ``energy``, "1" by default. ``invariants`` are conserved functions ``f(q, p, *parameters)``
    besides the energy, an :class:`Observable` where their units matter; ``observables`` are recorded at the samples,
    functions of the same arguments or each an :class:`Observable`; ``period(q, p, *parameters)`` is the period of the
    exact orbit through floats q, p, if it has one. ``energy_scale`` is what energy errors are relative to, a decimal
    string in the unit of energy; if None, |H0|, or that unit where H0 = 0.
    ``surface_limit`` is the relative energy error beyond which a run has diverged; ``surface_reason`` says why.

    ``regularisation`` makes V = -GM/|q| + R in two or three coordinates an oscillator: what is integrated, with a step
    in a fictitious time, are the formulas of :mod:`nearharmonic.systems.formulas.regularisation`. States, times and
    energies are mapped back.

    ``harmonic`` marks the unit oscillator H = (p^2 + q^2)/2, whose energy errors are known in closed form, ``gravity``
    the potential V = -GM/|q|, for which other libraries have code of their own; both are compared with V at first use.
    ``exact_position(system, t)`` returns the position at the mpmath number t on the exact orbit, in the working
    precision of mpmath, or None if it has no closed form for the initial values and parameters of ``system``.
    ``position_t_end`` is the end of the interval over which positions are compared, where ``t_end`` is too late for
    that. ``frequencies`` are w_i of the oscillators p_i^2 / 2 + w_i^2 q_i^2 / 2 that ``split`` of a run solves exactly:
    d decimal strings, fractions or names of parameters, "0" for a free coordinate.
    A copy by :func:`dataclasses.replace` with another V or T drops those of these five that it does not change,
    and derives anew what was derived; ``declared_for`` is how it knows, and is not to be set.

    Raises
    ------
    SystemDefinitionError
        Rows of different length, a string that is no number finite as a double, a unit missing, ``masses`` that make no
        kinetic energy or beside a T, a formula that takes other arguments than it is called with or names the
        parameters in another order, or ``harmonic`` or ``gravity`` where dimension, kinetic energy or parameters rule
        it out.
    """

    def __post_init__(self) -> None:
        check_members(self)
        self._write_out()
        if len(self.q0) != len(self.p0) or not self.q0:
            raise SystemDefinitionError(
                f"{self.name}: q0 has {len(self.q0)} components and p0 {len(self.p0)}, expected equal and >= 1"
            )
        check_numbers(self)
        self._set_kinetic_energy()
        numba = potential_of(self)
        if numba is not None:
            object.__setattr__(self, "V", numba.value)
            object.__setattr__(self, "grad_V", numba.gradient)
        if self.grad_V is None or isinstance(self.grad_V, DerivedGradient):
            object.__setattr__(self, "grad_V", DerivedGradient(self._potential, self.time_dependent))
        self._drop_declarations()
        if self.harmonic and not (self.dimension == 1 and self.unit_masses):
            raise SystemDefinitionError(f"{self.name}: harmonic means one coordinate and T = p^2/2")
        if self.gravity and not (set(self.parameters) == {"GM"} and self.unit_masses):
            raise SystemDefinitionError(f"{self.name}: gravity means T = p.p/2 and GM as the only parameter")
        if self.frequencies is not None:
            written_frequencies(self)
        check_arguments(self)

    @property
    def facts(self) -> dict[str, object]:
        """Facts of the system that a notebook shows, by name."""
        return {
            "name": self.name,
            "label": self.label,
            "coordinates": self.dimension,
            "parameters": ", ".join(f"{name} = {one.value}" for name, one in self.parameters.items()),
            "invariants": ", ".join(self.invariants),
            "t_end": self.t_end,
            "source": self.source,
        }

    def __repr__(self) -> str:
        from nearharmonic.registry.display import line

        return line("System", self.facts)

    def _repr_html_(self) -> str:
        from nearharmonic.registry.display import facts_table

        return facts_table("System", self.facts)

    def _set_kinetic_energy(self) -> None:
        """Make T of ``masses``, and grad_T if it is not given; in a copy these may be the original's."""
        made = isinstance(self.grad_T, DerivedGradient) or isinstance(
            getattr(self.grad_T, "__self__", None), MassKineticEnergy
        )
        left_out = made or self.grad_T is None or self.grad_T is quadratic_grad_T
        try:
            T = of_masses(self.masses, self.T, self.dimension, tuple(self.parameters), alone=left_out)
        except SystemDefinitionError as error:
            raise SystemDefinitionError(f"{self.name}: {error}") from None
        object.__setattr__(self, "T", T)
        if isinstance(T, MassKineticEnergy):
            object.__setattr__(self, "grad_T", T.velocity)
        elif T is quadratic_T and left_out:
            object.__setattr__(self, "grad_T", quadratic_grad_T)
        elif left_out:
            object.__setattr__(self, "grad_T", DerivedGradient(self._kinetic_energy))

    def _drop_declarations(self) -> None:
        """Reset, in a copy with another V or T, what the original declared of its own."""
        original = self.declared_for
        if original is not None and (original["V"], original["T"]) != (self.V, self.T):
            for name in DECLARED:
                if getattr(self, name) is original[name]:
                    object.__setattr__(self, name, getattr(System, name))
        object.__setattr__(self, "declared_for", {name: getattr(self, name) for name in ("V", "T", *DECLARED)})

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle a registered system by its name, that of a file by its path, another by its fields.

        The functions in these fields must be importable.
        """
        elsewhere = pickled("nearharmonic.systems", "SYSTEM", self)
        if elsewhere is not None:
            return elsewhere
        kept = {x.name: getattr(self, x.name) for x in fields(self) if x.name != "declared_for"}
        for name in ("grad_V", "grad_T"):
            if isinstance(kept[name], DerivedGradient) or (self.masses is not None and name == "grad_T"):
                del kept[name]
        if self.masses is not None:
            del kept["T"]
        return _rebuilt, (kept,)

    @cached_property
    def parameters_at_run_time(self) -> bool:
        """True if formulas can be called with parameters that are values, on which no branch may depend."""
        energies = (self._potential, self._kinetic_energy)
        return not self.parameters or (
            all(e.parameters_at_run_time for e in energies) and self._gradients_take_values()
        )

    def _gradients_take_values(self) -> bool:
        formulas = self.formulas()
        values = Graph().variables(formulas.dimension + len(self.parameters))
        try:
            for name in ("grad_V", "grad_T"):
                traced = name == "grad_T" or self._potential.traced
                if traced and not isinstance(getattr(self, name), DerivedGradient):  # of an energy, which takes them
                    vector(formulas, name, values[: formulas.dimension], *values[formulas.dimension :])
        except SystemDefinitionError:
            return False
        return True

    @property
    def force_chain(self) -> Chain:
        """The longest chain of operations from a position to the force there, in processor cycles.

        It bounds the time of one trajectory: a stage takes as long as this and about seven cycles more.
        """
        given = () if self.parameters_at_run_time else self.constants(Constant)
        return self.formulas().force_chain(given, len(self.parameters))

    def formulas(self) -> Formulas:
        """Return what is integrated: the formulas, or those of the extended system if V depends on time."""
        return self._formulas

    @cached_property
    def _formulas(self) -> Formulas:
        if self.regularisation is not None:
            return regularised_formulas(self)
        return formulas_of(self, self._potential, self._kinetic_energy)

    def autonomous(self) -> System:
        """Return the extended system as one of its own if V depends on time: a System of :meth:`formulas`."""
        if not self.time_dependent:
            return self
        formulas, (q0, p0) = self.formulas(), self.extended_start(str)
        energies = {name: getattr(formulas, name) for name in ("V", "grad_V", "T", "grad_T")}
        none: dict[str, Any] = {"invariants": {}, "observables": {}, "period": None, "exact_position": None}
        return replace(self, q0=q0, p0=p0, time_dependent=False, masses=None, **energies, **none)

    def hessian_V_times(self, q: Vector, direction: Vector, *others: Any) -> Vector:
        """Return the Hessian of V at ``q`` times ``direction``, derived from V.

        Parameters
        ----------
        q, direction : tuple of d numbers
            Position, and a displacement, of any one number type.
        *others : numbers
            What V takes behind q: the time if it depends on it, and the parameters.
        """
        if self.time_dependent:
            t, *parameters = others
            return self._potential.hessian_times((*q, t), (*direction, t * 0), *parameters)[:-1]
        return self._potential.hessian_times(tuple(q), tuple(direction), *others)


def _rebuilt(fields: dict[str, Any]) -> System:
    return System(**fields)
