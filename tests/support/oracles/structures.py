"""Structure of single methods on single systems, as numbers with names."""

from fractions import Fraction
from types import SimpleNamespace

from nearharmonic.output.store import assembled
from nearharmonic_paper.experiments.stability.reductions import structure_cube
from nearharmonic_paper.experiments.stability.run import structure_runs


def runs_of(system, tableaus, t_end):
    """The run file of the methods on a system."""
    return assembled(structure_runs(system, tableaus, Fraction(t_end)), ["label"], {})


def structure(system, tableau, *, t_end):
    """The cube of one method on one system."""
    cube = structure_cube([tableau], {system.name: runs_of(system, [tableau], t_end)})
    return SimpleNamespace(**{str(name): values.item() for name, values in cube.items()})
