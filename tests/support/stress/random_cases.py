"""Random runs: a system, a method and every setting of a run, drawn from a seed."""

from __future__ import annotations

import random
from dataclasses import dataclass
from fractions import Fraction

import nearharmonic as nh

#: Smallest and largest step size over the stages, and spread of initial values about the system's.
STEP_SIZES = {
    "sho": (0.02, 0.6),
    "henon_heiles": (0.02, 0.6),
    "kepler": (1.0, 60.0),
    "relativistic_oscillator": (0.02, 0.6),
}
WIDTHS = (1, 3, 8, 16, 32)


@dataclass(frozen=True)
class Case:
    """A run, and how it is computed once more: beside which step sizes, in which parts, lanes and threads."""

    system: str
    integrator: str
    tau: float
    t_end: str
    precision: str
    summation: str
    first: str | None
    samples: int
    q0: tuple[str, ...]
    p0: tuple[str, ...]
    taus: tuple[float, ...]
    shards: int
    threads: int
    width: int

    @property
    def settings(self):
        """Keyword arguments of the package's functions."""
        names = ("t_end", "precision", "summation", "first")
        return {name: getattr(self, name) for name in names}

    @property
    def method(self):
        """The method with its rows in the roles asked for, ``first`` the operator of the longer row."""
        return nh.integrators[self.integrator].role(self.first)

    @property
    def steps(self):
        """max(1, round(|t_end| / tau)) with an exact quotient."""
        return max(1, round(abs(Fraction(self.t_end)) / Fraction(self.tau)))


def random_case(seed: int, *, most_steps: int, most_stages: int = 99, widths=WIDTHS, systems=tuple(STEP_SIZES)) -> Case:
    """Draw a run of at most ``most_steps`` steps of a method of at most ``most_stages``."""
    draw = random.Random(seed)
    system = draw.choice(systems)
    known = nh.systems[system]
    quadratic = system != "relativistic_oscillator"
    methods = [
        name
        for name, one in nh.integrators.items()
        if one.stages <= most_stages and not one.processed and (quadratic or one.requires is None)
    ]
    method = nh.integrators[draw.choice(methods)]
    low, high = STEP_SIZES[system]
    tau = method.stages * low * (high / low) ** draw.random()
    count = draw.randint(1, most_steps) + draw.choice((0, 0.001, 0.3, 0.499, 0.501))
    first = None if method.modified or not quadratic else draw.choice((None, "drift", "kick"))
    own = draw.random() < 0.5

    def start(values):
        spread = max(abs(float(x)) for x in (*values, 0.1)) / 4
        return tuple(f"{float(x) + draw.uniform(-spread, spread):.12g}" for x in values) if own else tuple(values)

    return Case(
        system=system, integrator=method.name, tau=tau, first=first,
        t_end=f"{draw.choice((1, 1, -1)) * tau * max(count, 0.7):.{draw.randint(3, 15)}g}",
        precision=draw.choice(("double", "double", "extended")), summation=draw.choice(("compensated", "plain")),
        samples=draw.choice((1, 2, 3, 7, 1000)), q0=start(known.q0), p0=start(known.p0),
        taus=tuple(tau * draw.uniform(0.3, 3) for _ in range(draw.randint(0, 12))),
        shards=draw.randint(1, 5), threads=draw.randint(1, 4), width=draw.choice(widths),
    )  # fmt: skip
