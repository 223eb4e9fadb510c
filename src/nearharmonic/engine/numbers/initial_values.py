"""Initial values and parameters that a caller gives in place of a system's own, as the rows that a kernel takes."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from nearharmonic.engine.numbers.arrays import column_of, rows_of
from nearharmonic.engine.numbers.coefficients import parameter_row, start_row
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import bad_setting, unknown_name
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.remembered import remembered
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.oscillator import frequency_parameters


@remembered
def standard_start(system: System, plain: bool) -> Floats:
    """Return the initial values (4 d,) of ``system`` as :func:`start_array` does; not to be changed."""
    row = start_row(*system.extended_start(Fraction), plain=plain)
    row.flags.writeable = False
    return row


@remembered
def standard_parameters(system: System) -> Floats:
    """Return the parameters (2 P,) of ``system`` as :func:`parameter_array` does; not to be changed."""
    row = parameter_row(system.constants(Fraction))
    row.flags.writeable = False
    return row


def start_array(system: System, q0: object, p0: object, *, plain: bool) -> Floats:
    """Return initial states (R, 4 d) as :func:`nearharmonic.engine.numbers.coefficients.start_row` lays them out.

    Parameters
    ----------
    system : System
        Gives its own initial values for None.
    q0, p0 : sequence of d numbers or strings, (d,) or (R, d) array of float, or None
        Positions and momenta; a single number for one coordinate. R is 1 unless one of them has R rows.
    plain : bool
        True drops the digits below a double.

    Raises
    ------
    SettingError
        Another number of components or rows, or a component that is masked or no finite number.
    """
    d, own = system.dimension, standard_start(system, plain)
    allowed = f"{d} number{'s' if d > 1 else ''}, one per coordinate, or rows of {d}"
    for key, values in (("q0", q0), ("p0", p0)):
        if hasattr(values, "data_vars"):
            raise bad_setting(key, "a Dataset", f"{allowed}; a run is continued by start=")
    named = ((0, "q0", q0), (2, "p0", p0))
    given = [(k, rows_of(key, values, d, allowed)) for k, key, values in named if values is not None]
    members = max([1, *(len(pairs) for _, pairs in given)])
    rows = np.empty((members, 4, own.size // 4))
    rows[:] = own.reshape(4, -1)
    for k, pairs in given:
        if len(pairs) not in (1, members):
            raise bad_setting("p0", f"{len(given[1][1])} rows", f"as many as q0, {len(given[0][1])}, or one for all")
        rows[:, k, :d] = pairs[:, :, 0]
        rows[:, k + 1, :d] = 0.0 if plain else pairs[:, :, 1]
    return rows.reshape(members, -1)


def parameter_array(system: System, parameters: Mapping[str, Any]) -> Floats:
    """Return parameters (R, 2 P) as :func:`nearharmonic.engine.numbers.coefficients.parameter_row` lays them out.

    Parameters
    ----------
    system : System
        Gives those that are not named.
    parameters : mapping
        Values by name: numbers, strings, or (R,) arrays of float. R is 1 if there is no array.

    Raises
    ------
    UnknownNameError
        The system has no such parameter.
    SettingError
        A value that is masked or no finite number, or arrays of different lengths.
    """
    if not isinstance(parameters, Mapping):
        raise bad_setting("parameters", parameters, "a mapping of names to values")
    for name in parameters:
        if name not in system.parameters:
            raise unknown_name(f"parameter of {system.name}", name, system.parameters)
    columns = {name: column_of(f"parameters[{name!r}]", value) for name, value in parameters.items()}
    members = max([1, *map(len, columns.values())])
    rows = np.empty((members, len(system.parameters), 2))
    rows[:] = standard_parameters(system).reshape(-1, 2)
    for k, name in enumerate(system.parameters):
        column = columns.get(name)
        if column is None:
            continue
        if len(column) not in (1, members):
            raise bad_setting("parameters", f"{len(column)} values of {name!r}", f"as many as of the others, {members}")
        rows[:, k] = column
    return rows.reshape(members, -1)


def parameters_at_run_time(
    system: System, numerics: Numerics, parameters: Floats, *, own_frequencies: bool = True
) -> Floats:
    """Return the parameters that a kernel is given: ``parameters``, or none (1, 0) if they are compiled in.

    Raises
    ------
    SettingError
        They differ from the parameters that are compiled in, or for which the coefficients of the runs are computed,
        if these are for the system's ``own_frequencies``.
    """
    if numerics.exact_oscillator and own_frequencies:
        _check_frequencies(system, parameters)
    if system.parameters_at_run_time:
        return parameters
    if (parameters == standard_parameters(system)).all():
        return np.empty((1, 0))
    what = f"a formula of {system.name} decides by its parameters, so that they are compiled in: make a copy of the "
    raise bad_setting("parameters", parameters[0, ::2].tolist(), f"{what}system with dataclasses.replace")


def _check_frequencies(system: System, parameters: Floats) -> None:
    """Raise an error for another value of a frequency: the coefficients of all runs use the system's own."""
    own, names = standard_parameters(system), list(system.parameters)
    remedy = f"it is a frequency of {system.name}, whose oscillators are solved exactly: make a copy of the system with"
    for i in frequency_parameters(system):
        given = parameters[:, 2 * i : 2 * i + 2]
        if (given != own[2 * i : 2 * i + 2]).any():
            raise bad_setting(f"parameters[{names[i]!r}]", float(given[0, 0]), f"{remedy} dataclasses.replace")
