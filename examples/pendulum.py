"""A pendulum of mass 1 on a rod of length l: H = p^2 / (2 l^2) + g l (1 - cos q), q the angle from the vertical."""

from nearharmonic import Parameter, System
from nearharmonic.math import cos


def V(q, g, length):
    return g * length * (1 - cos(q[0]))


def T(p, g, length):
    return p[0] ** 2 / (2 * length**2)


SYSTEM = System(
    name="pendulum",
    label="pendulum",
    V=V,
    T=T,
    q0=(0.5,),
    p0=(0,),
    t_end=60,
    units={"q": "rad", "p": "kg m2 s-1", "t": "s", "energy": "J"},
    parameters={
        "g": Parameter(value=9.80665, unit="m s-2", meaning="acceleration of free fall"),
        "length": Parameter(value=1, unit="m", meaning="length of the rod"),
    },
    source="textbook example",
)


def main():
    import matplotlib as mpl
    import numpy as np

    import nearharmonic as nh
    from nearharmonic.plotting.style import SETTINGS, log_scale, new_figure, save, style_of

    mpl.rcParams.update(SETTINGS)
    amplitudes = np.linspace(0.05, 3.1, 62)
    figure = new_figure(7, 4.6)
    axes = figure.subplots()
    for name in ("ruth", "aba864", "babs7o7h", "babps9o7h"):
        method = nh.integrators[name]
        many = nh.ensemble(SYSTEM, method, 0.05 * method.stages, q0=amplitudes[:, None])  # equal numbers of forces
        axes.plot(amplitudes, many.max_energy_error, **style_of(name).line(markevery=6, label=method.label))
    log_scale(axes, "y")
    axes.set(xlabel="amplitude (rad)", ylabel=r"$\max\,|\Delta H/H_0|$ over 60 s", xlim=(0, 3.14159))
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=4)
    print("wrote", save(figure, ["pendulum.png"])[0].resolve())


if __name__ == "__main__":
    main()
