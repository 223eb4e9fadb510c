"""Entries of a config: declarations of members, and readers of values.

The settings of a config are frozen dataclasses. :func:`setting` declares a member once: description, unit, limits and
default. They are plain dataclasses so that jobs with settings start quickly; :mod:`nearharmonic_paper.config` reads
them with pydantic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, dataclass, field
from typing import Annotated, Any

from nearharmonic.engine.settings import positive
from nearharmonic.errors import bad_setting
from nearharmonic.numerics.written import ALL_DIGITS, integer_of


@dataclass(frozen=True)
class Reading:
    """Reader of a config value: ``accept`` returns the converted value, or raises ValueError or TypeError.

    ``schema`` describes the accepted values as JSON Schema. pydantic calls both methods.
    """

    accept: Callable[[Any], Any]
    schema: tuple[tuple[str, Any], ...]

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        from pydantic_core import core_schema

        def accepted(value: Any) -> Any:
            try:
                return self.accept(value)
            except TypeError:  # pydantic takes ValueError alone for a fault of the value
                raise ValueError from None

        return core_schema.no_info_plain_validator_function(accepted)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return {key: list(value) if isinstance(value, tuple) else value for key, value in self.schema}


_NUMBER = (("type", ("number", "string")),)

#: A finite number above 0, or the decimal string of one (YAML 1.1 reads 1e-4 as a string), as a float.
PositiveNumber = Annotated[float, Reading(lambda value: float(positive("", value)), _NUMBER)]
#: As above, as a plain decimal string with all digits.
PositiveDecimal = Annotated[str, Reading(lambda value: format(positive("", value).normalize(ALL_DIGITS), "f"), _NUMBER)]

#: Pydantic's configuration of dataclasses of settings: unknown keys are errors.
STRICT: Any = {"extra": "forbid"}

#: Allowed values, in words.
POSITIVE, AT_LEAST_LOWEST = "a finite number above 0", "a finite number, at least lowest"
#: Force evaluations of one part of an experiment, all methods together: some minutes.
MOST_EVALUATIONS = 10**12


def setting(
    description: str, allowed: str = "", *, unit: str = "", default: Any = MISSING, each: str = "", **limits: Any
) -> Any:
    """Declare a member of a dataclass of settings.

    The ``description`` and the ``unit`` are for the documentation. Errors say what is ``allowed``, and for ``each``
    entry of a list; a section needs neither, because errors name its keys. The ``default`` is the value of a missing
    key, a class for a section whose keys all have defaults. Limits are ``ge``, ``le``, ``gt``, ``lt``, ``min_length``,
    ``max_length`` and ``pattern`` of ``pydantic.Field``.
    """
    told = {key: words for key, words in (("allowed", allowed), ("unit", unit), ("each", each)) if words}
    metadata = {"description": description, "json_schema_extra": told, **limits}
    if isinstance(default, type):
        return field(default_factory=default, metadata=metadata)
    return field(default=default, metadata=metadata)


def positive_numbers(description: str, *default: str, unit: str = "1") -> Any:
    """Declare a member with at least one number above 0."""
    allowed = "a list of numbers above 0"
    return setting(description, allowed, unit=unit, each=POSITIVE, default=default, min_length=1)


def some_of(description: str, names: tuple[str, ...]) -> Any:
    """Declare a member with at least one of ``names``, by default all."""
    listed = ", ".join(names)
    return setting(description, f"a list of {listed}", each=f"one of {listed}", default=names, min_length=1)


def whole_between(least: int, most: int) -> tuple[Callable[[Any], int], tuple[tuple[str, Any], ...]]:
    """Return the arguments of :class:`Reading` for an integer within limits, as an entry of a list."""

    def accept(value: object) -> int:
        number = integer_of(value)
        if not least <= number <= most:
            raise ValueError
        return number

    return accept, (("type", "integer"), ("minimum", least), ("maximum", most))


def whole_from(least: int, most: int | None = None) -> dict[str, Any]:
    """Return limits of an integer, with their text, as keywords of :func:`setting`."""
    if most is None:
        return {"allowed": f"an integer of {least} or more", "unit": "1", "ge": least}
    return {"allowed": f"an integer from {least} to {most}", "unit": "1", "ge": least, "le": most}


def check_affordable(key: str, count: int, each: float) -> None:
    """Raise SettingError if the ``count`` of a ``key``, of so many force evaluations ``each``, takes too many."""
    if each * count > MOST_EVALUATIONS:
        allowed = f"it would take {each * count:.2g} force evaluations, and may take {MOST_EVALUATIONS:.0e}"
        raise bad_setting(key, count, allowed)
