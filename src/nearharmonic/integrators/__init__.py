"""The integrators, one file per source; ``integrators["aba864"]`` is a :class:`~nearharmonic.Tableau`.

This package is the mapping ``integrators`` (``nearharmonic.registry``). A key is the name, the label or
another name of an integrator, or the path of a Python file. Three views select methods: those whose kicks are of V
alone, those with kicks of a modified potential, and the implicit ones, which have no kicks.

Examples
--------
>>> import nearharmonic as nh
>>> nh.integrators["velocity_verlet"]
<Tableau leapfrog: label Leapfrog, stages 1, order 2, first kick>
"""

from nearharmonic.integrators.collocation import Collocation
from nearharmonic.integrators.file import tableau_at
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.registry import Registry, Selection

__all__ = [
    "BENCHMARKED", "Collocation", "Tableau", "implicit_integrators", "integrators", "modified_integrators",
    "plain_integrators",
]  # fmt: skip

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

integrators: Registry[Tableau] = Registry(
    __name__,
    "integrator",
    "TABLEAUS",
    lambda module: {t.name: t for t in getattr(module, "TABLEAUS", ())},
    tableau_at,
    lambda tableau: tableau.other_names,
)

#: Splitting methods without and with modified potentials, and methods that are no splitting.
plain_integrators = Selection(
    integrators, "plain_integrators", lambda tableau: not (tableau.modified or tableau.implicit)
)
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
implicit_integrators = Selection(
    integrators,
    "implicit_integrators",
    lambda tableau: tableau.implicit,
    """The implicit integrators, a view of :mod:`nearharmonic.integrators`; each is a
    ``nearharmonic.integrators.collocation.Collocation``.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> [(name, one.order) for name, one in nh.implicit_integrators.items()]
    [('gauss16', 16)]
    """,
)
