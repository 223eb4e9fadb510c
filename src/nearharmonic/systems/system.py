"""Definition of a separable Hamiltonian system H(q, p) = T(p) + V(q)."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial, wraps
from inspect import Parameter as Argument
from inspect import Signature, signature
from typing import Any, TypeVar

from nearharmonic.core.expression import Graph
from nearharmonic.core.number import Constant, vector
from nearharmonic.errors import SystemDefinitionError, naming_arguments
from nearharmonic.numerics.written import decimal
from nearharmonic.registry import facts_table, line, load_file, near_miss, pickled, split_path
from nearharmonic.systems import quantities
from nearharmonic.systems.formulas import (
    DerivedGradient,
    Energy,
    Formulas,
    MassKineticEnergy,
    Regularisation,
    extended_V,
    formulas_of,
    of_masses,
    quadratic_grad_T,
    quadratic_T,
    regularised_formulas,
    takes_parameters,
    with_parameters,
)
from nearharmonic.systems.numba_potential import NumbaEnergy, given_function, numba_potential, potential_of
from nearharmonic.systems.quantities import Observable, Parameter, Vector
from nearharmonic.systems.remembered import read_by

# --- Comparison of the signatures of formulas with the arguments of their calls.

#: What cannot be split, and what solves it.
SEPARABLE = (
    "a splitting method needs H = T(p) + V(q) without terms of both; a magnetic field, a rotating frame or a double "
    "pendulum needs another tool: see 'The wrong tool' in docs/start/choosing.md"
)
_POSITIONAL = (Argument.POSITIONAL_ONLY, Argument.POSITIONAL_OR_KEYWORD)


def check_arguments(system: System) -> None:
    """Refuse formulas whose arguments differ from their calls, or whose parameters are in another order.

    A formula without a signature, such as one written in C, is not checked.
    """
    for formula in ("V", "grad_V", "T", "grad_T"):
        function, parameters = given_function(getattr(system, formula)), tuple(system.parameters)
        if formula.endswith("V"):
            given = ("q", "t") if system.time_dependent else ("q",)
        else:
            given, parameters = ("p",), parameters if takes_parameters(function) else ()
        called = (*given, *parameters)
        if (taken := _signature(function, follow_wrapped=False)) is not None:
            try:
                taken.bind(*called)
            except TypeError:
                bare = [x.replace(annotation=Argument.empty) for x in taken.parameters.values()]
                reason = _reason(system, [x for x in bare if x.kind in _POSITIONAL], given)
                calls = f"takes {Signature(bare)}, and is called as {formula}({', '.join(called)}): {reason}"
                raise SystemDefinitionError(f"{system.name}: {formula} {calls}") from None
        if (named := _signature(function, follow_wrapped=True)) is not None:
            names = [x.name for x in named.parameters.values() if x.kind in _POSITIONAL][len(given) :]
            order = list(system.parameters)
            if names != order and sorted(names) == sorted(order):
                orders = f"({', '.join(names)}), and parameters are in the order ({', '.join(order)})"
                raise SystemDefinitionError(f"{system.name}: {formula} takes {orders}")


def _signature(function: Callable[..., Any], *, follow_wrapped: bool) -> Signature | None:
    try:
        return signature(getattr(function, "py_func", function), follow_wrapped=follow_wrapped)
    except (TypeError, ValueError):
        return None


def _reason(system: System, taken: list[Argument], given: tuple[str, ...]) -> str:
    behind = [x.name for x in taken if x.default is Argument.empty][len(given) :]
    unknown = [name for name in behind if name not in system.parameters]
    mixed = "q" if given == ("p",) else "p"
    if mixed in unknown or [x.name for x in taken[:2]] == ["q", "p"]:
        return SEPARABLE
    if given == ("q",) and "t" in unknown:
        return "a potential that depends on the time t needs time_dependent=True"
    if unknown:
        return f"parameters has no {', '.join(map(repr, unknown))}"
    if given == ("q", "t") and len(taken) < 2 + len(system.parameters):
        return "with time_dependent=True it takes the time, and all parameters behind it"
    return "it takes all parameters, also those that only masses or T use"


Scalar = TypeVar("Scalar")

#: Members of a system that are valid only for its V and T.
DECLARED = ("harmonic", "gravity", "exact_position", "position_t_end", "frequencies")

#: Names by which users give what is no sum of T(p) and V(q).
WHOLE = ("H", "hamiltonian", "Hamiltonian", "L", "lagrangian", "Lagrangian", "A", "B")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)  # formulas are compared by identity only
class System:
    """A separable Hamiltonian H(q, p) = T(p) + V(q) with a standard initial value problem.

    Formulas use only ``+ - * /``, powers, ``abs`` and the functions of :mod:`nearharmonic.math`, and never branch on a
    value. The same code then works with floats, numpy arrays, mpmath numbers, and the scalars, SIMD lanes and
    double-doubles of kernels. In kernels a float literal means the shortest decimal that it prints as: 0.1 is one tenth
    in every precision, and ``q[0] / 3`` is more precise than ``0.3333333333333333 * q[0]``. A number with more digits
    must be a parameter. Numbers of a system are exact decimal strings, which are rounded once for each precision; a
    float means the decimal that it prints as.

    V and grad_V may both be functions decorated with ``numba.njit``, of a tuple or an array of floats. Such functions
    may branch, and are compiled without tracing, for double precision only (``nearharmonic.systems.numba_potential``).

    Parameters
    ----------
    name, label : str
        Name in settings, and name in figures and tables, by default the same.
    V : callable
        ``V(q, *parameters)``, a scalar, or ``V(q, t, *parameters)`` with ``time_dependent``; q is a tuple of d numbers.
    grad_V : callable, optional
        Gradient of V, of the same arguments: a tuple of d numbers. It is compared with V at first use, and derived from
        V if it is not given.
    q0, p0 : tuple of d str
        Initial position and momentum, in the units of q and p.
    t_end : str
        End of the interval [0, t_end], in the unit of t.
    units : mapping of str, optional
        Units of ``q``, ``p``, ``t`` and ``energy``, "1" by default.
    source : str, optional
        Source of the formulas and numbers.
    T, grad_T : callable, optional
        ``T(p)`` or ``T(p, *parameters)``, a scalar, and its gradient; p.p/2 by default.
    masses : tuple of d str or matrix (d, d), optional
        T = p.M^-1 p / 2, in place of T and grad_T: numbers, decimal strings, fractions or names of parameters, or a
        constant symmetric positive definite matrix of numbers; a number alone for one coordinate.
    time_dependent : bool
        True if V depends on the time; :meth:`formulas` then belong to the extended autonomous system.
    regularisation : Regularisation, optional
        Transformation of a system with ``V = -GM/|q| + R`` in two or three coordinates to an oscillator. It is
        integrated with a step in a fictitious time; states, times and energies are mapped back.
    parameters : mapping of Parameter or number, optional
        Constants of the formulas by name, in the order of their arguments. A parameter may be given by its value alone.
    invariants, observables : mapping of callable, optional
        Functions ``f(q, p, *parameters)`` that are conserved besides the energy, and functions that are recorded at
        the samples. Both may be an :class:`~nearharmonic.Observable`, which has a unit.
    period : callable, optional
        ``period(q, p, *parameters)``, the period of the exact orbit through floats q, p, if it is periodic.
    harmonic, gravity : bool
        True for the unit oscillator H = (p^2 + q^2)/2, for which energy errors have a closed form; True for the
        potential ``V = -GM/|q|``, for which other libraries have special code. Both are compared with V at first use.
    exact_position : callable, optional
        ``exact_position(system, t)``, the position at the time t, an mpmath number, on the exact orbit in the working
        precision of mpmath; None if there is no closed form for the initial values and parameters of ``system``.
    position_t_end : str, optional
        End of the interval over which positions are compared, if ``t_end`` is too late for that.
    frequencies : tuple of d str, optional
        Frequencies w_i of the oscillators p_i^2 / 2 + w_i^2 q_i^2 / 2 that are solved exactly by a run with ``split``:
        decimals, fractions or names of parameters, "0" for a free coordinate.
    declared_for : mapping, optional
        V and T of a copy's original, which must not be set. A copy by ``dataclasses.replace`` with another V or T
        resets ``harmonic``, ``gravity``, ``exact_position``, ``position_t_end`` and ``frequencies`` unless they are
        replaced too, and derives gradients again.
    energy_scale : str, optional
        Energy that errors are relative to, in the unit of energy; by default ``|H0|``, and errors are absolute if H0 =
        0. If V depends on time, ``T(p0) + max |V(q0, t)|`` of this system is the default.
    surface_limit : float
        Relative energy error above which a run has diverged.
    surface_reason : str
        Reason for the value of this limit.

    Raises
    ------
    SystemDefinitionError
        q0 and p0 have different lengths; a string is not a finite double; a unit is missing; ``masses`` do not define a
        kinetic energy, or are given together with T; a formula has wrong arguments or parameters in another order; or
        ``harmonic`` or ``gravity`` contradicts the dimension, the kinetic energy or the parameters.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> def V(q, k):
    ...     return k * q[0] * q[0] / 2
    >>> spring = nh.System(name="spring", V=V, q0=["1"], p0=["0"], t_end="10", parameters={"k": "4"})
    >>> print(f"{nh.integrate(spring, 'ruth', 0.1).max_energy_error.item():.1e}")
    1.3e-04
    """

    name: str
    label: str = ""
    V: Callable[..., Any]
    grad_V: Callable[..., Vector] = None  # type: ignore[assignment]  # never None once built
    q0: tuple[str, ...]
    p0: tuple[str, ...]
    t_end: str
    units: Mapping[str, str] = field(default_factory=lambda: dict.fromkeys(quantities.UNITS, "1"))
    source: str = "defined by its user"
    T: Callable[..., Any] = quadratic_T
    grad_T: Callable[..., Vector] = None  # type: ignore[assignment]
    masses: Sequence[Any] | None = None
    time_dependent: bool = False
    regularisation: Regularisation | None = None
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    invariants: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    observables: Mapping[str, Observable] = field(default_factory=dict)
    period: Callable[..., float] | None = None
    harmonic: bool = False
    gravity: bool = False
    exact_position: Callable[[Any, Any], Vector | None] | None = None
    position_t_end: str | None = None
    frequencies: Sequence[Any] | None = None
    declared_for: Mapping[str, Any] | None = None
    energy_scale: str | None = None
    surface_limit: float = 1.0
    surface_reason: str = "the energy error is as large as the energy itself"

    def __post_init__(self) -> None:
        quantities.check_members(self)
        self._write_out()
        if len(self.q0) != len(self.p0) or not self.q0:
            raise SystemDefinitionError(
                f"{self.name}: q0 has {len(self.q0)} components and p0 {len(self.p0)}, expected equal and >= 1"
            )
        quantities.check_numbers(self)
        self._set_kinetic_energy()
        numba = potential_of(self)
        if numba is not None:
            object.__setattr__(self, "V", numba.value)
            object.__setattr__(self, "grad_V", numba.gradient)
        gradient: Any = self.grad_V  # None if it is left out
        if gradient is None or isinstance(gradient, DerivedGradient):
            object.__setattr__(self, "grad_V", DerivedGradient(self._potential, self.time_dependent))
        self._drop_declarations()
        if self.harmonic and not (self.dimension == 1 and self.unit_masses):
            raise SystemDefinitionError(f"{self.name}: harmonic means one coordinate and T = p^2/2")
        if self.gravity and not (set(self.parameters) == {"GM"} and self.unit_masses):
            raise SystemDefinitionError(f"{self.name}: gravity means T = p.p/2 and GM as the only parameter")
        if self.frequencies is not None:
            quantities.written_frequencies(self)
        check_arguments(self)
        self.read_again()

    def read_again(self) -> None:
        """Take what formulas read from elsewhere as what derived results hold for."""
        object.__setattr__(self, "_read", self._read_now())

    def _read_now(self) -> list[object]:
        formulas = [given_function(getattr(self, name)) for name in ("V", "grad_V", "T", "grad_T")]
        return read_by(*formulas, self.regularisation and self.regularisation.perturbation)

    def refresh(self) -> System:
        """Return the system itself, without values derived from formulas that now read other values than before.

        A function of numba among them is refused: it keeps the values of its first call.
        """
        read = self._read_now()
        if read == vars(self)["_read"]:
            return self
        numba = numba_potential(self)
        if numba is not None and "code" in vars(numba):
            reason = "V and grad_V read other values than at their first call, which numba keeps"
            raise SystemDefinitionError(f"{self.name}: {reason}: make them parameters, or decorate the functions again")
        for name in vars(self).keys() - {x.name for x in fields(self)}:
            del vars(self)[name]
        for name, energy, timed in (
            ("grad_V", self._potential, self.time_dependent), ("grad_T", self._kinetic_energy, False),
        ):  # fmt: skip
            if isinstance(getattr(self, name), DerivedGradient):
                object.__setattr__(self, name, DerivedGradient(energy, timed))
        object.__setattr__(self, "_read", read)
        return self

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.q0)

    def constants(self, kind: Callable[[str], Scalar]) -> tuple[Scalar, ...]:
        """Return the parameters as numbers of one kind, called with each decimal string: ``float``, ``mpmath.mpf``."""
        return tuple(kind(parameter.value) for parameter in self.parameters.values())

    def start(self, kind: Callable[[str], Scalar]) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...]]:
        """Return the initial values (q0, p0) as numbers of one kind, see :meth:`constants`."""
        return tuple(map(kind, self.q0)), tuple(map(kind, self.p0))

    def extended_start(self, kind: Callable[[str], Scalar]) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...]]:
        """Return the initial values of the integrated system: with t = 0 and p_t = 0 if V depends on time."""
        more = (kind("0"),) if self.time_dependent else ()
        q0, p0 = self.start(kind)
        return (*q0, *more), (*p0, *more)

    @cached_property
    def _potential(self) -> Energy:
        numba = numba_potential(self)
        if numba is not None:
            return NumbaEnergy(numba, self.constants(Constant))
        V: Callable[..., Any] = partial(extended_V, self.V) if self.time_dependent else self.V
        return Energy(self.name, "V", V, self.dimension + self.time_dependent, self.constants(Constant))

    @cached_property
    def _kinetic_energy(self) -> Energy:
        T = with_parameters(self.T, len(self.parameters))
        return Energy(self.name, "T", T, self.dimension, self.constants(Constant))

    @property
    def energies(self) -> tuple[Energy, Energy]:
        """V and T. V is a function of the coordinates, and of time if it depends on time."""
        return self._potential, self._kinetic_energy

    @cached_property
    def quadratic_kinetic_energy(self) -> bool:
        """True if T is a polynomial of degree at most 2 in the momenta, as Nystrom methods require."""
        return self.T is quadratic_T or isinstance(self.T, MassKineticEnergy) or self._kinetic_energy.is_quadratic

    @cached_property
    def unit_masses(self) -> bool:
        """True if T = p.p / 2: accelerations are then minus grad_V."""
        return self.T is quadratic_T or self._kinetic_energy.is_half_square

    @cached_property
    def typical_energy(self) -> float:
        """T(p0) + max abs(V(q0, t)) to two digits, over 17 times of the interval; 0 if V does not depend on time.

        The energy at the start of a system that depends on time may be near 0 by accident.
        """
        if not self.time_dependent:
            return 0.0
        constants, times = self.constants(float), (float(self.t_end) * k / 16 for k in range(17))
        q0, p0 = (tuple(map(float, x)) for x in (self.q0, self.p0))
        V = max(abs(float(self.V(q0, t, *constants))) for t in times)
        return float(f"{float(self._kinetic_energy.function(p0, *constants)) + V:.2g}")

    def energy(self, q: Vector, p: Vector, constants: Sequence[Any] = (), t: Any = None) -> Any:
        """Return H = T(p) + V(q), or T(p) + V(q, t), at a state of tuples of d numbers or arrays of any type.

        ``constants`` are the parameters in the same type, from :meth:`constants`, and ``t`` is the time, which a V that
        depends on it needs.
        """
        if self.time_dependent and t is None:
            raise SystemDefinitionError(f"{self.name}: V depends on time, and its energy needs t")
        time = (t,) if self.time_dependent else ()
        return self._kinetic_energy.function(p, *constants) + self.V(q, *time, *constants)

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
        return line("System", self.facts)

    def _repr_html_(self) -> str:
        return facts_table("System", self.facts)

    def _write_out(self) -> None:
        """Complete short forms of members: plain numbers, parameters and observables, and a missing label."""
        parameters: Mapping[str, Any] = self.parameters
        observables: Mapping[str, Any] = self.observables
        named = {
            key: value if isinstance(value, Parameter) else Parameter(value=value, meaning=key)
            for key, value in parameters.items()
        }
        observed = {
            key: f if isinstance(f, Observable) else Observable(function=f, unit="unknown", meaning=key)
            for key, f in observables.items()
        }
        given = ((key, getattr(self, key)) for key in ("q0", "p0"))
        rows = {key: tuple(map(decimal, x if quantities.is_list(x) else (x,))) for key, x in given}
        rows |= {key: decimal(getattr(self, key)) for key in ("t_end", "position_t_end", "energy_scale")}
        rows |= {key: quantities.fixed(getattr(self, key)) for key in ("masses", "frequencies")}
        mappings = {"units": self.units, "parameters": named, "invariants": self.invariants, "observables": observed}
        read_only = {key: quantities.ReadOnly(value) for key, value in mappings.items()}
        for key, value in {"label": self.label or self.name, **rows, **read_only}.items():
            object.__setattr__(self, key, value)

    def _set_kinetic_energy(self) -> None:
        """Set T from ``masses``, and grad_T if it is not given; in a copy both may come from the original."""
        gradient: Any = self.grad_T  # None if it is left out
        made = isinstance(getattr(gradient, "__self__", gradient), DerivedGradient | MassKineticEnergy)
        left_out = made or gradient is None or gradient is quadratic_grad_T
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
        """Reset, in a copy with another V or T, the members that the original declared for its own V and T."""
        original = self.declared_for
        if original is not None and (original["V"], original["T"]) != (self.V, self.T):
            for name in DECLARED:
                if getattr(self, name) is original[name]:
                    object.__setattr__(self, name, getattr(System, name))
        object.__setattr__(self, "declared_for", {name: getattr(self, name) for name in ("V", "T", *DECLARED)})

    def __copy__(self, _: Any = None) -> System:
        """Return the system itself, which cannot change."""
        return self

    __deepcopy__ = __copy__

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle a registered system by its name, the system of a file by its path, and any other by its fields.

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
        return partial(System, **kept), ()

    @cached_property
    def parameters_at_run_time(self) -> bool:
        """True if formulas work with parameters that are values of a kernel, so that no branch depends on them."""
        if not self.parameters:
            return True
        if not all(energy.parameters_at_run_time for energy in self.energies):
            return False
        formulas = self.formulas()
        values = Graph().variables(formulas.dimension + len(self.parameters))
        try:
            for name in ("grad_V", "grad_T"):
                traced = name == "grad_T" or self._potential.traced
                if traced and not isinstance(getattr(self, name), DerivedGradient):  # an energy takes such parameters
                    vector(formulas, name, values[: formulas.dimension], *values[formulas.dimension :])
        except SystemDefinitionError:
            return False
        return True

    def formulas(self) -> Formulas:
        """Return the integrated formulas, of the system, or of the extended system if V depends on time."""
        return self._formulas

    @cached_property
    def _formulas(self) -> Formulas:
        if self.regularisation is not None:
            return regularised_formulas(self)
        return formulas_of(self, self._potential, self._kinetic_energy)

    def autonomous(self) -> System:
        """Return the extended system of :meth:`formulas` as a separate System if V depends on time."""
        if not self.time_dependent:
            return self
        formulas, (q0, p0) = self.formulas(), self.extended_start(str)
        energies = {name: getattr(formulas, name) for name in ("V", "grad_V", "T", "grad_T")}
        none: dict[str, Any] = {"invariants": {}, "observables": {}, "period": None, "exact_position": None}
        return replace(self, q0=q0, p0=p0, time_dependent=False, masses=None, **energies, **none)

    def hessian_V_times(self, q: Vector, direction: Vector, *others: Any) -> Vector:
        """Return the Hessian of V at ``q`` (d) times ``direction`` (d), derived from V.

        The ``others`` are further arguments of V: the time if V depends on it, and the parameters.
        """
        if self.time_dependent:
            t, *parameters = others
            return self._potential.hessian_times((*q, t), (*direction, t * 0), *parameters)[:-1]
        return self._potential.hessian_times(tuple(q), tuple(direction), *others)


_init = naming_arguments(System.__init__, "System")


@wraps(_init)
def _refusing(self: System, **given: Any) -> None:
    """Make a system; one sentence for a Hamiltonian that is given whole, and for unknown members."""
    for name in given:
        if name in WHOLE:
            raise SystemDefinitionError(f"System has no {name}: {SEPARABLE}")
    _init(self, **given)


System.__init__ = _refusing  # type: ignore[method-assign]


# --- Systems in Python files of users.

DECLARES = "A system of your own is a Python file that defines SYSTEM"


def load_system(place: str | os.PathLike[str]) -> System:
    """Return the ``SYSTEM`` that a Python file defines."""
    module = load_file(place, DECLARES, SystemDefinitionError)
    found = getattr(module, "SYSTEM", None)
    if not isinstance(found, System):
        why = near_miss(module, "SYSTEM", System)
        raise SystemDefinitionError(f"{os.fspath(place)} does not define SYSTEM, a nearharmonic.System{why}")
    return found


def system_at(place: str, registered: Collection[str]) -> System:
    """Return the system of a file that is given by its path; it must not have the name of a ``registered`` system."""
    path, entry = split_path(place)
    if entry:
        raise SystemDefinitionError(f"{place}: a file defines one system, SYSTEM; give the path alone")
    found = load_system(path)
    if found.name in registered:
        message = f"{path}: SYSTEM has the name of the registered system {found.name!r}; give it another name"
        raise SystemDefinitionError(message)
    return found
