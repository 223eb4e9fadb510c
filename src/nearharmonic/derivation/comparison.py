"""The errors of several solutions of one case, side by side: on the harmonic oscillator exactly, elsewhere measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from nearharmonic.decomposition import harmonic_energy_error
from nearharmonic.derivation.isolated import Isolated
from nearharmonic.integrate import sweep
from nearharmonic.tableau import First

ROLES: tuple[First, ...] = ("drift", "kick")
#: Decimals of the coefficients that errors are measured with.
DIGITS = 40


@dataclass(frozen=True)
class Errors:
    """Energy errors of one solution in one role, per step size: |H - H0|/|H0|, infinite where it left its surface.

    ``harmonic_oscillator`` is the exact supremum over arbitrarily many steps, ``henon_heiles`` the maximum over every
    step of the system's whole interval.
    """

    solution: int
    first: First
    tau_per_stage: tuple[float, ...]
    harmonic_oscillator: tuple[float, ...]
    henon_heiles: tuple[float, ...]


def compare(isolated: Isolated, tau_per_stage: Sequence[float], *, t_end: float | None = None) -> list[Errors]:
    """The errors of every root of ``isolated``, numbered from 0 in its order, drift first and kick first."""
    equations, rows = isolated.equations, []
    taus = [tau * equations.stages for tau in tau_per_stage]
    for number, root in enumerate(isolated.roots):
        tableau = root.tableau(equations, f"solution_{number}", DIGITS)
        for first in ROLES:
            measured = sweep("henon_heiles", tableau.role(first), taus, t_end=t_end)
            rows.append(
                Errors(
                    solution=number,
                    first=first,
                    tau_per_stage=tuple(tau_per_stage),
                    harmonic_oscillator=tuple(float(harmonic_energy_error(tableau, t, first=first)) for t in taus),
                    henon_heiles=tuple(measured.max_energy_error.values.tolist()),
                )
            )
    return rows
