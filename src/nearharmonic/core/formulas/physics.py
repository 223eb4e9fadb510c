"""A Hamiltonian as the kernels need it."""

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
        For errors.
    V, grad_V, T, grad_T : callable
        Formulas ``f(q, *parameters)`` and ``f(p, *parameters)``.
    grad_V_and_V : callable
        The components of grad_V and V behind them, of shared operations.
    balanced_T : callable
        T in an order that keeps chains of operations short.
    acceleration : callable, or None
        ``f(force, *parameters)``, dT/dp without what it is at p = 0, if T is quadratic.
    parameters : int
        Number of parameters that a run is given, in the rows behind its tally.
    constants : tuple of Constant
        Parameters that are compiled in, because a formula needs their values; there are none of the others then.
    dimension : int
        Number of coordinates.
    measured : callable, or None
        ``f(q, p, *parameters)``, the kinetic and the potential energy to be measured in place of T and V.
    loops : tuple of LoopedEnergy, or None
        V and T as loops, for many coordinates: then nothing of the formulas above is compiled.
    unit_masses : bool
        Whether T = p.p / 2.
    turning : tuple of int, or None
        Where T and an oscillator are solved exactly together: of each coordinate, the place of its frequency among the
        distinct ones. ``grad_V`` is then that of the rest of V, which the kick takes.
    modified : callable, or None
        ``f(q, *parameters)``, the gradient of the square of grad_V, where kicks are of a modified potential.
    numba : NumbaCode, or None
        Code that V and grad_V call, where they are functions of numba: for one lane.
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
