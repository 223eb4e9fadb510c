"""The integrators, one file per source; ``integrators["aba864"]`` is a :class:`~nearharmonic.Tableau`.

This package is the mapping ``integrators`` (``nearharmonic.registry.registry``). A key is the name, the label or
another name of an integrator, or the path of a Python file. Two views select methods by the type of their kicks.

Examples
--------
>>> import nearharmonic as nh
>>> nh.integrators["velocity_verlet"]
<Tableau leapfrog: label Leapfrog, stages 1, order 2, first kick>
"""

from nearharmonic.integrators.file import tableau_at
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.registry.registry import Registry, make_registry
from nearharmonic.registry.selection import Selection

__all__ = ["BENCHMARKED", "Tableau", "integrators", "modified_integrators", "plain_integrators"]

#: The ten methods of Nielsen's figures in the paper's order, which is the order of every legend.
BENCHMARKED = (
    "ruth",
    "s5odr4",
    "aba104",
    "aba864",
    "aba1064",
    "yoshida_s7o6a",
    "abas5o6h",
    "babs7o7h",
    "babps8o7h",
    "babps9o7h",
)

integrators: Registry[Tableau] = make_registry(
    __name__,
    "integrator",
    "TABLEAUS",
    lambda module: {t.name: t for t in getattr(module, "TABLEAUS", ())},
    tableau_at,
    lambda tableau: tableau.other_names,
)

#: Integrators without and with modified potentials.
plain_integrators = Selection(integrators, "plain_integrators", lambda tableau: not tableau.modified)
modified_integrators = Selection(
    integrators,
    "modified_integrators",
    lambda tableau: tableau.modified,
    """The integrators with modified potentials, a view of :mod:`nearharmonic.integrators`.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> "chin_4a" in nh.modified_integrators, "ruth" in nh.modified_integrators
    (True, False)
    """,
)
