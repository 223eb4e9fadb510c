"""Sequences of operations that run on numbers of any type."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from nearharmonic.core.formulas.number import Constant

#: Number of operations from which on their order is chosen to save registers.
MANY_OPERATIONS = 200
#: Time for which an operation occupies the processor, in half cycles; others take 1.
WORK = {"divide": 8, "root": 9}

#: An operation: its name and its operands. An operand is the place of a result, or an exact constant.
Operation = tuple[Any, ...]


class Program:
    """Operations that turn arguments into results.

    Attributes
    ----------
    operations : list of tuple
        Names with the places of the operands; an operation's result has the place of the operation.
    results : list of int
        Places of the results.
    chain : int
        Cycles of the longest chain of operations.
    work : int
        Sum over the operations of the time for which each occupies the processor, in half cycles.
    """

    def __init__(self, operations: list[Operation], results: list[int], chain: int) -> None:
        needed = set(results)
        for place in range(len(operations) - 1, -1, -1):
            if place in needed:
                needed.update(_places(operations[place]))
        kept = sorted(needed)
        if len(kept) > MANY_OPERATIONS:
            kept = _used_soon(operations, kept)
        moved = {old: new for new, old in enumerate(kept)}
        self.operations = [_moved(operations[place], moved) for place in kept]
        self.results, self.chain = [moved[place] for place in results], chain
        uses = Counter(x for operation in self.operations for x in _places(operation))
        fused = sum(
            any(self.operations[x][0] == "multiply" and uses[x] == 1 for x in _places(operation))
            for operation in self.operations
            if operation[0] in ("add", "subtract")
        )
        names = [operation[0] for operation in self.operations]
        self.work = sum(WORK.get(name, name not in ("variable", "constant", "negate")) for name in names) - fused

    def run(
        self, arguments: Sequence[Any], constant: Callable[[Constant], Any], function: Callable[..., Any]
    ) -> tuple[Any, ...]:
        """Return the results for ``arguments``.

        Parameters
        ----------
        arguments : sequence of numbers
            The variables, all of one type with + - * / and abs.
        constant : callable
            Converts an exact constant to a number of that type.
        function : callable
            ``function(name, x, ...)`` is the value of a function of formulas, of "root" or of "sign".
        """
        values: list[Any] = []
        for name, *operands in self.operations:
            if name == "constant":
                values.append(constant(operands[0]))
            elif name == "variable":
                values.append(arguments[operands[0]])
            elif name in ARITHMETIC:
                values.append(ARITHMETIC[name](*[values[x] for x in operands]))
            else:
                values.append(function(name, *[values[x] for x in operands]))
        return tuple(values[place] for place in self.results)


#: Operations that Python's operators do.
ARITHMETIC: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "negate": lambda a: -a,
    "abs": abs,
}


def _places(operation: Operation) -> tuple[int, ...]:
    return () if operation[0] in ("constant", "variable") else operation[1:]


def _used_soon(operations: list[Operation], kept: Sequence[int]) -> list[int]:
    """An order of the places ``kept`` in which each result is used soon after its computation, to save registers."""
    missing = {place: len(set(_places(operations[place]))) for place in kept}
    users: dict[int, list[int]] = {}
    for place in kept:
        for operand in set(_places(operations[place])):
            users.setdefault(operand, []).append(place)
    order = [place for place in kept if not missing[place]]  # arguments and constants
    ready: list[int] = []
    for place in order:
        for user in users.get(place, ()):
            missing[user] -= 1
            if not missing[user]:
                ready.append(user)
    ready.sort(reverse=True)
    while ready:
        place = ready.pop()
        order.append(place)
        for user in reversed(users.get(place, ())):
            missing[user] -= 1
            if not missing[user]:
                ready.append(user)
    return order


def _moved(operation: Operation, moved: dict[int, int]) -> Operation:
    name, *operands = operation
    return operation if name in ("constant", "variable") else (name, *(moved[x] for x in operands))
