"""Hamiltonian of a kernel, as functions of numbers of any type."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nearharmonic.core.formulas.number import Constant

if TYPE_CHECKING:
    from nearharmonic.core.collocation.table import StageTable
    from nearharmonic.core.large.energy import LoopedEnergy
    from nearharmonic.core.machine.numba_functions import NumbaCode


@dataclass(frozen=True, kw_only=True)
class Hamiltonian:
    """A separable Hamiltonian of an autonomous system.

    Attributes
    ----------
    name : str
        Name of the system, for errors.
    dimension : int
        Number of coordinates d.
    V, T : callable
        Formulas ``f(q, *parameters)`` and ``f(p, *parameters)``, which return a scalar.
    grad_V, grad_T : callable
        Their gradients, which return a tuple of d components.
    grad_V_and_V : callable
        The components of grad_V, followed by V; both share operations.
    balanced_T : callable
        T in an order of operations with short chains.
    acceleration : callable, or None
        ``f(force, *parameters)``, dT/dp minus its value at p = 0, which does not depend on p if T is quadratic.
    """

    name: str
    dimension: int
    V: Callable[..., Any]
    grad_V: Callable[..., Any]
    T: Callable[..., Any]
    grad_T: Callable[..., Any]
    grad_V_and_V: Callable[..., Any]
    balanced_T: Callable[..., Any]
    acceleration: Callable[..., Any] | None = None


@dataclass(frozen=True, kw_only=True)
class Physics(Hamiltonian):
    """A Hamiltonian as the kernel needs it; ``acceleration`` is None unless T is quadratic.

    Attributes
    ----------
    parameters : int
        Number of parameters of a run, which are in the rows behind its tally.
    constants : tuple of Constant
        Parameters that are compiled in because a formula needs their values; ``parameters`` is then 0.
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
    stages : StageTable, or None
        Coefficients of a collocation method, whose stages are solved together.
    timed : bool
        True if the last coordinate of ``loops`` is the time.
    """

    parameters: int
    constants: tuple[Constant, ...]
    measured: Callable[..., Any] | None = None
    loops: tuple[LoopedEnergy, LoopedEnergy] | None = None
    unit_masses: bool = False
    turning: tuple[int, ...] | None = None
    modified: Callable[..., Any] | None = None
    numba: NumbaCode | None = None
    stages: StageTable | None = None
    timed: bool = False
