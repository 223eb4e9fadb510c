"""How a long call of a kernel can be stopped from the keyboard and is watched on a terminal."""

from __future__ import annotations

import sys
import threading
import time
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.layout import PROGRESS, STOP

if TYPE_CHECKING:
    from nearharmonic.core.native import PreparedCall

#: Products of steps, stages and coordinates: below this a call takes less than about 20 ms, and is simply made.
SHORT = 2_000_000
#: Seconds between looks at the keyboard, and after which a call is worth a progress bar.
PATIENCE, LONG = 0.05, 2.0
#: Most products of steps, stages and squared coordinates between two looks of a kernel at what it is told.
STRETCH = 4_000_000


def control() -> NDArray[np.int64]:
    """Return a fresh array by which a call is told to stop and tells how many steps it has done."""
    return np.zeros(2, np.int64)


def stretch(stages: int, dimension: int) -> int:
    """Return the steps between two looks of a kernel at its control array: some milliseconds."""
    return max(64, STRETCH // (stages * dimension * (dimension + 4)))


def execute(call: PreparedCall, state: NDArray[np.int64], steps: int, cost: int) -> None:
    """Make the call; Ctrl-C stops it within a stretch, and one of more than two seconds shows its progress.

    Parameters
    ----------
    call : PreparedCall
        Call of a kernel.
    state : (2,) array of int
        Its control array.
    steps : int
        Steps of all its runs together.
    cost : int
        Stages times coordinates.

    Raises
    ------
    KeyboardInterrupt
        When the kernel has stopped. What it computed until then is not to be used.
    """
    if steps * cost < SHORT or threading.current_thread() is not threading.main_thread():
        call()
        return
    worker = threading.Thread(target=call, daemon=True)
    with _Progress(steps) as progress:
        worker.start()
        try:
            while worker.is_alive():
                worker.join(PATIENCE)
                progress.show(int(state[PROGRESS]))
        except BaseException:
            state[STOP] = 1
            worker.join()
            raise


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
