"""Runs of regularised systems: equal steps of a fictitious time, samples that land on physical times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.batch.kernels import physics_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import bad_setting
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.remembered import remembered
from nearharmonic.systems.definition.system import System

if TYPE_CHECKING:
    from nearharmonic.core.machine.native import PreparedCall


@remembered
def landing_of(system: System, numerics: Numerics, stages: int = 0) -> Callable[..., PreparedCall]:
    """Return a function that prepares calls of the compiled runs of ``system``, cached on disk.

    ``stages`` is the number of stages of a collocation method, or 0.
    """
    from nearharmonic.core.loops.kernel import build_landing

    return build_landing(
        physics_of(system, stages=stages),
        system.formulas().regularised,
        extended=numerics.precision == "extended",
        compensated=numerics.compensated,
        energy=numerics.energy,
    )


@remembered
def unperturbed(system: System) -> System:
    """Return ``system`` without its perturbation: an oscillator, whose forces are cheap."""
    assert system.regularisation is not None
    return replace(system, regularisation=replace(system.regularisation, perturbation=None))


def landing_call(
    system: System, numerics: Numerics, stages: int, parameters: Floats, arguments: tuple[Any, ...]
) -> Callable[[], None]:
    """Return a call of the runs of a regularised system: with the perturbation, or without it if its strength is 0.

    Parameters
    ----------
    system, numerics
        Regularised system, and arithmetic.
    stages : int
        Stages of a collocation method; 0 for a splitting method.
    parameters : (R or 1, 2 P) array of float
        Parameters of the runs, which may change from call to call.
    arguments : tuple
        Arguments of the function that :func:`nearharmonic.core.loops.kernel.build_landing` returns.
    """
    strength = None if system.regularisation is None else system.regularisation.strength
    place = None if strength is None else 2 * list(system.parameters).index(strength)

    @cache
    def prepared(perturbed: bool) -> PreparedCall:
        return landing_of(system if perturbed else unperturbed(system), numerics.compiled, stages)(*arguments)

    def call() -> None:
        prepared(place is None or bool(parameters[:, place].any()))()

    return call


def check_bound(system: System, start: Floats, parameters: Floats) -> None:
    """Raise an error for starts of a regularised system whose orbit is not bound.

    Parameters
    ----------
    system : System
        Of d coordinates; nothing is refused if it is not regularised.
    start : (R, 4 d) array of float
        Initial states.
    parameters : (R or 1, 2 P) array of float
        Parameters, as pairs.

    Raises
    ------
    SettingError
        An energy that is not below 0.
    """
    if system.regularisation is None:
        return
    rows = start.reshape(len(start), 4, -1)
    with np.errstate(all="ignore"):
        H = np.broadcast_to(system.energy(tuple(rows[:, 0].T), tuple(rows[:, 2].T), list(parameters.T[::2])), len(rows))
    (wrong,) = np.nonzero(~(H < 0))
    if wrong.size:
        q0, p0 = (rows[wrong[0], k].tolist() for k in (0, 2))
        what = f"a state of {system.name} with an energy below 0, on a bound orbit; its energy is {H[wrong[0]]:g}"
        raise bad_setting("(q0, p0)", f"({q0}, {p0})", what)
