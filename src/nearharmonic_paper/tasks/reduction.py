"""Declared reductions: functions of a dataset, each with the variables that it needs.

The object ``reduction = Reductions()`` of an experiment is the decorator of its reductions. The results of decorated
functions are stored in the cube without further code.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.numerics.portable import totals

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.output.store import Variable

    Reduction = Callable[[xr.Dataset], xr.DataArray | xr.Dataset | Variable]


class Reductions:
    """The reductions of one experiment, in the order of their declaration."""

    def __init__(self) -> None:
        self._declared: list[tuple[Reduction, tuple[str, ...], str]] = []

    def __call__(self, *needs: str, over: str = "sample") -> Callable[[Reduction], Reduction]:
        """Declare the decorated function a reduction."""

        def declare(function: Reduction) -> Reduction:
            self._declared.append((function, needs, over))
            return function

        return declare

    def of(self, dataset: xr.Dataset, over: str = "sample") -> xr.Dataset:
        """Return the results of all reductions over a dimension whose variables are in ``dataset``.

        A DataArray, or a described variable, gets the name of its function.
        """
        import xarray as xr

        found: dict[Any, Any] = {}
        for function, needs, along in self._declared:
            if along == over and all(name in dataset for name in needs):
                result = function(dataset)
                found |= dict(result.data_vars) if isinstance(result, xr.Dataset) else {function.__name__: result}
        return xr.Dataset(found)


def exact_sum(values: xr.DataArray, dimension: str) -> xr.DataArray:
    """Return the exact sum along a dimension, rounded once: it is independent of the order of the terms and of padding.

    NaN is skipped; the sum without other terms is NaN.
    """
    import xarray as xr

    summed: xr.DataArray = xr.apply_ufunc(_exact_sum, values, input_core_dims=[[dimension]])
    return summed


def _exact_sum(rows: Any) -> Any:
    known = ~np.isnan(rows)
    return np.where(known.any(axis=-1), totals(np.where(known, rows, 0.0)), np.nan)
