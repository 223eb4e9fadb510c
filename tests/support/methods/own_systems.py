"""Systems that users might have written: a spring, one that is driven, and chains of any number of sites."""

from itertools import pairwise

import numpy as np

from nearharmonic import math
from nearharmonic.systems import System


def spring(name="spring", **more):
    settings = {
        "name": name, "label": name, "V": lambda q: q[0] * q[0] / 2, "grad_V": lambda q: (q[0],), "q0": ("1",),
        "p0": ("0",), "t_end": "20", "units": {"q": "1", "p": "1", "t": "1", "energy": "1"}, "source": "Hooke",
    }  # fmt: skip
    return System(**(settings | more))


DRIVE = {"F": "0.5", "w": "0.7"}


def _driven(q, t, F, w):
    return q[0] ** 2 / 2 - F * q[0] * math.cos(w * t)


def driven(**more):
    fields = {"V": _driven, "grad_V": None, "time_dependent": True, "parameters": DRIVE, "name": "driven"}
    return spring(**(fields | more))


def bonds(q, beta):
    """The potential of a chain with fixed ends; energies of more than eight sites have a formula of their own."""
    q = (0, *q, 0)
    return sum((b - a) ** 2 / 2 + beta * (b - a) ** 4 / 4 for a, b in pairwise(q))


def mode(count, k=1):
    return np.sin(np.pi * k * np.arange(1, count + 1) / (count + 1))


def sites(count):
    """A chain whose first mode is displaced; of many sites, its formulas are compiled as loops."""
    start = {"q0": mode(count).round(6), "p0": [0] * count, "t_end": 10}
    return System(name=f"{count}_sites", V=bonds, parameters={"beta": "0.1"}, **start)
