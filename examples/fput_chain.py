"""The Fermi-Pasta-Ulam-Tsingou chain of 1024 sites between fixed ends: V = sum of d^2/2 + beta d^4/4 over all d."""

from math import pi, sin

from nearharmonic import Parameter, System
from nearharmonic.math import array, sum

SITES = 1024


def V(q, beta):
    q = array((0, *q, 0))
    d = q[1:] - q[:-1]
    return sum(d**2 / 2 + beta * d**4 / 4)


SYSTEM = System(
    name="fput_chain",
    label="FPUT chain",
    V=V,
    q0=[f"{sin(pi * i / (SITES + 1)):.9f}" for i in range(1, SITES + 1)],
    p0=[0] * SITES,
    t_end=1000,
    parameters={"beta": Parameter(value=0.1, unit="1", meaning="strength of the quartic term")},
    source="Fermi, Pasta, Ulam & Tsingou (1955), Los Alamos report LA-1940",
)


def main():
    import matplotlib as mpl
    import numpy as np

    import nearharmonic as nh
    from nearharmonic.plotting.style import SETTINGS, new_figure, save

    mpl.rcParams.update(SETTINGS)
    place = np.arange(1, SITES + 1) - 150
    bump = 24 * np.exp(-((place / 14) ** 2) / 2)  # of the displacement, on its way to the right at speed 1
    start = {"q0": bump, "p0": bump * place / 14**2}
    run = nh.integrate(SYSTEM, "babps8o7h", 2, t_end=500, samples=251, energy="none", **start)
    strain = np.diff(run.q.values, prepend=0, append=0, axis=-1)
    figure = new_figure(7, 4.6)
    axes = figure.subplots()
    axes.grid(visible=False)
    image = axes.imshow(strain, aspect="auto", origin="lower", extent=(0, SITES + 1, 0, 500), cmap="cividis")
    figure.colorbar(image, label="strain $d$")
    axes.set(xlabel="spring", ylabel="time $t$")
    print("wrote", save(figure, ["fput_chain.png"])[0].resolve())


if __name__ == "__main__":
    main()
