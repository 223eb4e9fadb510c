"""Comparison of the signatures of formulas with the arguments of their calls."""

from __future__ import annotations

from collections.abc import Callable
from inspect import Parameter as Argument
from inspect import Signature, signature
from typing import Any

from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems.definition.members import Members
from nearharmonic.systems.formulas.kinetic_energy import takes_parameters
from nearharmonic.systems.numba.potential import given_function

#: What cannot be split, and what solves it.
SEPARABLE = (
    "a splitting method needs H = T(p) + V(q) without terms of both; a magnetic field, a rotating frame or a double "
    "pendulum needs another tool: see 'The wrong tool' in docs/start/choosing.md"
)
_POSITIONAL = (Argument.POSITIONAL_ONLY, Argument.POSITIONAL_OR_KEYWORD)


def check_arguments(system: Members) -> None:
    """Refuse formulas with other arguments than those of their calls, or with parameters in another order.

    A formula without a signature, such as one written in C, is not checked.

    Raises
    ------
    SystemDefinitionError
        The message holds the formula, its arguments, and the arguments of its calls.
    """
    for formula in ("V", "grad_V", "T", "grad_T"):
        function, parameters = given_function(getattr(system, formula)), tuple(system.parameters)
        if formula.endswith("V"):
            given = ("q", "t") if system.time_dependent else ("q",)
        else:
            given, parameters = ("p",), parameters if takes_parameters(function) else ()
        taken = _signature(function, follow_wrapped=False)
        if taken is not None:
            _check_count(system, formula, taken, given, parameters)
        named = _signature(function, follow_wrapped=True)
        if named is not None:
            _check_order(system, formula, named, len(given))


def _signature(function: Callable[..., Any], *, follow_wrapped: bool) -> Signature | None:
    try:
        return signature(getattr(function, "py_func", function), follow_wrapped=follow_wrapped)
    except (TypeError, ValueError):
        return None


def _check_count(
    system: Members, formula: str, taken: Signature, given: tuple[str, ...], parameters: tuple[str, ...]
) -> None:
    called = (*given, *parameters)
    try:
        taken.bind(*called)
    except TypeError:
        bare = [x.replace(annotation=Argument.empty) for x in taken.parameters.values()]
        shown = Signature(bare)
        reason = _reason(system, [x for x in bare if x.kind in _POSITIONAL], given)
        message = f"{system.name}: {formula} takes {shown}, and is called as {formula}({', '.join(called)}): {reason}"
        raise SystemDefinitionError(message) from None


def _reason(system: Members, taken: list[Argument], given: tuple[str, ...]) -> str:
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
    return "it takes all parameters, those that only masses or T use too"


def _check_order(system: Members, formula: str, taken: Signature, given: int) -> None:
    names = [x.name for x in taken.parameters.values() if x.kind in _POSITIONAL][given:]
    parameters = list(system.parameters)
    if names != parameters and sorted(names) == sorted(parameters):
        orders = f"({', '.join(names)}), and parameters are in the order ({', '.join(parameters)})"
        raise SystemDefinitionError(f"{system.name}: {formula} takes {orders}")
