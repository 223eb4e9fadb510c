"""Invariants that a system declares beside its energy: their values at the samples, their drifts, and a check.

Drifts do not tell a wrong invariant from a coarse step, as a method conserves most invariants only to its order. The
bracket {I, H} = dI/dq dH/dp - dI/dp dH/dq of an invariant vanishes at every state, on an approximate orbit as well.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from math import hypot as length_of
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nearharmonic.errors import SystemDefinitionError, bad_setting
from nearharmonic.math import hypot
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import Variables, described
from nearharmonic.systems.remembered import remembered
from nearharmonic.systems.system import System

#: States of a run at which brackets are evaluated, and largest number of coordinates for which they are.
STATES, MOST_COORDINATES = 3, 64
#: Two steps of the central differences, over the norms of q and of p. Where both give the same bracket, their errors,
#: a hundred times as large for the first, are negligible.
STEPS = (1e-5, 1e-6)
#: Largest |{I, H}| of an invariant, over |grad I| |grad H|; differences have errors near 1e-9.
TOLERANCE = 1e-4
#: Largest relative difference of the two brackets.
AGREEMENT = 0.1


class InvariantWarning(UserWarning):
    """A declared invariant is not conserved."""


def energy_at_start(system: System) -> float:
    """Return H at the system's own start, in double precision; it is finite, or an error."""
    q, p = system.start(float)
    try:
        H0 = float(system.energy(q, p, system.constants(float), 0.0))
    except (ArithmeticError, ValueError):
        H0 = float("nan")
    if not isfinite(H0):
        raise bad_setting("(q0, p0)", f"({list(q)}, {list(p)})", f"a start where the energy of {system.name} is finite")
    return H0


def invariant_values(
    system: System, q: ArrayLike, p: ArrayLike, constants: Sequence[Any] | None = None
) -> dict[str, Floats]:
    """Return the invariants of ``system`` at states ``q``, ``p`` (..., d) as arrays (..., components), by name.

    They are evaluated in double precision, with the system's own parameters by default.
    """
    given = system.constants(float) if constants is None else constants
    states = np.asarray(q, float), np.asarray(p, float)
    return {
        name: _evaluated(f"{system.name}: the invariant {name}", function, *states, given)
        for name, function in system.invariants.items()
    }


def _evaluated(what: str, function: Callable[..., Any], q: Floats, p: Floats, constants: Sequence[Any]) -> Floats:
    """The components (..., k) of a function at states (..., d); NaN where it fails, unless it fails everywhere."""
    shape = q.shape[:-1]
    try:
        return _components(function, tuple(np.moveaxis(q, -1, 0)), tuple(np.moveaxis(p, -1, 0)), constants, shape)
    except Exception as error:
        places = list(np.ndindex(shape)) if np.prod(shape) > 1 else []
        rows = {place: row for place in places if (row := _at_state(function, q, p, constants, place)) is not None}
        if not rows:
            raise SystemDefinitionError(f"{what} cannot be evaluated: {type(error).__name__}: {error}") from error
    found = np.full((*shape, len(next(iter(rows.values())))), np.nan)
    for place, row in rows.items():
        found[place] = row
    return found


def _components(
    function: Callable[..., Any], q: Sequence[Any], p: Sequence[Any], constants: Sequence[Any], shape: tuple[int, ...]
) -> Floats:
    """The components (..., k) of a function of d coordinates and d momenta, each an array of this shape."""
    with np.errstate(all="ignore"):  # a state may be too large for it
        value = function(tuple(q), tuple(p), *constants)
    parts = value if isinstance(value, tuple | list) else (value,)
    found = np.empty((*shape, len(parts)))
    for i, part in enumerate(parts):
        found[..., i] = _real(part)
    return found


def _at_state(
    function: Callable[..., Any], q: Floats, p: Floats, constants: Sequence[Any], place: tuple[int, ...]
) -> Floats | None:
    """The components at one state of many, None where the function fails, as it may far from the start."""
    given = [np.broadcast_to(x, q.shape[:-1])[place] for x in constants]
    try:
        return _components(function, q[place], p[place], given, ())
    except Exception:
        return None


@remembered
def check_quantities(system: System) -> None:
    """Evaluate invariants and observables at the start, so that formulas that fail do so before any work."""
    q, p = (np.array([row]) for row in system.start(float))
    invariant_values(system, q, p)
    observable_values(system, q, p, system.constants(float))


def observable_values(system: System, q: Floats, p: Floats, constants: Sequence[Any]) -> dict[str, Floats]:
    """Return the observables of ``system`` at states ``q``, ``p`` (..., d) as arrays (...), by name."""
    return {
        name: _evaluated(f"{system.name}: the observable {name}", observable.function, q, p, constants)[..., 0]
        for name, observable in system.observables.items()
    }


