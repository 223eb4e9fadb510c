"""ASE: a method as molecular dynamics, and a trial of methods on the atoms of a user."""

from nearharmonic.adapters.ase.dynamics import Splitting
from nearharmonic.adapters.ase.trial import recommend

__all__ = ["Splitting", "recommend"]
