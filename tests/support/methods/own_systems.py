"""A system that a user might have written."""

from __future__ import annotations

from nearharmonic.systems import System


def spring(name="spring", **more):
    settings = {
        "name": name,
        "label": name,
        "V": lambda q: q[0] * q[0] / 2,
        "grad_V": lambda q: (q[0],),
        "q0": ("1",),
        "p0": ("0",),
        "t_end": "20",
        "units": {"q": "1", "p": "1", "t": "1", "energy": "1"},
        "source": "Hooke",
    }
    return System(**(settings | more))