def invariant_variables(
    system: System,
    q: Floats,
    p: Floats,
    diverged: Any,
    constants: Sequence[Any] | None = None,
    *,
    start: tuple[Floats, Floats] | None = None,
) -> Variables:
    """Return the invariants of ``system`` at the samples ``q``, ``p`` (R, S, d) of R runs, and their drifts,
    ``<name>_drift``.

    Values are over (tau_per_stage, sample), with a dimension more, ``<name>_component``, for a vector. A drift is the
    maximum over the samples of |I - I0| / |I0|, Euclidean for a vector, or of |I - I0| where I0 = 0; infinite where the
    run ``diverged`` (R,). The ``long_name`` says which. I0 is that of the first sample, unless there is a ``start``, a
    pair of arrays (R, d).
    """
    found: Variables = {}
    q0, p0 = (q[:, 0], p[:, 0]) if start is None else start
    at_start = invariant_values(system, q0[:, None], p0[:, None], constants)
    for name, values in invariant_values(system, q, p, constants).items():
        function = system.invariants[name]
        unit, meaning = getattr(function, "unit", "unknown"), getattr(function, "meaning", "conserved quantity")
        several = [f"{name}_component"] if values.shape[-1] > 1 else []
        found[name] = (
            ("tau_per_stage", "sample", *several), values if several else values[..., 0], described(meaning, unit)
        )  # fmt: skip
        first = _length(at_start[name])
        relative = bool((first > 0).all())
        with np.errstate(all="ignore"):  # a state may be too large for an invariant
            change = _length(values - at_start[name]) / (first if relative else 1.0)
        # fmax passes over NaN, the samples that a run does not have.
        drift = np.where(diverged, np.inf, np.fmax.reduce(change, axis=1, initial=np.nan))
        measure = "|I - I0|/|I0|" if relative else "|I - I0|"
        what = f"maximum over the samples of {measure}, I = {name} in double precision, inf if diverged"
        found[f"{name}_drift"] = ("tau_per_stage",), drift, described(what, "1" if relative else unit)
    return found


def _length(vectors: Floats) -> Floats:
    """The Euclidean norms (...) of vectors (..., n), from the first component on."""
    return reduce(hypot, np.moveaxis(vectors, -1, 0), np.zeros(vectors.shape[:-1]))


def _real(value: Any) -> Any:
    if value is None or np.iscomplexobj(value):
        raise TypeError(f"it returns an object of type {type(value).__name__}, expected real numbers")
    return value


@remembered
def _checked(system: System) -> set[str]:
    """Return the invariants of a system that are checked; the caller adds to them."""
    return set()


def warn_of_changing(system: System, q: Floats, p: Floats, constants: Sequence[float]) -> None:
    """Warn of each invariant that the exact solutions through the states (S, d) of a run do not conserve, once for a
    system.

    States that are not finite are left out.
    """
    finite = np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1))
    if q.shape[1] > MOST_COORDINATES or not finite.size or not system.invariants.keys() - _checked(system):
        return
    _checked(system).update(system.invariants)
    rows = dict.fromkeys(finite[np.linspace(0, len(finite) - 1, STATES).round().astype(int)].tolist())
    rates = [_rates(system, q[row], p[row], constants) for row in rows]
    for name in system.invariants:
        if (rate := max(one[name] for one in rates)) > TOLERANCE:
            message = (
                f"{system.name}: the invariant {name} is not conserved: at a state of the run its rate of change is "
                f"{rate:.2g} of |grad {name}| |grad H|"
            )
            warnings.warn(message, InvariantWarning, stacklevel=2)


def _rates(system: System, q: Floats, p: Floats, constants: Sequence[float]) -> dict[str, float]:
    """Return |{I, H}| over |grad I| |grad H| of each invariant at a state, 0 where the differences are not exact."""
    try:
        with np.errstate(all="ignore"):
            coarse, fine = (_rates_of(*_gradients(system, q, p, constants, step)) for step in STEPS)
    except (ArithmeticError, ValueError):  # beside a state, H or an invariant may have no value
        return dict.fromkeys(system.invariants, 0.0)
    return {name: rate if abs(rate - coarse[name]) <= AGREEMENT * rate else 0.0 for name, rate in fine.items()}


def _rates_of(of_energy: Floats, of_invariants: dict[str, Floats]) -> dict[str, float]:
    """Return the rate of each invariant, the largest of its components; NaN where one has no value."""
    force, velocity = np.split(of_energy, 2)
    rates = {}
    for name, columns in of_invariants.items():
        of_q, of_p = np.split(columns, 2)
        sizes = np.linalg.norm(columns, axis=0) * length_of(np.linalg.norm(force), np.linalg.norm(velocity))
        rates[name] = float(np.max(abs(velocity @ of_q - force @ of_p) / np.where(sizes > 0, sizes, 1.0)))
    return rates


def _gradients(
    system: System, q: Floats, p: Floats, constants: Sequence[float], step: float
) -> tuple[Floats, dict[str, Floats]]:
    """Return central differences of H (2 d,) and of the invariants (2 d, k), in units of the norms of q and of p."""
    energies, values = [], []
    for signed in (step, -step):
        x, y = _moved(q, p, signed)
        states = zip(map(tuple, x.tolist()), map(tuple, y.tolist()), strict=True)
        energies.append(np.array([float(system.energy(*state, constants, 0.0)) for state in states]))
        values.append(invariant_values(system, x, y, constants))
    found = {name: (values[0][name] - values[1][name]) / (2 * step) for name in values[0]}
    return (energies[0] - energies[1]) / (2 * step), found


def _moved(q: Floats, p: Floats, step: float) -> Iterator[Floats]:
    """Yield q and p (2 d, d) with one coordinate or momentum of each row moved."""
    d = len(q)
    for x, first in ((q, 0), (p, d)):
        rows = np.tile(x, (2 * d, 1))
        rows[first : first + d] += step * (float(np.linalg.norm(x)) or 1.0) * np.eye(d)
        yield rows
