"""Hamiltonian of a kernel, as functions of numbers of any type."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nearharmonic.core.formulas.number import Constant

if TYPE_CHECKING:
    from nearharmonic.core.large.energy import LoopedEnergy
    from nearharmonic.core.machine.numba_functions import NumbaCode


@dataclass(frozen=True, kw_only=True)
class Physics:
    """A Hamiltonian as the kernel needs it.

    Attributes
    ----------
    name : str
        Name of the system, for errors.
    V, grad_V, T, grad_T : callable
        Formulas ``f(q, *parameters)`` and ``f(p, *parameters)``.
    grad_V_and_V : callable
        The components of grad_V, followed by V; both share operations.
    balanced_T : callable
        T in an order of operations with short chains.
    acceleration : callable, or None
        ``f(force, *parameters)``, dT/dp minus its value at p = 0, if T is quadratic.
    parameters : int
        Number of parameters of a run, which are in the rows behind its tally.
    constants : tuple of Constant
        Parameters that are compiled in because a formula needs their values; ``parameters`` is then 0.
    dimension : int
        Number of coordinates.
    measured : callable, or None
        ``f(q, p, *parameters)``, the kinetic and the potential energy that are measured instead of T and V.
    loops : tuple of LoopedEnergy, or None
        V and T as loops, for many coordinates; the formulas above are then not compiled.
    unit_masses : bool
        True if T = p.p / 2.
    turning : tuple of int, or None
        For T and an oscillator that are solved exactly together: the index of the frequency of each coordinate among
        the distinct frequencies. ``grad_V`` is then the gradient of the rest of V, which kicks use.
    modified : callable, or None
        ``f(q, *parameters)``, the gradient of the square of grad_V, if kicks use a modified potential.
    numba : NumbaCode, or None
        Code of V and grad_V that are functions of numba, for one lane.
    """

    name: str
    V: Callable[..., Any]
    grad_V: Callable[..., Any]
    grad_V_and_V: Callable[..., Any]
    T: Callable[..., Any]
    balanced_T: Callable[..., Any]
    grad_T: Callable[..., Any]
    parameters: int
    constants: tuple[Constant, ...]
    dimension: int
    acceleration: Callable[..., Any] | None = None
    measured: Callable[..., Any] | None = None
    loops: tuple[LoopedEnergy, LoopedEnergy] | None = None
    unit_masses: bool = False
    turning: tuple[int, ...] | None = None
    modified: Callable[..., Any] | None = None
    numba: NumbaCode | None = None
