"""Members of a system, completed from the short forms that a user may give, and their numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from nearharmonic.numerics.written import decimal
from nearharmonic.systems.definition.quantities import Observable, Parameter, ReadOnly, Vector, fixed, is_list
from nearharmonic.systems.formulas.kinetic_energy import quadratic_T
from nearharmonic.systems.formulas.regularisation import Regularisation

Scalar = TypeVar("Scalar")

#: Quantities that a system has units of.
UNITS = ("q", "p", "t", "energy")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)  # formulas are compared by identity only
class Members:
    """The members of a system; :class:`~nearharmonic.systems.definition.system.System` documents them."""

    name: str
    label: str = ""
    V: Callable[..., Any]
    grad_V: Callable[..., Vector] = None  # type: ignore[assignment]  # never None once built
    q0: tuple[str, ...]
    p0: tuple[str, ...]
    t_end: str
    units: Mapping[str, str] = field(default_factory=lambda: dict.fromkeys(UNITS, "1"))
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
        rows = {key: tuple(map(decimal, x if is_list(x) else (x,))) for key, x in given}
        rows |= {key: decimal(getattr(self, key)) for key in ("t_end", "position_t_end", "energy_scale")}
        rows |= {key: fixed(getattr(self, key)) for key in ("masses", "frequencies")}
        mappings = {"units": self.units, "parameters": named, "invariants": self.invariants, "observables": observed}
        read_only = {key: ReadOnly(value) for key, value in mappings.items()}
        for key, value in {"label": self.label or self.name, **rows, **read_only}.items():
            object.__setattr__(self, key, value)
