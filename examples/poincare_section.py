"""Orbits of stars in a flattened galaxy, V = log(c^2 + x^2 + (y/f)^2)/2, where they cross its long axis upwards."""

import numpy as np

from nearharmonic import Parameter, System
from nearharmonic.math import log


def V(q, core, flattening):
    x, y = q
    return log(core**2 + x * x + (y / flattening) ** 2) / 2


SYSTEM = System(
    name="poincare_section",
    label="logarithmic galaxy",
    V=V,
    q0=(0.45, 0),
    p0=(0, 0.5),
    t_end=50,
    parameters={
        "core": Parameter(value=0.14, unit="1", meaning="radius of the core"),
        "flattening": Parameter(value=0.9, unit="1", meaning="axis ratio of the equipotentials"),
    },
    source="Binney & Tremaine (2008), Galactic Dynamics, 2nd ed., Sec. 3.3.1: core and flattening",
)


def main():
    import matplotlib as mpl

    import nearharmonic as nh
    from nearharmonic.plotting.style import SETTINGS, new_figure, save

    mpl.rcParams.update(SETTINGS)
    x0 = np.linspace(-0.69, 0.69, 38)
    y_speed = np.sqrt(-0.674 - np.log(0.14**2 + x0**2))  # so that E = -0.337
    starts = np.stack([x0, 0 * x0, 0 * x0, y_speed], axis=-1)
    many = nh.section(SYSTEM, "babps8o7h", 0.08, surface=1, starts=starts, t_end=1600, threads=2)
    figure = new_figure(6.4, 5.6)
    axes = figure.subplots()
    for q, p, colour in zip(many.q.values, many.p.values, mpl.colormaps["cividis"](abs(x0) / 0.8), strict=True):
        axes.plot(q[:, 0], p[:, 0], ".", markersize=1.6, markeredgewidth=0, color=colour, rasterized=True)
    axes.set(xlabel="$x$", ylabel="$p_x$", title="$E = -0.337$: states at $y = 0$, $p_y > 0$")
    print("wrote", save(figure, ["poincare_section.png"])[0].resolve())


if __name__ == "__main__":
    main()
