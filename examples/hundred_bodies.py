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
    t_end=2,
    parameters={"softening": Parameter(value=0.05, unit="1", meaning="length below which the attraction is softened")},
    source="textbook example",
)


def main():
    import matplotlib as mpl

    import nearharmonic as nh
    from nearharmonic.plotting.style import SETTINGS, new_figure, save

    mpl.rcParams.update(SETTINGS)
    run = nh.integrate(SYSTEM, "aba864", 0.02, samples=101)
    places = run.q.values.reshape(-1, BODIES, 3)
    figure = new_figure(6, 6.2)
    axes = figure.subplots()
    for i in range(BODIES):
        axes.plot(*places[:, i, :2].T, color="#4a90e2", linewidth=0.7)
    axes.scatter(*places[-1, :, :2].T, s=[2000 * float(mass) for mass in MASSES], color="#0b3c8c", zorder=3)
    axes.set(xlabel="$x$", ylabel="$y$", aspect="equal")
    axes.set_title("paths over $t = 0$ to 2; areas of the dots are masses")
    print("wrote", save(figure, ["hundred_bodies.png"])[0].resolve())


if __name__ == "__main__":
    main()
