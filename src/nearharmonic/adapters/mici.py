"""Methods as integrators of mici, for Hamiltonian Monte Carlo with :class:`mici.systems.EuclideanMetricSystem`."""

from __future__ import annotations

from typing import Any

from mici.integrators import TractableFlowIntegrator
from mici.states import ChainState
from mici.systems import System

from nearharmonic.engine.settings import checked_tau
from nearharmonic.errors import SettingError, bad_setting
from nearharmonic.exchange.method import Method, VelocityCheck, method_for
from nearharmonic.integrators.tableau import Tableau

#: Length of a kick whose force is compared: the rounding of the momenta has no part in it.
LONG = 2.0**40


class SplittingIntegrator(TractableFlowIntegrator):  # type: ignore[misc]  # its types are skipped
    """An integrator of mici that takes the steps of a splitting method.

    A step of negative time is the inverse of a step of positive time, for symmetric and other methods. Hamiltonian
    Monte Carlo needs this, because a transition is a step forward and a reversal of time. The step size is in the unit
    of time of the system; if it is None, a step size adapter of mici sets it before the first step.
    """

    def __init__(self, system: System, step_size: float | None, method: Method) -> None:
        super().__init__(system, step_size)
        self.method = method
        # Classes of mici hand positions alone to the gradient of a user.
        self._momenta = None if type(system).__module__.startswith("mici.") else VelocityCheck()
        self._taken = 0

    def _step(self, state: ChainState, time_step: float) -> None:
        def force(momenta: Any) -> Any:
            fresh = ChainState(pos=state.pos, mom=momenta.copy(), dir=1)
            self.system.h1_flow(fresh, LONG)
            return (fresh.mom - momenta) / LONG

        if self._momenta and self._momenta.due(self._taken) and self._momenta.finds(force, state.mom, self._taken):
            raise SettingError("h1_flow of the system depends on the momenta: a splitting method needs h1(q)")
        self._taken += 1
        flows = {"kick": self.system.h1_flow, "drift": self.system.h2_flow}
        for move in self.method.flows[:: 1 if time_step > 0 else -1]:
            flows[move.flow](state, move.coefficient * time_step)


def integrator(system: System, step: float | None, method: str | Tableau) -> SplittingIntegrator:
    """Return an integrator of mici that takes the steps of a method, in the role of the method.

    A kick is ``system.h1_flow``, p -= c dh1/dq. A drift is ``system.h2_flow``: q += c dh2/dp for a Euclidean metric,
    and the motion in a unit Gaussian for :class:`mici.systems.GaussianEuclideanMetricSystem`, which is exact. Both are
    quadratic in p, so that methods which require a quadratic kinetic energy keep their order. Harmonic orders are
    claims on the first of the two splittings.

    mici keeps the gradient of a position with the state, and clears it when the position changes. The last kick of a
    step and the first kick of the next step share it: a step costs ``method.stages`` gradients in both roles, and a
    trajectory of a method with kicks first costs one more unless mici already has it. An assignment to ``state.pos``
    clears the gradient; an assignment to an element of it does not.

    ``h1_flow`` of a class of your own is called with several momenta before the first step, four times, and twice
    before steps 2, 3, 5, 9, 17, ..., with an error if the kicks differ. Classes of mici cannot depend on momenta.

    Parameters
    ----------
    system : mici.systems.EuclideanMetricSystem or mici.systems.GaussianEuclideanMetricSystem
        Hamiltonian system with explicit flows of h1 and h2, without constraints. The metric is the mass matrix.
    step : float or None
        Length of a step, in the unit of time of the system; None if a step size adapter of mici sets it.
    method : str or Tableau
        Name of a registered integrator, path of a file, or a tableau.

    Raises
    ------
    SettingError
        The step is no positive number, the system has constraints or no explicit flows, or mici has no hook for the
        method.
    UnknownNameError
        There is no such integrator; the message has the nearest names.

    References
    ----------
    ``mici.integrators.TractableFlowIntegrator``, https://matt-graham.github.io/mici/docs/mici.integrators.html

    Examples
    --------
    >>> import mici, numpy, nearharmonic as nh
    >>> gaussian = {"neg_log_dens": lambda q: q @ q / 2, "grad_neg_log_dens": lambda q: q}
    >>> step = nh.adapters.mici.integrator(mici.systems.EuclideanMetricSystem(**gaussian), 0.5, "bcss_s3")
    >>> print(step.step(mici.states.ChainState(pos=numpy.array([1.0]), mom=numpy.array([0.0]), dir=1)).pos)
    [0.87726701]
    """
    splitting = method_for("mici", method)
    allowed = "a system of mici with flows of h1 and h2 and without constraints, such as EuclideanMetricSystem"
    if not (hasattr(system, "h1_flow") and hasattr(system, "h2_flow")) or hasattr(system, "constr"):
        raise bad_setting("system", system, allowed)
    return SplittingIntegrator(system, None if step is None else checked_tau(step, "step"), splitting)
