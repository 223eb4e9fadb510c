"""The Sun and five outer planets for 200 000 days; in au, days and masses of the Sun, which starts at rest."""

from decimal import Decimal
from fractions import Fraction

from nearharmonic import Parameter, System
from nearharmonic.math import array, sqrt, sum

# Mass, position and velocity on September 5, 1994, 0h. The Sun's mass includes the inner planets.
BODIES = {
    "Sun": ("1.00000597682", "0 0 0", "0 0 0"),
    "Jupiter": ("0.000954786104043", "-3.5023653 -3.8169847 -1.5507963", "0.00565429 -0.00412490 -0.00190589"),
    "Saturn": ("0.000285583733151", "9.0755314 -3.0458353 -1.6483708", "0.00168318 0.00483525 0.00192462"),
    "Uranus": ("0.0000437273164546", "8.3101420 -16.2901086 -7.2521278", "0.00354178 0.00137102 0.00055029"),
    "Neptune": ("0.0000517759138449", "11.4707666 -25.7294829 -10.8169456", "0.00288930 0.00114527 0.00039677"),
    "Pluto": ("1/130000000", "-15.5387357 -25.2225594 -3.1902382", "0.00276725 -0.00170702 -0.00136504"),
}
MASSES = [Fraction(mass) for mass, _, _ in BODIES.values()]
TABLE = list(zip(MASSES, BODIES.values(), strict=True))


def V(q, G):
    bodies = array(q, 6, 3)
    pairs = [(i, j) for i in range(6) for j in range(i)]
    return -G * sum(MASSES[i] * MASSES[j] / sqrt(sum((bodies[i] - bodies[j]) ** 2)) for i, j in pairs)


SYSTEM = System(
    name="outer_solar_system",
    label="outer solar system",
    V=V,
    q0=[x for _, place, _ in BODIES.values() for x in place.split()],
    p0=[f"{m.numerator * Decimal(v) / m.denominator}" for m, (_, _, row) in TABLE for v in row.split()],
    masses=[mass for mass in MASSES for _ in range(3)],
    t_end=200000,
    units={"q": "au", "p": "Msun au d-1", "t": "d", "energy": "Msun au2 d-2"},
    parameters={"G": Parameter(value="2.95912208286e-4", unit="au3 Msun-1 d-2", meaning="gravitational constant")},
    source="Hairer, Lubich & Wanner (2006), Geometric Numerical Integration, Sec. I.2.4, Table 2.2",
)


def main():
    import matplotlib as mpl

    import nearharmonic as nh
    from nearharmonic.plotting.style import SETTINGS, new_figure, save

    mpl.rcParams.update(SETTINGS)
    run = nh.integrate(SYSTEM, "aba104", 700, t=range(0, 200001, 50))  # 100 days a force
    axes = new_figure(6.4, 6.8).subplots()
    for i, colour in enumerate(("#806515", "#e86a10", "#00a070", "#4a90e2", "#8e3fb5"), 1):
        x, y = (run.q[:, 3 * i + k] - run.q[:, k] for k in (0, 1))
        axes.plot(x, y, color=colour, linewidth=0.6, label=list(BODIES)[i])
    axes.set(xlabel="$x$ from the Sun (au)", ylabel="$y$ (au)", aspect="equal")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=6, handlelength=1, columnspacing=1.2)
    print("wrote", save(axes.figure, ["outer_solar_system.png"])[0].resolve())


if __name__ == "__main__":
    main()
