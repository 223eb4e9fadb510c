"""Interrupt handling and progress bars for long kernel calls."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.layout import PROGRESS, STOP

#: Product of steps, stages and the cost of a force below which a call takes less than about 20 ms and is not watched.
SHORT = 5_000_000
#: Seconds between looks at the keyboard, and seconds after which a progress bar is shown.
PATIENCE, LONG = 0.05, 2.0
#: Largest product of steps and cost between two looks of a kernel at its control array.
STRETCH = 2_000_000


def control() -> NDArray[np.int64]:
    """Return a new control array: the flag that stops a call, and the number of steps done."""
    return np.zeros(2, np.int64)


def stretch(cost: int) -> int:
    """Return the number of steps of this cost between two looks of a kernel at its control array."""
    return max(1, STRETCH // cost)


def execute(call: Callable[[], Any], state: NDArray[np.int64], steps: int, cost: int) -> None:
    """Make the call; Ctrl-C stops it within a stretch, and a call of more than two seconds shows its progress.

    A call inside of :class:`Blocks` is stopped and shown together with the blocks.

    Parameters
    ----------
    call : callable
        Call of a kernel.
    state : (2,) array of int
        Its control array.
    steps : int
        Steps of all its runs together.
    cost : int
        Of a step: stages times the cost of a force.

    Raises
    ------
    KeyboardInterrupt
        When the kernel has stopped. Its results must not be used.
    """
    if (blocks := getattr(_OWN, "blocks", None)) is not None:
        blocks.call(call, state)
        return
    if steps * cost < SHORT or not _in_main_thread():
        call()
        return
    ended = threading.Event()  # a thread that Ctrl-C interrupts the joining of counts as ended while it still runs

    def work() -> None:
        try:
            call()
        finally:
            ended.set()

    with _Progress(steps) as progress:
        try:
            threading.Thread(target=work, daemon=True).start()
            while not ended.wait(PATIENCE):
                progress.show(int(state[PROGRESS]))
        except BaseException:
            state[STOP] = 1
            ended.wait()
            raise


#: Blocks that the current thread works for.
_OWN = threading.local()


class Blocks:
    """Blocks of runs that threads take from a queue.

    Parameters
    ----------
    compute : callable
        Computes one block, given its index; it calls kernels by :func:`execute`.
    count : int
        Number of blocks.
    steps, cost : int
        Steps of all runs of all blocks together; cost of a step.
    """

    def __init__(self, compute: Callable[[int], None], count: int, *, steps: int, cost: int) -> None:
        self._compute, self._count, self._steps, self._cost = compute, count, steps, cost
        self._stopped, self._done, self._controls = False, 0, dict[int, NDArray[np.int64]]()

    def execute(self, threads: int) -> None:
        """Compute all blocks; Ctrl-C stops them all.

        Raises
        ------
        KeyboardInterrupt
            When every thread has stopped.
        """
        if self._steps * self._cost < SHORT or (threads == 1 and not _in_main_thread()):
            for i in range(self._count):
                self._compute(i)
            return
        from concurrent.futures import ThreadPoolExecutor, wait

        with ThreadPoolExecutor(threads) as pool, _Progress(self._steps) as progress:
            futures = [pool.submit(self._one, i) for i in range(self._count)]
            try:
                for future in futures:
                    while not future.done():
                        wait([future], PATIENCE)
                        progress.show(self._done + sum(int(state[PROGRESS]) for state in self._controls.values()))
                    future.result()
            except BaseException:
                self._stopped = True
                for state in list(self._controls.values()):
                    state[STOP] = 1
                pool.shutdown(cancel_futures=True)
                raise

    def call(self, call: Callable[[], Any], state: NDArray[np.int64]) -> None:
        """Make a call of one of the blocks, unless they have been stopped."""
        key = threading.get_ident()
        self._controls[key] = state
        # In this order: a stop is seen here, or by the kernel.
        if not self._stopped:
            call()
        self._done += int(state[PROGRESS])
        del self._controls[key]

    def _one(self, i: int) -> None:
        if not self._stopped:
            _OWN.blocks = self
            self._compute(i)


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


class _Progress:
    """A progress bar on the terminal, if there is one, from the third second on."""

    def __init__(self, steps: int) -> None:
        self._steps, self._begin = steps, time.monotonic()
        self._bar: Any = None

    def __enter__(self) -> _Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def show(self, done: int) -> None:
        if self._bar is None:
            if time.monotonic() - self._begin < LONG or not sys.stderr.isatty():
                return
            from tqdm import tqdm

            self._bar = tqdm(total=self._steps, unit=" steps", unit_scale=True, leave=False)
        self._bar.update(done - self._bar.n)
