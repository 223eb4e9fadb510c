"""Settings of runs that a config hands on to the kernels: one field here is one of every carrier between the two."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

#: What the two operators of a splitting solve: T and V; or T with the oscillators of V, and the rest of V.
KINETIC_POTENTIAL, EXACT_OSCILLATOR = SPLITS = ("kinetic_potential", "exact_oscillator")


@dataclass(frozen=True, kw_only=True)
class HandedOn:
    """Settings that a config hands on to the kernels as they are: what is a field here is one of all that inherit it.

    Parameters
    ----------
    summation : {"compensated", "plain"}
        Summation of the steps in double precision. Double-double sums are compensated always.
    split : {"kinetic_potential", "exact_oscillator"}
        What the two operators of a method solve: the drift T and the kick V; or the drift T with the oscillators of the
        frequencies that the system declares, and the kick the rest of V.
    """

    summation: str = "compensated"
    split: str = KINETIC_POTENTIAL

    @property
    def handed_on(self) -> dict[str, Any]:
        """These settings by name."""
        return handed_on_from(self)


def handed_on_from(*sources: object) -> dict[str, Any]:
    """Return the fields of :class:`HandedOn` by name, each from the first source that gives it; None gives nothing."""
    found = {field.name: [getattr(source, field.name, None) for source in sources] for field in fields(HandedOn)}
    given = {name: next((x for x in values if x is not None), None) for name, values in found.items()}
    return {name: value for name, value in given.items() if value is not None}
