"""Search for the fewest steps that meet an error bound, over a ladder of integer numbers of steps.

The search is independent of kernels: it takes a function from numbers of steps to errors, so that it can be tested on
error curves of known shape.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import ceil, sqrt

#: Ratio of the finest two step sizes that may be run: 1 + 1/FINE.
FINE = 24
#: Every SCOUT-th rung is run for any error bound, so that step-size resonances below the recommended step are seen.
SCOUT = 8
#: All rungs are run from the last step size that misses the bound to the recommended one divided by MARGIN.
MARGIN = 2
#: Relative distance of the recommended step from one that misses the bound: closer steps are not run.
CLOSE = 1 / 200
#: Runs side by side in one call: the lanes of the kernel.
LANES = 8


def ladder(most: int) -> list[int]:
    """Return numbers of steps from 1 to ``most``, the denser the cheaper their runs are.

    The ratio of neighbours n' and n is 1 + (n / ``most``)^(1/2) / ``FINE``, rounded to an integer n' > n: the narrow
    step-size resonances lie at few steps, where every number of steps is a rung.
    """
    rungs, steps = [], 1
    while steps <= most:
        rungs.append(steps)
        steps += max(1, int(steps * sqrt(steps / most) / FINE))
    return rungs


def fewest_steps(errors: Mapping[int, float], bound: float) -> int | None:
    """Return the fewest steps whose error meets ``bound``, as do the errors of all larger numbers of steps.

    Parameters
    ----------
    errors
        Error by number of steps; NaN meets no bound.
    bound
        Largest error allowed.

    Returns
    -------
    int or None
        A key of ``errors``; None if the largest number of steps misses the bound.
    """
    fewest = None
    for steps in sorted(errors, reverse=True):
        if not errors[steps] <= bound:
            break
        fewest = steps
    return fewest


def measured_errors(
    run: Callable[[Sequence[int]], Sequence[float]], rungs: Sequence[int], bound: float, floor: float
) -> dict[int, float]:
    """Run the rungs that decide which is the fewest number of steps that meets ``bound``.

    The scouts come first, every ``SCOUT``-th rung from coarse to fine, and the finest. They end where all errors of one
    call are down to the rounding floor: finer steps would show rounding only. Then all rungs around
    :func:`fewest_steps` and its finer neighbours are run, and numbers of steps between it and the last that misses the
    bound, until none is left out.

    Parameters
    ----------
    run
        Errors of runs with these numbers of steps, in the same order.
    rungs
        Numbers of steps that may be run, increasing.
    bound
        Largest error allowed.
    floor
        Error at which rounding takes over.

    Returns
    -------
    dict
        Error by number of steps, of all runs made.
    """
    errors: dict[int, float] = {}
    scouts = sorted({*rungs[::SCOUT], rungs[-1]})
    for i in range(0, len(scouts), LANES):
        call = dict(zip(scouts[i : i + LANES], run(scouts[i : i + LANES]), strict=True))
        errors |= call
        if max(call.values()) <= min(floor, bound):
            break
    while due := _neighbours(errors, rungs, bound) or _between(errors, rungs, bound):
        errors |= dict(zip(due, run(due), strict=True))
    return errors


def _neighbours(errors: Mapping[int, float], rungs: Sequence[int], bound: float) -> list[int]:
    """Return the numbers of steps around the fewest that were not run yet.

    They are the rungs from the last number of steps that misses ``bound`` to ``MARGIN`` times the fewest, and the next
    numbers of steps, at least ``LANES`` and more where runs are cheap.
    """
    fewest = fewest_steps(errors, bound)
    if fewest is None:
        return []
    missed = _missed(errors, fewest, rungs)
    wanted = {steps for steps in rungs if missed < steps <= MARGIN * fewest}
    following = min(LANES // 2 * max(2, rungs[-1] // fewest), MARGIN * fewest, rungs[-1] - fewest)
    wanted.update(range(fewest + 1, fewest + following + 1))
    return sorted(wanted - errors.keys())


def _between(errors: Mapping[int, float], rungs: Sequence[int], bound: float) -> list[int]:
    """Return up to ``LANES`` numbers of steps between the last that misses ``bound`` and the fewest that meet it.

    There are none if the two differ by less than ``CLOSE``.
    """
    fewest = fewest_steps(errors, bound)
    if fewest is None:
        return []
    gap = fewest - _missed(errors, fewest, rungs)
    if gap <= CLOSE * fewest:
        return []
    stride = ceil(gap / (LANES + 1))
    return list(range(fewest - gap + stride, fewest, stride))


def _missed(errors: Mapping[int, float], fewest: int, rungs: Sequence[int]) -> int:
    return max((steps for steps in errors if steps < fewest), default=rungs[0] - 1)
