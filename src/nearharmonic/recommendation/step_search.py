"""Searches for the fewest steps that meet an error bound.

They are independent of kernels: they take a function from numbers of steps to errors, so that they can be tested on
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
#: Inverse of the relative distance from the fewest steps at which doubling and halving end.
HALVED = 20


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


def fewest_steps(meets: Callable[[int], bool], least: int, most: int) -> int | None:
    """Return the fewest steps from ``least`` to ``most`` that meet a bound, by doubling and halving, or None.

    The result is within 1/:data:`HALVED` of the fewest where all larger numbers of steps meet the bound too.
    """
    missed, steps = least - 1, least
    while steps > most or not meets(steps):
        if steps >= most:
            return None
        missed, steps = steps, min(2 * steps, most)
    while steps - missed > max(1, steps // HALVED):
        middle = (missed + steps) // 2
        missed, steps = (missed, middle) if meets(middle) else (middle, steps)
    return steps


def fewest_for_good(errors: Mapping[int, float], bound: float) -> int | None:
    """Return the fewest steps in ``errors`` whose error meets ``bound``, as do those of all larger numbers of steps.

    NaN meets no bound; None if the largest number of steps misses it.
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
    call are down to ``floor``, that of rounding: finer steps would show rounding only. Then all rungs around
    :func:`fewest_for_good` and its finer neighbours are run, and numbers of steps between it and the last that misses
    the bound, until none is left out. ``run`` takes numbers of steps and returns the errors of their runs; ``rungs``
    are increasing. The result is the error by number of steps, of all runs made.
    """
    errors: dict[int, float] = {}
    scouts = sorted({*rungs[::SCOUT], rungs[-1]})
    for i in range(0, len(scouts), LANES):
        call = dict(zip(scouts[i : i + LANES], run(scouts[i : i + LANES]), strict=True))
        errors |= call
        if max(call.values()) <= min(floor, bound):
            break
    while due := _due(errors, rungs, bound):
        errors |= dict(zip(due, run(due), strict=True))
    return errors


def _due(errors: Mapping[int, float], rungs: Sequence[int], bound: float) -> list[int]:
    """Return the numbers of steps to be run next, none at the end.

    They are the rungs from the last number of steps that misses ``bound`` to ``MARGIN`` times the fewest that meets it,
    and the next numbers of steps, at least ``LANES`` and more where runs are cheap; and after these up to ``LANES``
    numbers between the two, until they differ by less than ``CLOSE``.
    """
    fewest = fewest_for_good(errors, bound)
    if fewest is None:
        return []
    missed = max((steps for steps in errors if steps < fewest), default=rungs[0] - 1)
    wanted = {steps for steps in rungs if missed < steps <= MARGIN * fewest}
    following = min(LANES // 2 * max(2, rungs[-1] // fewest), MARGIN * fewest, rungs[-1] - fewest)
    wanted.update(range(fewest + 1, fewest + following + 1))
    gap, due = fewest - missed, sorted(wanted - errors.keys())
    if due or gap <= CLOSE * fewest:
        return due
    stride = ceil(gap / (LANES + 1))
    return list(range(missed + stride, fewest, stride))
