"""The tableau type by its short name: ``from nearharmonic.tableau import Tableau, palindrome``."""

from nearharmonic.integrators.tableau import First, Row, Tableau, palindrome

__all__ = ["First", "Row", "Tableau", "palindrome"]
