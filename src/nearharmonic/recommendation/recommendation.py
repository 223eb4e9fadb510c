"""Result of a recommendation: one setting of each method, and its description in words."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, nan
from typing import Literal

from nearharmonic.engine.kernels import NEAR_FLOOR, floor_in_words
from nearharmonic.engine.settings import checked_t_end, steps_of
from nearharmonic.recommendation.question import Question

#: Significant digits of a printed step, unless another number of steps would come of it.
DIGITS = 4


@dataclass(frozen=True, kw_only=True)
class Choice:
    """One method at its recommended setting, or at its most accurate setting if none meets the bound.

    ``method`` is its name in the registry, or the path of the file that defines it. ``status`` is "met" if the run and
    all finer runs meet the bound; "missed" if no run within the budget does, and the setting is that of the smallest
    error; or "not run", for the given ``reason``. ``tau`` is in the system's unit of time, NaN for adaptive methods,
    ``tolerance`` NaN for others. ``summation`` is "plain" where this does not increase the error, else "compensated",
    empty for other libraries. ``error`` is that of the run in the requested measure, ``time`` its least wall time in s,
    NaN unless the bound is met. ``further_error`` is the largest error of the runs that confirm the choice, from
    perturbed starts or all members and over a longer interval, of energies if positions are asked for.
    """

    method: str
    label: str
    kind: Literal["splitting", "peer"]
    status: Literal["met", "missed", "not run"]
    tau: float = nan
    tolerance: float = nan
    summation: str = ""
    steps: float = nan
    evaluations: float = nan
    error: float = nan
    max_energy_error: float = nan
    mean_energy_error: float = nan
    time: float = nan
    further_error: float = nan
    confirmed: bool = True
    reason: str = ""

    @property
    def shown(self) -> str:
        """Name or path as :func:`nearharmonic.integrate` takes it; the label of another library."""
        return self.method if self.kind == "splitting" else self.label


@dataclass(frozen=True, kw_only=True)
class Recommendation:
    """Methods for an error bound, ranked by the wall time of the run that is recommended.

    ``choices`` are the methods that meet the bound, the fastest first, behind them those whose step is not confirmed,
    then the others. ``basis`` is the origin of runs and times, as text.
    """

    question: Question
    choices: tuple[Choice, ...]
    basis: str

    @property
    def floor_in_words(self) -> str:
        """Sentence about choices whose error is marked as rounding, "" if there is none."""
        marked = any(is_rounding(choice, self.question) for choice in self.choices)
        return f"*: {floor_in_words(self.question.floor)}" if marked else ""

    @property
    def ranked(self) -> tuple[Choice, ...]:
        """The methods that meet the bound, the fastest first."""
        return tuple(choice for choice in self.choices if choice.status == "met")

    @property
    def call(self) -> str:
        """Python code of the run of the best method of this package; "" without one, and for a system of a config."""
        asked = self.question
        best = next((choice for choice in self.ranked if choice.kind == "splitting"), None)
        if best is None or not asked.arguments:
            return ""
        system, *start = asked.arguments
        more = [] if asked.t_end == checked_t_end(asked.system.t_end) else [f"t_end={asked.t_end!r}"]
        more += ["summation='plain'"] if best.summation == "plain" else []
        function = "ensemble" if len(asked.starts) > 1 else "integrate"
        return f"nh.{function}({', '.join([system, repr(best.method), repr(best.tau), *start, *more])})"

    @property
    def unconfirmed(self) -> str:
        """The methods that meet the bound and are not confirmed, each with its error there."""
        return "; ".join(f"{one.shown} ({one.further_error:.1e})" for one in self.ranked if not one.confirmed)

    def missed(self, kind: str) -> str:
        """Return the methods of one kind that miss the bound, each with its smallest error."""
        missed = [choice for choice in self.choices if (choice.status, choice.kind) == ("missed", kind)]
        return "; ".join(_at_best(choice, self.question) for choice in missed)

    def not_run(self) -> str:
        """Return the methods that were not run, those of one reason together with it."""
        absent: dict[str, list[str]] = {}
        for choice in self.choices:
            if choice.status == "not run":
                absent.setdefault(choice.reason, []).append(choice.shown)
        return "; ".join(f"{', '.join(names)} ({reason})" for reason, names in absent.items())


def is_rounding(choice: Choice, asked: Question) -> bool:
    """Return True if the energy error of a choice is near the rounding of V."""
    return asked.measure != "position" and choice.error <= NEAR_FLOOR * asked.floor


def printed_step(t_end: str, tau: float, steps: int) -> str:
    """Return ``tau`` in the fewest digits, four at least, that give ``steps`` steps over [0, ``t_end``] again."""
    texts = (f"{tau:.{digits}g}" for digits in range(DIGITS, 18))
    return next(text for text in texts if steps_of(t_end, float(text)) == steps)


def step_text(choice: Choice, t_end: str) -> str | None:
    """Return the step of a choice as :func:`printed_step` prints it, or None if it has a tolerance in its place."""
    if not isfinite(choice.tau):
        return None
    return printed_step(t_end, choice.tau, int(choice.steps)) if isfinite(choice.steps) else f"{choice.tau:.{DIGITS}g}"


def _at_best(choice: Choice, asked: Question) -> str:
    if not isfinite(choice.error):
        says = "every run fails"
    else:
        step = step_text(choice, asked.t_end)
        mark = " *" if is_rounding(choice, asked) else ""
        says = f"{choice.error:.1e}{mark} at {f'tolerance {choice.tolerance:.1g}' if step is None else f'tau {step}'}"
        says += ", but not at all finer ones" if choice.error <= asked.error else " at best"
    return f"{choice.shown} ({says}" + (f"; {choice.reason})" if choice.reason else ")")
