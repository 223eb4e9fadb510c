"""The vibration of a molecule in Morse's potential, H = p^2/2 + D (1 - exp(-a q))^2, beside its closed form."""

from nearharmonic import System
from nearharmonic.math import cos, exp, log, sqrt


def V(q, depth, width):
    return depth * (1 - exp(-width * q[0])) ** 2


def exact_position(system, t):
    """From rest, with e = 1 - exp(-a q0): exp(a q) = (1 + e cos(w t)) / (1 - e^2)."""
    from mpmath import mpf

    ((q,), (p,)), (depth, width) = system.start(mpf), system.constants(mpf)
    e = 1 - exp(-width * q)
    frequency = width * sqrt(2 * depth * (1 - e * e))
    return None if p else (log((1 + e * cos(frequency * t)) / (1 - e * e)) / width,)


SYSTEM = System(
    name="morse",
    label="Morse oscillator",
    V=V,
    q0=(0.5,),
    p0=(0,),
    t_end=100,
    parameters={"depth": 1, "width": 1},  # the energy of dissociation, and an inverse length
    exact_position=exact_position,
    source="Morse (1929), Phys. Rev. 34, 57, doi:10.1103/PhysRev.34.57",
)


def main():
    import matplotlib as mpl
    import numpy as np

    import nearharmonic as nh
    from nearharmonic.plotting.style import SETTINGS, log_scale, new_figure, save, style_of

    mpl.rcParams.update(SETTINGS)
    times = [i / 10 for i in range(20, 1001)]
    exact = np.array([float(exact_position(SYSTEM, t)[0]) for t in times])
    figure = new_figure(7, 6)
    above, below = figure.subplots(2, 1, sharex=True, gridspec_kw={"hspace": 0.1})
    above.plot(times, exact, color="#404040")
    for name in ("ruth", "aba864", "babps9o7h"):
        method = nh.integrators[name]
        run = nh.integrate(SYSTEM, method, 0.15 * method.stages, t=times)  # the same number of forces for each
        below.plot(times, abs(run.q[:, 0] - exact), **style_of(name).line(marker="none", label=method.label))
    log_scale(below, "y")
    above.set(ylabel="displacement $q$ in closed form")
    below.set(xlabel="time $t$", ylabel="error of $q$", xlim=(0, 100))
    below.legend(loc="lower center", bbox_to_anchor=(0.5, 0.98), ncols=3)
    print("wrote", save(figure, ["morse.png"])[0].resolve())


if __name__ == "__main__":
    main()
