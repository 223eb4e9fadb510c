"""An integrator as text for another program: the targets and their numbers of digits."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from nearharmonic.exchange.method import Coefficients, as_registered, nearest_doubles, rounded
from nearharmonic.exchange.writers import c, data, diffrax, fortran, julia, rebound, sundials
from nearharmonic.integrators.tableau import Tableau

#: Functions that write the text, by target.
WRITERS: Mapping[str, Callable[[Coefficients], str]] = {
    "json": data.write_json,
    "toml": data.write_toml,
    "c": c.write,
    "julia": julia.write,
    "rebound": rebound.write,
    "diffrax": diffrax.write,
    "sundials": sundials.write,
    "fortran": fortran.write,
}
#: Targets that are data, not programs.
DATA = ("json", "toml")


def export(tableau: Tableau, to: str, digits: int | None = None) -> str:
    """Return an integrator as text for another program.

    Parameters
    ----------
    to : str
        One of :data:`nearharmonic.exchange.TARGETS`.
    digits : int, optional
        Significant digits of the coefficients. By default data have the digits of the tableau, and programs those of
        the nearest doubles.

    Raises
    ------
    SettingError
        ``digits`` is below 1 or above the number of digits to which the coefficients are known; or the integrator is
        implicit or has modified potentials.
    """
    if digits is not None:
        coefficients = rounded(tableau, digits)
    else:
        coefficients = as_registered(tableau) if to in DATA else nearest_doubles(tableau)
    return WRITERS[to](coefficients)
