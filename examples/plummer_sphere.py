"""A star cluster: 32 equal masses drawn from Plummer's sphere; G, M and the virial radius are 1."""

from math import hypot, pi
from random import Random

from nearharmonic import System
from nearharmonic.math import array, sqrt, sum

STARS, RANDOM, UNIT = 32, Random(1), 3 * pi / 16  # UNIT is the length scale of the sphere


def star():
    """Position and velocity of a star; its share x of the speed of escape has the density x^2 (1 - x^2)^(7/2)."""
    r = (RANDOM.uniform(0.02, 0.98) ** (-2 / 3) - 1) ** -0.5
    speed = RANDOM.betavariate(1.5, 4.5) ** 0.5 * (2 / UNIT) ** 0.5 / (1 + r * r) ** 0.25
    ways = ([RANDOM.gauss(0, 1) for _ in range(3)] for _ in range(2))
    return [[length * x / hypot(*way) for x in way] for length, way in zip((r * UNIT, speed), ways, strict=True)]


def V(q, softening):
    places = array(q, STARS, 3)
    pairs = [places[i] - places[j] for i in range(STARS) for j in range(i)]
    return -sum(1 / sqrt(sum(d * d) + softening**2) for d in pairs) / STARS**2


CLUSTER = [star() for _ in range(STARS)]
SYSTEM = System(
    name="plummer_sphere",
    label="Plummer sphere",
    V=V,
    q0=[f"{x:.9f}" for place, _ in CLUSTER for x in place],
    p0=[f"{v / STARS:.9f}" for _, velocity in CLUSTER for v in velocity],
    masses=[f"1/{STARS}"] * (3 * STARS),
    t_end=10,
    parameters={"softening": "0.05"},
    source="Aarseth, Henon & Wielen (1974), Astron. Astrophys. 37, 183, Appendix",
)


def main():
    import matplotlib as mpl
    import numpy as np

    import nearharmonic as nh
    from nearharmonic.plotting.style import SETTINGS, new_figure, save

    mpl.rcParams.update(SETTINGS)
    run = nh.integrate(SYSTEM, "srkn_a14", 0.05, t_end=20, samples=401)
    places = run.q.values.reshape(-1, STARS, 3) - run.q.values.reshape(-1, STARS, 3).mean(axis=1, keepdims=True)
    distances = np.sort(np.linalg.norm(places, axis=-1), axis=-1)
    axes = new_figure(7, 4.4).subplots()
    for quarter, dashes in enumerate((":", "-", "--"), 1):
        axes.plot(run.t, distances[:, quarter * STARS // 4 - 1], dashes, color="#0b3c8c", label=f"{25 * quarter} %")
    axes.set(xlabel="time $t$", ylabel="radius that holds a share of the stars", xlim=(0, 20), ylim=(0, None))
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=3)
    print("wrote", save(axes.figure, ["plummer_sphere.png"])[0].resolve())


if __name__ == "__main__":
    main()
