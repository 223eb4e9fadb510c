"""Microseconds of a second call of ``sweep`` and ``integrate``, with runs so short that overhead dominates.

Run: ``python benchmarks/calls.py`` (about 10 s). Each line is the least time of many calls, which take turns. The
arrays of the kernel hold ten steps of one run: the time is taken by the checks, the exact coefficients, the look-up of
the kernel and the Dataset.
"""

from __future__ import annotations

from timing import asked, shortest

import nearharmonic as nh

CALLS = {
    "sweep, one step size": lambda: nh.sweep("sho", "babps9o7h", [0.9], t_end=9),
    "sweep, 20 step sizes": lambda: nh.sweep("sho", "babps9o7h", [9 / n for n in range(10, 30)], t_end=9),
    "sweep, extended precision": lambda: nh.sweep("sho", "babps9o7h", [0.9], t_end=9, precision="extended"),
    "integrate": lambda: nh.integrate("sho", "babps9o7h", 0.9, t_end=9),
    "integrate, Sun and Mercury": lambda: nh.integrate("kepler", "aba864", 100, t_end=1000),
}


def main() -> None:
    for name, seconds in shortest(CALLS, asked(__doc__, 3000).repeats).items():
        print(f"{name:28s}{1e6 * seconds:8.0f} microseconds")


if __name__ == "__main__":
    main()
