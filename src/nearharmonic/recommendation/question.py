"""Question that a recommendation answers, checked before any method is run."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from functools import cached_property
from numbers import Rational
from typing import Any

import numpy as np

from nearharmonic.engine.batch import check_bound
from nearharmonic.engine.numbers import standard_parameters, start_array
from nearharmonic.engine.reference import position_t_end
from nearharmonic.engine.settings import MOST_STEPS, checked_count, checked_tau, one_of, positive
from nearharmonic.engine.setup import ANY, Setup, as_python, checked_scale
from nearharmonic.engine.trajectory import sweep
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.integrators.user_file import load_tableaus
from nearharmonic.numerics.portable import Floats
from nearharmonic.numerics.written import exact_value
from nearharmonic.output.dataset import Attributes
from nearharmonic.recommendation.measure import MEASURES, NAMES
from nearharmonic.registry import is_path, split_path
from nearharmonic.systems import System, systems
from nearharmonic.systems.quantities import is_list

#: Evaluations of the force in a run that may be recommended, unless another budget is given.
EVALUATIONS = 200_000
#: Quantile of the errors of an ensemble that is bounded.
QUANTILE = 0.99


@dataclass(frozen=True, kw_only=True)
class Question:
    """A system over [0, ``t_end``], and the error bound of its runs in ``measure``, a key of :data:`MEASURES`.

    ``system`` begins at the first of ``starts`` (M, 4 d), laid out as by
    :func:`nearharmonic.engine.numbers.start_array`. ``arguments``: the system as the first argument of
    :func:`nearharmonic.integrate`, and the initial values, as Python code; empty for a system of a config. ``budget``:
    most evaluations of the force in a run that is recommended. ``methods`` by name, those of users' files by path.
    ``energy_attributes`` of ``max_energy_error`` and ``mean_energy_error``: what they are relative to. ``every``: True
    if all registered methods are candidates, of which those that take many more evaluations than others are dropped.
    ``floor``: energy error that is the rounding of a V in doubles, 0 if V is measured more precisely.
    """

    system: System
    arguments: tuple[str, ...]
    t_end: str
    measure: str
    error: float
    budget: int
    methods: Mapping[str, Tableau]
    energy_attributes: Mapping[str, Attributes]
    starts: Floats
    every: bool
    floor: float = 0.0

    @property
    def longest(self) -> int:
        """Evaluations of the longest run made: steps near the budget, too, have finer ones beside them."""
        return self.budget * 5 // 4

    @property
    def quantity(self) -> str:
        """Bounded quantity: relative to |H0|, or to an energy that the system chooses, or in a unit."""
        if self.measure == "position":
            return NAMES[self.measure]
        notes = self.energy_attributes[MEASURES[self.measure]]
        words, unit = notes["long_name"].partition(" over every step")[0], notes["units"]
        return self.over_members + (words if unit == "1" else f"{words} in {unit}")

    @property
    def over_members(self) -> str:
        """Words before an error of several starts: the quantile over them; "" for one start."""
        return f"{QUANTILE:g} quantile over {len(self.starts)} starts of " if len(self.starts) > 1 else ""

    @cached_property
    def scale(self) -> float:
        """Energy that errors are relative to; 0 for |H0|, or for the unit of energy where H0 = 0."""
        return checked_scale(self.system.energy_scale)


def question(
    system: str | System,
    error: object,
    *,
    measure: object = "max",
    t_end: object = None,
    q0: object = None,
    p0: object = None,
    methods: object = None,
    budget: object = None,
) -> Question:
    """Validate a question; arguments and errors as for :func:`nearharmonic.recommend`."""
    bound = checked_tau(error, "error")
    kind = one_of("measure", measure, tuple(MEASURES))
    most = EVALUATIONS if budget is None else checked_count("budget", budget, MOST_STEPS)
    if t_end is not None:
        positive("t_end", t_end)
    problem = Setup(system, ANY, t_end=t_end)  # type: ignore[arg-type]
    positive("t_end", problem.t_end)  # the system's own may run backwards
    chosen = _methods(methods)
    starts = start_array(problem.system, q0, p0, plain=False)
    check_bound(problem.system, starts, standard_parameters(problem.system)[None, :])
    subject = problem.system if q0 is None and p0 is None else _started(problem.system, starts[0])
    if len(starts) > 1 and kind == "position":
        raise bad_setting("measure", kind, "max or mean for several starts: exact positions are known of one")
    # A run of one step refuses a start where the energy is no number, and says what errors are relative to.
    told = sweep(subject, ANY, [float(problem.end)], t_end=problem.t_end)
    for i in np.flatnonzero(~np.isfinite(problem.run([1] * len(starts), 2, start=starts).energy)):
        raise bad_setting(f"(q0, p0) of start {i}", starts[i, ::2].tolist(), "a start where the energy is finite")
    return Question(
        system=subject,
        arguments=_arguments(system, q0=q0, p0=p0),
        t_end=position_t_end(subject, problem.t_end) if kind == "position" else problem.t_end,
        measure=kind,
        error=bound,
        budget=most,
        methods=chosen,
        energy_attributes={name: told[name].attrs for name in (MEASURES["max"], MEASURES["mean"])},
        starts=starts,
        every=methods is None,
        floor=told.attrs.get("energy_floor", 0.0),
    )


def _arguments(system: str | os.PathLike[str] | System, **start: Any) -> tuple[str, ...]:
    """Return Python code of a system, which is its name if it is an object, and of initial values."""
    if not (isinstance(system, System) or system in systems.registered or is_path(os.fspath(system))):
        return ()
    many = {key: np.ndim(x) > 1 and len(x) > 1 for key, x in start.items()}
    texts = {key: key if many[key] else repr(_numbers(x)) for key, x in start.items() if x is not None}
    return (as_python(system), *(f"{key}={text}" for key, text in texts.items()))


def _numbers(given: Any) -> list[int | float | str]:
    """Return initial values as Python writes them: fractions and the like as text."""
    values = np.array(given, dtype=object).ravel().tolist()
    plain = (x.item() if isinstance(x, np.generic) else x for x in values)
    return [
        x if isinstance(x, int | float) else str(x if isinstance(x, str | Decimal | Rational) else exact_value(x))
        for x in plain
    ]


def _started(system: System, start: Floats) -> System:
    """Return the system with other initial values: the exact pairs of doubles of its runs."""
    q, q_low, p, p_low = start.reshape(4, -1)[:, : system.dimension].tolist()
    return replace(system, q0=_decimals(q, q_low), p0=_decimals(p, p_low))


def _decimals(values: Sequence[float], low: Sequence[float]) -> tuple[str, ...]:
    """Return the sums of two doubles in all their digits: the denominators are powers of two."""
    texts = []
    for pair in zip(values, low, strict=True):
        number = sum(map(Fraction, pair))
        places = number.denominator.bit_length() - 1
        texts.append(f"{number.numerator * 5**places}e-{places}")
    return tuple(texts)


def _methods(asked: Any) -> dict[str, Tableau]:
    """Return the methods by name, methods of users' files by path."""
    if asked is None:
        return dict(integrators)
    key, allowed = "methods", "a list of at least one name, file path or Tableau"
    if isinstance(asked, Tableau) or not is_list(asked):
        raise bad_setting(key, asked, allowed)
    found: dict[str, Tableau] = {}
    for one in asked:
        for name, tableau in _entries(one).items():
            if found.setdefault(name, tableau) is not tableau:
                raise bad_setting(key, name, "two methods have this name")
    if not found:
        raise bad_setting(key, asked, allowed)
    return found


def _entries(one: Any) -> dict[str, Tableau]:
    """Return the methods that one entry of a list stands for; for a path, all methods of its file."""
    if isinstance(one, Tableau):
        return {one.name: one}
    name = os.fspath(one) if isinstance(one, os.PathLike) else one
    if is_path(name) and not split_path(name)[1]:
        several = load_tableaus(name)
        if len(several) > 1:
            return {f"{name}:{key}": tableau for key, tableau in several.items()}
    return {integrators.name_of(name): integrators[name]}
