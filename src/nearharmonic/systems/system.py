"""What a separable Hamiltonian system H(q, p) = T(p) + V(q) must say about itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from typing import Any, TypeVar

from nearharmonic.display import facts_table, line
from nearharmonic.errors import SystemDefinitionError

#: A coordinate tuple of any number type: float, numpy array, mpf, or a number traced into a kernel.
Vector = tuple[Any, ...]

Scalar = TypeVar("Scalar")

#: Members of a system that hold for its V and T alone.
DECLARED = ("harmonic", "gravity", "exact_position", "position_t_end")


def quadratic_T(p: Vector) -> Any:
    """T = p.p / 2, the kinetic energy per unit mass."""
    return sum(x * x for x in p) / 2


def quadratic_grad_T(p: Vector) -> Vector:
    """dT/dp = p for T = p.p / 2."""
    return p


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One constant of a system: exact decimal ``value`` with its ``unit`` and ``meaning``."""

    value: str
    unit: str
    meaning: str


@dataclass(frozen=True, kw_only=True)
class Observable:
    """A function ``f(q, p, *parameters)`` of the sampled states (numpy arrays), recorded with each run."""

    function: Callable[..., Any]
    unit: str
    meaning: str


@dataclass(frozen=True, kw_only=True, eq=False)  # formulas have no equality but identity
class System:
    """A separable Hamiltonian with its standard initial value problem.

    ``V(q, *parameters)`` and ``T(p)`` return a scalar, ``grad_V(q, *parameters)`` and ``grad_T(p)`` a tuple as long as
    ``q``. They use only ``+ - * /``, whole and half-integer powers, ``abs`` and
    :func:`nearharmonic.core.arithmetic.sqrt`, never a branch on a value, so that one text serves floats, numpy arrays,
    mpmath numbers and the kernels' scalars, SIMD lanes and double-doubles. Kernels take a float literal for the
    shortest decimal that it prints as: 0.1 is one tenth in every precision, ``q[0] / 3`` more precise than
    ``0.3333333333333333 * q[0]``, and a number of more digits a parameter.

    ``q0``, ``p0``, ``t_end`` and the parameters are decimal strings: exact, rounded once per precision.
    ``units`` names the units of ``q``, ``p``, ``t`` and ``energy``. ``invariants`` are conserved functions
    ``f(q, p, *parameters)`` besides the energy; ``observables`` are recorded at the samples; ``period(q, p,
    *parameters)`` is the period of the exact orbit through floats q, p, if it has one. ``surface_limit`` is the
    relative energy error beyond which a run has diverged; ``surface_reason`` says why.

    ``harmonic`` marks the unit oscillator H = (p^2 + q^2)/2, whose energy errors are known in closed form, ``gravity``
    the potential V = -GM/|q|, for which other libraries have code of their own; both are compared with V at first use.
    ``exact_position(system, t)`` returns the position at the mpmath number t on the exact orbit, in the working
    precision of mpmath, or None if it has no closed form for the initial values and parameters of ``system``.
    ``position_t_end`` is the end of the interval over which positions are compared, where ``t_end`` is too late for
    that. A copy by :func:`dataclasses.replace` with another V or T drops those of these four that it does not change;
    ``declared_for`` is how it knows, and is not to be set.

    Raises
    ------
    SystemDefinitionError
        Rows of different length, a string that is no finite number, a unit missing, or ``harmonic`` or ``gravity``
        where dimension, kinetic energy or parameters rule it out.
    """

    name: str
    label: str
    V: Callable[..., Any]
    grad_V: Callable[..., Vector]
    q0: tuple[str, ...]
    p0: tuple[str, ...]
    t_end: str
    units: Mapping[str, str]
    source: str
    T: Callable[[Vector], Any] = quadratic_T
    grad_T: Callable[[Vector], Vector] = quadratic_grad_T
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    invariants: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    observables: Mapping[str, Observable] = field(default_factory=dict)
    period: Callable[..., float] | None = None
    harmonic: bool = False
    gravity: bool = False
    exact_position: Callable[[System, Any], Vector | None] | None = None
    position_t_end: str | None = None
    declared_for: Mapping[str, Any] | None = field(default=None, repr=False)
    surface_limit: float = 1.0
    surface_reason: str = "the energy error is as large as the energy itself"

    def __post_init__(self) -> None:
        if len(self.q0) != len(self.p0) or not self.q0:
            raise SystemDefinitionError(
                f"{self.name}: q0 has {len(self.q0)} components and p0 {len(self.p0)}, expected equal and >= 1"
            )
        for key in ("q", "p", "t", "energy"):
            if key not in self.units:
                raise SystemDefinitionError(f"{self.name}: units lack {key!r}")
        self._check_numbers()
        self._drop_declarations()
        if self.harmonic and not (self.dimension == 1 and self.quadratic_kinetic_energy):
            raise SystemDefinitionError(f"{self.name}: harmonic means one coordinate and T = p^2/2")
        if self.gravity and not (set(self.parameters) == {"GM"} and self.quadratic_kinetic_energy):
            raise SystemDefinitionError(f"{self.name}: gravity means T = p.p/2 and GM as the only parameter")

    @property
    def facts(self) -> dict[str, object]:
        """What a notebook shows of the system, by name."""
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

    def _drop_declarations(self) -> None:
        """Reset, in a copy with another V or T, what the original declared of its own."""
        original = self.declared_for
        if original is not None and (original["V"], original["T"]) != (self.V, self.T):
            for name in DECLARED:
                if getattr(self, name) is original[name]:
                    object.__setattr__(self, name, getattr(System, name))
        object.__setattr__(self, "declared_for", {name: getattr(self, name) for name in ("V", "T", *DECLARED)})

    def _check_numbers(self) -> None:
        named = {f"parameter {k}": v.value for k, v in self.parameters.items()} | {"t_end": self.t_end}
        named |= {f"q0[{i}]": v for i, v in enumerate(self.q0)} | {f"p0[{i}]": v for i, v in enumerate(self.p0)}
        if self.position_t_end is not None:
            named["position_t_end"] = self.position_t_end
        for key, text in named.items():
            try:
                finite = Decimal(text).is_finite()
            except InvalidOperation:
                finite = False
            if not finite:
                raise SystemDefinitionError(f"{self.name}: {key} = {text!r} is not a finite decimal number")

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.q0)

    @property
    def quadratic_kinetic_energy(self) -> bool:
        """Whether T = p.p / 2, which Nystrom methods and the equality of force and acceleration need."""
        return self.grad_T is quadratic_grad_T

    def constants(self, kind: Callable[[str], Scalar]) -> tuple[Scalar, ...]:
        """Return the parameters as numbers of one kind.

        Parameters
        ----------
        kind : callable
            Number type, called with each decimal string: ``float``, ``Fraction``, ``mpmath.mpf``.
        """
        return tuple(kind(parameter.value) for parameter in self.parameters.values())

    def start(self, kind: Callable[[str], Scalar]) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...]]:
        """Return the initial values (q0, p0) as numbers of one kind, see :meth:`constants`."""
        return tuple(map(kind, self.q0)), tuple(map(kind, self.p0))

    def energy(self, q: Vector, p: Vector, constants: Sequence[Any] = ()) -> Any:
        """Return H = T(p) + V(q).

        Parameters
        ----------
        q, p : tuple of d numbers or arrays
            State, of any one number type.
        constants : sequence of numbers
            Parameters in that type, from :meth:`constants`.
        """
        return self.T(p) + self.V(q, *constants)
