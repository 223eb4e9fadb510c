"""Coefficients of splitting integrators, stored as exact decimal strings and validated on construction."""

from __future__ import annotations

import re
from dataclasses import InitVar, dataclass, replace
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cached_property
from hashlib import sha256
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from nearharmonic.errors import TableauError, bad_setting, shown

if TYPE_CHECKING:
    from numpy import int64
    from numpy.typing import NDArray


# --- Compositions of alternating kicks and drifts: common base of steps and processors.

#: Number of steps of one run, or of many runs.
Steps = TypeVar("Steps", int, "NDArray[int64]")
#: The operator applied first in a step: a drift moves q by dT/dp (ABA), a kick moves p by -dV/dq (BAB).
First = Literal["drift", "kick"]
Row = tuple[str, ...]
#: A move of a run: kick (with the sign of the force), drift, and coefficient of grad |grad V|^2.
Move = tuple[Fraction, Fraction, Fraction]

#: A coefficient. Exponents are bounded because coefficients are exact fractions: 1e999999999 would fill the memory.
DECIMAL = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?", re.ASCII)
#: Characters of a coefficient, and decimals that a source guarantees.
LONGEST, MOST_DIGITS = 1000, 1000


def is_count(value: object, most: int) -> bool:
    """Return True if ``value`` is an integer from 1 to ``most``."""
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= most


def written(coefficient: Any) -> Any:
    """Return a coefficient as a decimal: a float as it prints. Other objects are returned as they are."""
    if isinstance(coefficient, str | bool) or not isinstance(coefficient, int | float):
        return coefficient
    return repr(float(coefficient)) if isinstance(coefficient, float) else str(coefficient)


def palindrome(*half: str | float, centre: str | float | None = None) -> Row:
    """Return the palindrome of ``half``, ``centre`` if the length is odd, and ``half`` in reverse order.

    Parameters
    ----------
    *half : str or float
        First half of a row of coefficients: decimal strings; a float means the decimal that it prints as.
    centre : str or float, optional
        Coefficient in the middle, if the row has an odd length.

    Returns
    -------
    tuple of str
        The row.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> nh.palindrome("0.1", "0.2", centre="0.4")
    ('0.1', '0.2', '0.4', '0.2', '0.1')
    """
    row = tuple(map(written, half))
    return (*row, *(() if centre is None else (written(centre),)), *reversed(row))


class OneStepMethod:
    """A step that a kernel makes: a :class:`Composition` of kicks and drifts, or a collocation method.

    What differs between the two is overridden: the moves of a kernel, its settings, and the evaluations of the force.
    """

    name: str
    stages: int

    @property
    def other_names(self) -> tuple[str, ...]:
        """Label and aliases, which a look-up takes in place of the name."""
        return (vars(self)["label"], *vars(self)["aliases"])

    @property
    def moves_per_step(self) -> int:
        """Moves of a kernel in a step, apart from the one that opens or closes it."""
        return self.stages

    def steps(self, tau_per_stage: Fraction | float, t_end: Fraction | str | float, cost: float | None = None) -> int:
        """Return the steps in an interval, at least one, for a step size over the ``cost`` of a step, or its stages.

        It is max(1, round(t_end / tau)) with tau = ``tau_per_stage`` times the cost. The product is rounded to a double
        if both factors are doubles. The division is exact unless ``t_end`` is a double; a decimal string is exact.
        """
        tau = tau_per_stage * (self.stages if cost is None else cost)
        return max(1, round(Fraction(t_end) / Fraction(tau) if isinstance(t_end, str | Fraction) else t_end / tau))

    def _expect(self, condition: bool, key: str, value: object, expected: str) -> None:
        if not condition:
            raise TableauError(f"{self._kind}: {key} = {shown(value)}, expected {expected}")

    @property
    def _kind(self) -> str:
        raise NotImplementedError


