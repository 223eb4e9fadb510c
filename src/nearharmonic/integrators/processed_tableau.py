"""Coefficients of a processed integrator: a kernel that is repeated, and a processor that is applied at output only."""

from __future__ import annotations

from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cached_property
from hashlib import sha256

from nearharmonic.errors import TableauError
from nearharmonic.integrators.modified_tableau import ModifiedTableau
from nearharmonic.integrators.tableau import DECIMAL, Composition, First, Row


@dataclass(frozen=True, kw_only=True)
class Processor(Composition):
    """A step close to the identity, whose kicks and whose drifts each add up to 0.

    Parameters
    ----------
    first : {"drift", "kick"}
        Operator that comes first and last.
    kick, drift : tuple of str
        Coefficients in units of tau, s + 1 for the operator named by ``first`` and s for the other.
    square : tuple of str
        Coefficients of grad |grad V|^2 in units of tau^3, one for each kick.
    digits : int
        Number of decimals that are guaranteed.

    Raises
    ------
    TableauError
        A coefficient that is no decimal number, a row of the wrong length, or a sum that is not 0 to the digits.
    """

    first: First
    kick: Row
    drift: Row
    square: Row
    digits: int

    def __post_init__(self) -> None:
        for key in ("kick", "drift", "square"):
            for i, text in enumerate(getattr(self, key)):
                if DECIMAL.fullmatch(text) is None:
                    raise TableauError(
                        f"processor: {key}[{i}] = {text!r}, expected a finite decimal number as a string"
                    )
        if not (len(self.outer) == len(self.inner) + 1 >= 2 and len(self.square) == len(self.kick)):
            lengths = f"{len(self.kick)} kicks, {len(self.square)} squares, {len(self.drift)} drifts"
            raise TableauError(f"processor: rows = {lengths!r}, expected one {self.first} more than the other operator")
        for key in ("kick", "drift"):
            total = sum(map(Fraction, getattr(self, key)))
            if abs(total) * 10**self.digits > len(getattr(self, key)):
                raise TableauError(f"processor: {key} row sum = {float(total):.1e}, expected 0")

    @property
    def modified(self) -> bool:
        """True if kicks are of a modified potential."""
        return True

    @property
    def processed(self) -> bool:
        """True if it has a processor itself."""
        return False

    @cached_property
    def inverse(self) -> Processor:
        """The processor that undoes this one."""
        rows = ([_negated(text) for text in reversed(row)] for row in (self.kick, self.drift, self.square))
        kick, drift, square = map(tuple, rows)
        return Processor(first=self.first, kick=kick, drift=drift, square=square, digits=self.digits)


@dataclass(frozen=True, kw_only=True, repr=False)
class ProcessedTableau(ModifiedTableau):
    """The coefficients of a processed integrator for quadratic T.

    The rows are those of the kernel, which is repeated from output to output. A run starts with the inverse of the
    processor, and each output is a state of the kernel with the processor applied: the method is the kernel in other
    variables, and has an order that the kernel alone does not have.

    Parameters
    ----------
    processor : Processor
        What is applied at output.

    See Also
    --------
    ModifiedTableau : the other parameters; ``order`` is that of processed states.
    """

    processor: Processor

    @property
    def processed(self) -> bool:
        """True if a processor is applied at output."""
        return True

    @cached_property
    def kernel(self) -> ModifiedTableau:
        """Repeated step as a method of its own; its order is not proved."""
        given = {x.name: getattr(self, x.name) for x in fields(ModifiedTableau)}
        return ModifiedTableau(**given)

    def digest(self) -> str:
        """Return the SHA-256, in hex, of what determines the numbers of a run."""
        rows = self.processor.first, *self.processor.kick, *self.processor.drift, *self.processor.square
        return sha256(f"{super().digest()} {' '.join(rows)}".encode()).hexdigest()


def _negated(text: str) -> str:
    return text[1:] if text.startswith("-") else f"-{text.removeprefix('+')}"
