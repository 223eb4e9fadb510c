"""Coefficients of a splitting integrator, stored as exact decimal strings and validated on construction."""

from __future__ import annotations

import re
from dataclasses import InitVar, dataclass, replace
from fractions import Fraction
from functools import cached_property
from hashlib import sha256
from typing import Any

from nearharmonic.errors import bad_setting, shown
from nearharmonic.integrators.composition import Composition, First, Processor, Row, is_count, palindrome

__all__ = [
    "QUADRATIC_KINETIC_ENERGY", "First", "ModifiedTableau", "ProcessedTableau", "Processor", "Row", "Tableau",
    "palindrome",
]  # fmt: skip

#: Requirement of a tableau of Runge-Kutta-Nystrom type: T = p.p / 2.
QUADRATIC_KINETIC_ENERGY = "quadratic kinetic energy"

#: Names of tableaus are parts of file names.
NAME = re.compile(r"[^\s/\\.-][^/\\]{0,99}")
#: No splitting method of a higher order is known.
HIGHEST_ORDER = 20

_OTHER: dict[First, First] = {"drift": "kick", "kick": "drift"}


@dataclass(frozen=True, kw_only=True)
class Tableau(Composition):
    """The coefficients of one integrator for H = T(p) + V(q), as decimal strings.

    One step of size tau applies ``outer[0], inner[0], outer[1], ..., inner[s-1], outer[s]``, where ``outer`` (s + 1
    values) is the row of the operator named by ``first`` and ``inner`` (s values) the row of the other one. A method
    with as many kicks as drifts begins or ends with "0" in its outer row.

    Parameters
    ----------
    name, label : str
        Name in settings, and name in figures and tables, by default the same.
    order : int
        Order for any separable H (for T = p.p/2 only, if ``requires`` says so).
    first : {"drift", "kick"}
        Operator that comes first and last in a step.
    kick, drift : tuple of str
        Coefficients of the two operators in units of tau, s + 1 for the one named by ``first`` and s for the other. A
        float is written as the decimal that it prints as.
    source : str
        Source of the coefficients.
    digits : int
        Number of decimals that the source guarantees.
    square : tuple of str, optional
        Coefficients m of modified kicks, ``p -= k tau grad V - m tau^3 grad |grad V|^2``, in units of tau^3; "0" for a
        kick of V alone, which needs no gradient of the square. Such a method requires a quadratic kinetic energy.
    processor : Processor, optional
        Composition that is applied only at output. A run then begins with the inverse processor and repeats the rows,
        and each output is processed. ``order`` is the order of processed states.
    requires : str, optional
        Requirement for a system: "quadratic kinetic energy", or none.
    note : str
        A remark.
    aliases : tuple of str
        Other names under which the field knows the method. A look-up takes them and the label in place of the name.
    benchmarked : bool
        True for the ten methods of Nielsen's figures.
    harmonic_order : int, optional
        Harmonic order lambda_H that the source claims (Nielsen 2015, Eq. 17), or None.
    generalised_order : tuple of int, optional
        Orders (r1, r2, ...) in tau that the source claims for the errors of size epsilon tau^r1, epsilon^2 tau^r2, ...
        for H = H_A + epsilon H_B (Blanes et al. 2013), or None.
    symmetric : bool, optional
        True if both rows are palindromes, so that a step of -tau is the inverse of a step of tau; derived from the
        rows. Rows that are no palindromes raise an error, unless ``outer`` has "0" at exactly one end, or False is
        given.

    Raises
    ------
    TableauError
        A coefficient that is no decimal number; a row of the wrong length; a row of a symmetric method that is no
        palindrome; a row whose sum differs from 1 by more than one unit of the last guaranteed decimal per coefficient;
        or a processor of a method without squares.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> rows = {"drift": nh.palindrome("0.5"), "kick": ("1",)}
    >>> method = nh.Tableau(name="verlet_q", order=2, first="drift", **rows, source="an example", digits=80)
    >>> nh.order_of(method), float(nh.stability_limit(method))
    (2, 2.0)
    """

    name: str
    label: str = ""
    order: int
    first: First
    kick: Row
    drift: Row
    source: str
    digits: int
    square: Row = ()
    processor: Processor | None = None
    requires: str | None = None
    note: str = ""
    aliases: InitVar[tuple[str, ...]] = ()  # no field: two tableaus may be equal under different names
    benchmarked: bool = False
    harmonic_order: int | None = None
    generalised_order: tuple[int, ...] | None = None
    symmetric: bool = None  # type: ignore[assignment]  # None is for the constructor alone

    def __post_init__(self, aliases: tuple[str, ...]) -> None:
        object.__setattr__(self, "aliases", aliases)  # from where dataclasses.replace takes it
        self._check_texts()
        object.__setattr__(self, "label", self.label or self.name)
        self._expect(self.first in ("drift", "kick"), "first", self.first, "'drift' or 'kick'")
        self._check_digits()
        square: Any = self.square  # a user may pass anything
        if not isinstance(square, tuple) or square:
            object.__setattr__(self, "requires", QUADRATIC_KINETIC_ENERGY)
        known = self.requires in (None, QUADRATIC_KINETIC_ENERGY)
        self._expect(known, "requires", self.requires, f"None or {QUADRATIC_KINETIC_ENERGY!r}")
        self._check_rows()
        self._check_order()
        self._check_symmetry()
        self._check_sums(1)
        fits = self.processor is None or (self.modified and self.processor.modified)
        self._expect(fits, "processor", self.processor, "None, as there are kicks of V alone")

    @property
    def processed(self) -> bool:
        """True if a processor is applied at output."""
        return self.processor is not None

    @cached_property
    def kernel(self) -> Tableau:
        """Kernel of a processed method as a method without processor; its order is not proved."""
        return replace(self, processor=None)

    @property
    def compositions(self) -> tuple[Composition, ...]:
        """Compositions that a run applies: the kernel, the inverse processor and the processor, if there is one."""
        return (self,) if self.processor is None else (self.kernel, self.processor.inverse, self.processor)

    @property
    def gradients(self) -> int:
        """Number of force evaluations per step with the gradient of the square."""
        needed = [bool(Fraction(m)) for m in self.square]
        if needed and self.first == "kick":  # the last kick of a step and the first of the next share one force
            needed = [needed[0] or needed[-1], *needed[1:-1]]
        return sum(needed)

    @property
    def facts(self) -> dict[str, object]:
        """Properties of the tableau that a notebook shows, by name."""
        return {
            "name": self.name,
            "label": self.label,
            "stages": self.stages,
            **({"gradients": self.gradients} if self.modified else {}),
            "order": self.order,
            "first": self.first,
            "symmetric": "" if self.symmetric else "no",
            "requires": self.requires or "",
            "source": self.source,
        }

    def __repr__(self) -> str:
        from nearharmonic.registry import line

        return line("Tableau", self.facts)

    def _repr_html_(self) -> str:
        from nearharmonic.registry import facts_table

        rows = {
            f"{name} coefficients": ", ".join(f"{float(c)!r}" for c in getattr(self, name))
            for name in ("drift", "kick", *(["square"] if self.modified else []))
        }
        return facts_table("Tableau", {**self.facts, **rows})

    def _check_texts(self) -> None:
        """Raise an error for a name that is no name of a file, or for other members that are no text."""
        name: Any = self.name  # a user may pass anything
        named = isinstance(name, str) and name.isprintable() and NAME.fullmatch(name) is not None
        self._expect(named, "name", name, "1 to 100 printable characters without '/' and '\\', no '.' or '-' first")
        for key in ("label", "source", "note"):
            self._expect(isinstance(text := getattr(self, key), str), key, text, "a string")
        aliases = vars(self)["aliases"]
        texts = isinstance(aliases, tuple) and all(isinstance(alias, str) for alias in aliases)
        self._expect(texts, "aliases", aliases, "a tuple of strings")

    def _check_order(self) -> None:
        """Raise an error for an impossible order: s kicks of V make an oscillator's step a polynomial of degree 2 s."""
        most = HIGHEST_ORDER if self.modified or self.processor is not None else min(HIGHEST_ORDER, 2 * self.stages)
        allowed = f"an integer from 1 to {most}" + (", twice the stages" if most == 2 * self.stages else "")
        self._expect(is_count(self.order, most), "order", self.order, allowed)

    def _check_symmetry(self) -> None:
        """Derive the symmetry of the method, and raise an error for rows that contradict its declaration.

        A coefficient that differs from its mirror image usually has a wrong digit. Asymmetric rows must therefore be
        recognisable by a "0" at one end, which no palindrome has.
        """
        symmetric: Any = self.symmetric  # None before this check
        self._expect(symmetric is None or isinstance(symmetric, bool), "symmetric", symmetric, "True, False or None")
        off = [
            (f"{key}[{i}]", text, mirror)
            for key in ("kick", "drift", "square")
            for i, (text, mirror) in enumerate(zip(getattr(self, key), reversed(getattr(self, key)), strict=True))
            if text != mirror and Fraction(text) != Fraction(mirror)
        ]
        padded = (Fraction(self.outer[0]) == 0) != (Fraction(self.outer[-1]) == 0)
        if off and (symmetric or (symmetric is None and not padded)):
            place, text, mirror = off[0]
            self._expect(False, place, text, f"its mirror image {mirror!r}, or symmetric = False")
        object.__setattr__(self, "symmetric", not off)

    @property
    def _kind(self) -> str:
        return f"tableau {shown(self.name)}"

    def role(self, first: First | None) -> Tableau:
        """Return the tableau with its outer row assigned to the operator ``first``; None leaves the roles as declared.

        A tableau with exchanged roles keeps its order for separable H, but loses further claims of the source. One that
        requires a quadratic kinetic energy keeps only order 2 for certain, for any separable H, or order 1 if it is not
        symmetric. One with modified potentials is refused: drifts cannot have them.
        """
        if first is None or first == self.first:
            return self
        if self.modified:
            what = f"{self.first!r} or nothing, as {self.name} has kicks of a modified potential"
            raise bad_setting("first", first, what)
        if first not in _OTHER:
            raise bad_setting("first", first, "it is 'drift' or 'kick'")
        # A Nystrom method loses its order. Any consistent composition has order 1, and any symmetric one has order 2.
        order = self.order if self.requires is None else 1 + self.symmetric
        return replace(
            self, first=first, kick=self.drift, drift=self.kick, order=order, requires=None, harmonic_order=None,
            generalised_order=None,
        )  # fmt: skip

    def rows_exact(self) -> tuple[tuple[Fraction, ...], tuple[Fraction, ...]]:
        """Return the outer and the inner row as exact rational numbers."""
        return tuple(map(Fraction, self.outer)), tuple(map(Fraction, self.inner))

    def rows_double(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the outer and the inner row, each coefficient rounded once to the nearest double."""
        return tuple(map(float, self.outer)), tuple(map(float, self.inner))

    def digest(self) -> str:
        """Return the SHA-256, in hex, of the first operator and all rows, which determine the results of a run."""
        text = "\n".join((self.first, " ".join(self.outer), " ".join(self.inner)))
        found = sha256(text.encode()).hexdigest()
        if self.modified:
            found = sha256(f"{found} {' '.join(self.square)}".encode()).hexdigest()
        if self.processor is not None:
            given = self.processor
            rows = given.first, *given.kick, *given.drift, *given.square
            found = sha256(f"{found} {' '.join(rows)}".encode()).hexdigest()
        return found


#: Other names of the type, for methods with squares and for methods with a processor.
ModifiedTableau = ProcessedTableau = Tableau