class Composition(OneStepMethod):
    """Alternating kicks and drifts; each row has the order of its application.

    A kick of a step tau is p -= k tau grad V - m tau^3 grad |grad V|^2, where |grad V|^2 is the square of grad V with
    the inverse masses. It is the exact flow of the potential k tau V - m tau^3 |grad V|^2. The row ``square`` has the
    coefficients m, one for each kick; without this row all kicks are of V alone.
    """

    first: First
    kick: Row
    drift: Row
    square: Row
    digits: int
    implicit = False

    @property
    def outer(self) -> Row:
        """The s + 1 coefficients of the operator that comes first and last."""
        return self.kick if self.first == "kick" else self.drift

    @property
    def inner(self) -> Row:
        """The s coefficients of the operator in between."""
        return self.drift if self.first == "kick" else self.kick

    @property
    def stages(self) -> int:  # type: ignore[override]
        """Force evaluations per step, s; with the kick first, the last force of a step is the first of the next."""
        return len(self.inner)

    def evaluations(self, steps: Steps) -> Steps:
        """Return the force evaluations of a run: s per step, and one more at the start if the kick is first."""
        return steps * self.stages + self.first_same_as_last

    @property
    def first_same_as_last(self) -> bool:
        """True if the last kick of a step and the first kick of the next step share one force."""
        return self.first == "kick"

    @property
    def modified(self) -> bool:
        """True if the method has modified potentials."""
        return bool(self.square)

    @cached_property
    def exact_rows(self) -> tuple[tuple[Fraction, ...], ...]:
        """Kicks, drifts and squares as exact rational numbers; squares are 0 without such a row."""
        rows = self.kick, self.drift, self.square or ("0",) * len(self.kick)
        return tuple(tuple(map(Fraction, row)) for row in rows)

    @property
    def kernel_options(self) -> dict[str, Any]:
        """Settings that the compiled code depends on."""
        return {"modified": self.modified}

    @property
    def compositions(self) -> tuple[Composition, ...]:
        """Compositions that a run applies: only the step, unless there is a processor."""
        return (self,)

    def moves(self, tau: Fraction = Fraction(1), *, rounded: bool = False) -> list[Move]:
        """Return the s + 2 moves of a run, multiplied exactly by powers of a step size.

        The first is the first move of a run. The second is the first move of each later step, merged with the last move
        of the step before. Then come the other moves, and the last move of a step. A run that begins with a drift has
        no first kick. If ``rounded``, products of coefficients and powers of tau are rounded to doubles before
        additions.
        """
        found = ([c * factor for c in row] for row, factor in zip(self.exact_rows, (-tau, tau, tau**3), strict=True))
        kicks, drifts, squares = ([Fraction(float(c)) for c in row] if rounded else row for row in found)
        nothing = Fraction(0)
        if self.first == "kick":
            opening, *between = zip(kicks, drifts, squares, strict=False)
            closing = kicks[-1], nothing, squares[-1]
            return [opening, (kicks[-1] + kicks[0], drifts[0], squares[-1] + squares[0]), *between, closing]
        *between, closing = zip(kicks, drifts[1:], squares, strict=True)
        merged = kicks[-1], drifts[-1] + drifts[0], squares[-1]
        return [(nothing, drifts[0], nothing), merged, *between, closing]

    def _check_rows(self) -> None:
        """Write floats as the decimals that they print as; raise an error for other objects, or for wrong lengths."""
        for key in ("kick", "drift", "square"):
            row = getattr(self, key)
            self._expect(isinstance(row, tuple | list), key, row, "a tuple of decimals")
            row = tuple(map(written, row))
            object.__setattr__(self, key, row)
            for i, text in enumerate(row):
                decimal = isinstance(text, str) and len(text) <= LONGEST and DECIMAL.fullmatch(text) is not None
                allowed = f"a finite decimal number of at most {LONGEST} characters"
                self._expect(decimal, f"{key}[{i}]", text, allowed)
        lengths = f"{len(self.kick)} kicks, {len(self.drift)} drifts"
        fits = len(self.outer) == len(self.inner) + 1 >= 2
        self._expect(fits, "rows", lengths, f"one {self.first} more than the other operator, as first = {self.first!r}")
        fits = len(self.square) in (0, len(self.kick))
        self._expect(fits, "square", f"{len(self.square)} numbers", f"one for each of {len(self.kick)} kicks")

    def _check_digits(self) -> None:
        self._expect(is_count(self.digits, MOST_DIGITS), "digits", self.digits, f"an integer from 1 to {MOST_DIGITS}")

    def _check_sums(self, total: int) -> None:
        for key, row in (("kick", self.kick), ("drift", self.drift)):
            # Exact: this precision holds all digits of the numbers, because exponents have at most three digits.
            with localcontext(prec=2 * (1001 + max(map(len, row)))):
                excess = sum(map(Decimal, row), start=Decimal(-total))
            balanced = abs(Fraction(excess)) * 10**self.digits <= len(row)
            shown = f"{total}{float(excess):+.1e}"
            self._expect(balanced, f"{key} row sum", shown, f"{total} within {len(row)}e-{self.digits}")


@dataclass(frozen=True, kw_only=True)
class Processor(Composition):
    """A step close to the identity: the kicks sum to 0, and so do the drifts.

    ``kick`` and ``drift`` are in units of tau, s + 1 for the operator named by ``first`` and s for the other, and
    ``square`` has the coefficients of grad |grad V|^2 in units of tau^3, one for each kick. Their first ``digits``
    decimals are guaranteed.
    """

    first: First
    kick: Row
    drift: Row
    square: Row
    digits: int

    def __post_init__(self) -> None:
        self._check_digits()
        self._check_rows()
        self._check_sums(0)

    @cached_property
    def inverse(self) -> Processor:
        """The inverse processor."""
        rows = ([_negated(text) for text in reversed(row)] for row in (self.kick, self.drift, self.square))
        kick, drift, square = map(tuple, rows)
        return Processor(first=self.first, kick=kick, drift=drift, square=square, digits=self.digits)

    @property
    def _kind(self) -> str:
        return "processor"


def _negated(text: str) -> str:
    return text[1:] if text.startswith("-") else f"-{text.removeprefix('+')}"


# --- The coefficients of one integrator.

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
        return self._exchanged

    @cached_property
    def _exchanged(self) -> Tableau:
        # A Nystrom method loses its order. Any consistent composition has order 1, and any symmetric one has order 2.
        order = self.order if self.requires is None else 1 + self.symmetric
        return replace(
            self, first=_OTHER[self.first], kick=self.drift, drift=self.kick, order=order, requires=None,
            harmonic_order=None, generalised_order=None,
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
