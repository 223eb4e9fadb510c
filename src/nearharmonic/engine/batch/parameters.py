"""Parameters of runs: which are given to a kernel, and which are compiled into it."""

from __future__ import annotations

import numpy as np

from nearharmonic.engine.numbers.initial_values import standard_parameters
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import bad_setting
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.oscillator import frequency_parameters


def parameters_at_run_time(system: System, numerics: Numerics, parameters: Floats) -> Floats:
    """Return the parameters that runs are given: those asked for, or none if they are compiled in.

    Raises
    ------
    SettingError
        They are others than those that are compiled in, or that the coefficients of the runs are made for.
    """
    if numerics.exact_oscillator:
        _check_frequencies(system, parameters)
    return parameters if system.parameters_at_run_time else parameters_compiled_in(system, parameters)


def parameters_compiled_in(system: System, parameters: Floats) -> Floats:
    """Return no parameters (1, 0) at run time, if those asked for are those that are compiled in.

    Raises
    ------
    SettingError
        They are others.
    """
    if (parameters == standard_parameters(system)).all():
        return np.empty((1, 0))
    what = f"a formula of {system.name} decides by its parameters, so that they are compiled in: make a copy of the "
    raise bad_setting("parameters", parameters[0, ::2].tolist(), f"{what}system with dataclasses.replace")


def _check_frequencies(system: System, parameters: Floats) -> None:
    """Refuse another value of a parameter that is a frequency: the coefficients of all runs are of the system's own."""
    own, names = standard_parameters(system), list(system.parameters)
    remedy = f"it is a frequency of {system.name}, whose oscillators are solved exactly: make a copy of the system with"
    for i in frequency_parameters(system):
        given = parameters[:, 2 * i : 2 * i + 2]
        if (given != own[2 * i : 2 * i + 2]).any():
            raise bad_setting(f"parameters[{names[i]!r}]", float(given[0, 0]), f"{remedy} dataclasses.replace")
