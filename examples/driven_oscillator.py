"""A driven Duffing oscillator, H = p^2/2 + q^2/2 + b q^4/4 - F q cos(w t), once a period of its drive."""

import numpy as np

from nearharmonic import Parameter, System
from nearharmonic.math import cos


def V(q, t, b, force, frequency):
    return q[0] ** 2 / 2 + b * q[0] ** 4 / 4 - force * q[0] * cos(frequency * t)


SYSTEM = System(
    name="driven_oscillator",
    label="driven oscillator",
    V=V,
    q0=(1,),
    p0=(0,),
    t_end=100,
    time_dependent=True,
    parameters={
        "b": Parameter(value=0.2, unit="1", meaning="strength of the quartic term"),
        "force": Parameter(value=0.2, unit="1", meaning="amplitude of the drive"),
        "frequency": Parameter(value=1.5, unit="1", meaning="angular frequency of the drive"),
    },
    source="Guckenheimer & Holmes (1983), Sec. 2.2: Duffing without damping, doi:10.1007/978-1-4612-1140-2",
)


def main():
    import matplotlib as mpl

    import nearharmonic as nh
    from nearharmonic.plotting.style import SETTINGS, new_figure, save

    mpl.rcParams.update(SETTINGS)
    periods, period = 400, 2 * np.pi / 1.5
    many = nh.ensemble(
        SYSTEM, "babps8o7h", period / 4, t_end=periods * period, samples=periods + 1, threads=2, energy="none",
        q0=np.linspace(-3.6, 3.6, 41)[:, None], p0=[0],
    )  # fmt: skip
    figure = new_figure(6, 6)
    axes = figure.subplots()
    colours = np.repeat(many.q[:, 0, 0], periods + 1)
    axes.scatter(many.q, many.p, s=1.5, linewidths=0, c=colours, cmap="cividis", rasterized=True)
    axes.set(xlabel="$q$", ylabel="$p$", title=r"41 starts at rest, at $t = 0, 2\pi/\omega, 4\pi/\omega, \ldots$")
    print("wrote", save(figure, ["driven_oscillator.png"])[0].resolve())


if __name__ == "__main__":
    main()
