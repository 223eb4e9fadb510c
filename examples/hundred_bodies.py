"""A hundred gravitating bodies in three dimensions, softened: V = -sum of m_i m_j / sqrt(r^2 + e^2) over all pairs."""

from random import Random

from nearharmonic import Parameter, System
from nearharmonic.math import sqrt, sum

BODIES = 100
RANDOM = Random(1)
MASSES = [f"0.0{RANDOM.randint(50, 150):03}" for _ in range(BODIES)]


def V(q, softening):
    def pair(i, j):
        x, y, z = (q[3 * i + k] - q[3 * j + k] for k in range(3))
        return float(MASSES[i]) * float(MASSES[j]) / sqrt(x * x + y * y + z * z + softening**2)

    return -sum(pair(i, j) for i in range(BODIES) for j in range(i))


SYSTEM = System(
    name="hundred_bodies",
    label="hundred bodies",
    V=V,
    q0=[f"{RANDOM.gauss(0, 0.6):.6f}" for _ in range(3 * BODIES)],
    p0=[f"{float(MASSES[i // 3]) * RANDOM.gauss(0, 0.4):.9f}" for i in range(3 * BODIES)],
    masses=[mass for mass in MASSES for _ in range(3)],
    t_end="2",
    parameters={
        "softening": Parameter(value="0.05", unit="1", meaning="length below which the attraction is softened")
    },
    source="textbook example",
)
