"""A star cluster: 32 equal masses drawn from Plummer's sphere; G, M and the virial radius are 1."""

from math import hypot, pi
from random import Random

from nearharmonic import Parameter, System
from nearharmonic.math import sqrt, sum

STARS = 32
UNIT = 3 * pi / 16  # the length scale of the sphere
RANDOM = Random(1)


def star():
    """Position and velocity of a star; its share x of the speed of escape has the density x^2 (1 - x^2)^(7/2)."""
    r = (RANDOM.uniform(0.02, 0.98) ** (-2 / 3) - 1) ** -0.5
    speed = RANDOM.betavariate(1.5, 4.5) ** 0.5 * (2 / UNIT) ** 0.5 / (1 + r * r) ** 0.25
    ways = [[RANDOM.gauss(0, 1) for _ in range(3)] for _ in range(2)]
    return [[length * x / hypot(*way) for x in way] for length, way in zip((r * UNIT, speed), ways, strict=True)]


def V(q, softening):
    def pair(i, j):
        x, y, z = (q[3 * i + k] - q[3 * j + k] for k in range(3))
        return 1 / sqrt(x * x + y * y + z * z + softening**2)

    return -sum(pair(i, j) for i in range(STARS) for j in range(i)) / STARS**2


CLUSTER = [star() for _ in range(STARS)]
SYSTEM = System(
    name="plummer_sphere",
    label="Plummer sphere",
    V=V,
    q0=[f"{x:.9f}" for place, _ in CLUSTER for x in place],
    p0=[f"{v / STARS:.9f}" for _, velocity in CLUSTER for v in velocity],
    masses=[f"1/{STARS}"] * (3 * STARS),
    t_end="10",
    parameters={"softening": Parameter(value="0.05", unit="1", meaning="softening length of the attraction")},
    source="Aarseth, Henon & Wielen (1974), Astron. Astrophys. 37, 183, Appendix",
)


def main():
    import matplotlib as mpl
    import numpy as np

    import nearharmonic as nh
    from nearharmonic.output.style import SETTINGS, new_figure, save

    mpl.rcParams.update(SETTINGS)
    run = nh.integrate(SYSTEM, "srkn_a14", 0.05, t_end=20, samples=401)
    places = run.q.values.reshape(-1, STARS, 3)
    distances = np.sort(np.linalg.norm(places - places.mean(axis=1, keepdims=True), axis=-1), axis=-1)
    axes = new_figure(7, 4.4).subplots()
    for quarter, dashes in enumerate((":", "-", "--"), 1):
        axes.plot(run.t, distances[:, quarter * STARS // 4 - 1], dashes, color="#0b3c8c", label=f"{25 * quarter} %")
    axes.set(xlabel="time $t$", ylabel="radius that holds a share of the stars", xlim=(0, 20), ylim=(0, None))
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=3)
    print("wrote", save(axes.figure, ["plummer_sphere.png"])[0].resolve())


if __name__ == "__main__":
    main()
