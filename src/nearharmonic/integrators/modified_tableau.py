"""Coefficients of a splitting integrator whose kicks are of a modified potential, exact and validated."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from hashlib import sha256

from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, First, Row, Tableau


@dataclass(frozen=True, kw_only=True, repr=False)
class ModifiedTableau(Tableau):
    """The coefficients of one integrator for H = T(p) + V(q) with quadratic T and kicks of a modified potential.

    A kick of a step tau is p -= k tau grad V - m tau^3 grad |grad V|^2, with |grad V|^2 the square of grad V by the
    inverse masses: the exact flow of the potential k tau V - m tau^3 |grad V|^2.

    Parameters
    ----------
    square : tuple of str
        Coefficients m in units of tau^3, one for each kick: "0" for a kick of V alone, which needs no gradient.

    See Also
    --------
    Tableau : the other parameters; ``requires`` and ``symmetric`` are found.

    Raises
    ------
    TableauError
        As for Tableau; or another number of coefficients m than of kicks.
    """

    square: Row

    def __post_init__(self) -> None:
        object.__setattr__(self, "requires", QUADRATIC_KINETIC_ENERGY)
        super().__post_init__()
        self._check_numbers("square")
        fits = len(self.square) == len(self.kick)
        self._expect(fits, "square", f"{len(self.square)} numbers", f"one for each of {len(self.kick)} kicks")
        if self.symmetric:
            for i, (text, mirror) in enumerate(zip(self.square, reversed(self.square), strict=True)):
                self._expect(Fraction(text) == Fraction(mirror), f"square[{i}]", text, f"its mirror image {mirror!r}")

    @property
    def modified(self) -> bool:
        """True if kicks are of a modified potential."""
        return True

    @property
    def gradients(self) -> int:
        """Force evaluations of a step that take the gradient of the square as well."""
        needed = [bool(Fraction(m)) for m in self.square]
        if self.first == "kick":  # the last kick of a step and the first of the next take one force
            needed = [needed[0] or needed[-1], *needed[1:-1]]
        return sum(needed)

    @property
    def facts(self) -> dict[str, object]:
        """Facts of the tableau that a notebook shows, by name."""
        facts = super().facts
        return {**{name: facts[name] for name in ("name", "label", "stages")}, "gradients": self.gradients, **facts}

    def role(self, first: First | None) -> Tableau:
        """Return the tableau itself: its roles cannot be swapped, as a modified kick is no drift.

        Raises
        ------
        SettingError
            ``first`` is the other operator.
        """
        if first is not None and first != self.first:
            what = f"{self.first!r} or nothing, as {self.name} has kicks of a modified potential"
            raise bad_setting("first", first, what)
        return self

    def digest(self) -> str:
        """Return the SHA-256, in hex, of what determines the numbers of a run."""
        return sha256(f"{super().digest()} {' '.join(self.square)}".encode()).hexdigest()
