"""What a separable Hamiltonian system H(q, p) = T(p) + V(q) must say about itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from typing import Any

from nearharmonic.errors import SystemDefinitionError

#: A coordinate tuple of any number type: float, numpy array, mpf, or a number traced into a kernel.
Vector = tuple[Any, ...]


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
    ``q``. They use only ``+ - * /`` and :func:`nearharmonic.core.arithmetic.sqrt`, never a branch on a value, so that
    one text serves floats, numpy arrays, mpmath numbers and the kernels' scalars, SIMD lanes and double-doubles.

    ``q0``, ``p0``, ``t_end`` and the parameters are decimal strings: exact, rounded once per precision.
    ``units`` names the units of ``q``, ``p``, ``t`` and ``energy``. ``invariants`` are conserved functions
    ``f(q, p, *parameters)`` besides the energy; ``observables`` are recorded at the samples; ``period(q, p,
    *parameters)`` is the period of the exact orbit through floats q, p, if it has one. ``surface_limit`` is the
    relative energy error beyond which a run has left its energy surface for good; ``surface_reason`` says why.

    Raises:
        SystemDefinitionError: rows of different length, a string that is no finite number, a unit missing.
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
        named = {f"parameter {k}": v.value for k, v in self.parameters.items()} | {"t_end": self.t_end}
        named |= {f"q0[{i}]": v for i, v in enumerate(self.q0)} | {f"p0[{i}]": v for i, v in enumerate(self.p0)}
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
