"""Methods as tables of ARKODE's module SPRKStep, for ``sundials4py``, the Python interface of SUNDIALS."""

from __future__ import annotations

from typing import Any

import numpy as np
from sundials4py.arkode import ARKodeSPRKTable_Create

from nearharmonic.exchange.files import arkode_stages as stages
from nearharmonic.exchange.method import method_for, nearest_doubles
from nearharmonic.integrators.tableau import Tableau


def table(method: str | Tableau) -> Any:
    """Return a method as a table for ``SPRKStepSetMethod``.

    ARKODE kicks and then drifts in each stage, and keeps no force from one step to the next. A method with kicks first
    ends with a drift of zero and costs ``stages + 1`` forces a step. A method with drifts first begins with a kick of
    zero, whose force SUNDIALS 7.9 leaves out: it costs ``stages`` forces a step, and one more up to SUNDIALS 7.5.

    In ``SPRKStepCreate(f1, f2, t0, y0, context)`` f1 sets dp/dt = -dV/dq alone and f2 sets dq/dt = dT/dp alone;
    nothing checks it. For a T that is not quadratic, choose a method that does not require a quadratic kinetic energy:
    ``tableau.requires`` is None. V must not depend on time, because ARKODE evaluates the force at the time of the
    kicks, not of the positions. ``ARKodeSetFixedStep`` sets the step.

    Parameters
    ----------
    method : str or Tableau
        Name of a registered integrator, path of a file, or a tableau. It runs in its own role.

    Returns
    -------
    sundials4py.arkode.ARKodeSPRKTableMem
        The table; ARKODE copies it.

    Raises
    ------
    SettingError
        The method has modified potentials or a processor.
    UnknownNameError
        There is no such integrator; the message has the nearest names.

    References
    ----------
    ``ARKodeSPRKTable_Create``, https://sundials.readthedocs.io/en/latest/arkode/ARKodeSPRKTable_link.html

    Examples
    --------
    >>> import nearharmonic as nh
    >>> from sundials4py.arkode import SPRKStepSetMethod
    >>> status = SPRKStepSetMethod(arkode.get(), nh.adapters.sundials.table("babs7o7h"))  # arkode of SPRKStepCreate
    """
    tableau = method_for("SUNDIALS", method).tableau
    ahat, a = (np.array(row, dtype=np.float64) for row in stages(nearest_doubles(tableau)))
    return ARKodeSPRKTable_Create(ahat.size, tableau.order, a, ahat)
