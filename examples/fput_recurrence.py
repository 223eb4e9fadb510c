"""Recurrence in the Fermi-Pasta-Ulam-Tsingou chain: V = sum of d^2/2 + alpha d^3/3, started in its lowest mode."""

from math import pi, sin

import numpy as np

from nearharmonic import System
from nearharmonic.math import sum

SITES = 31  # between two fixed ends: N = 32 in the report
MODES = np.arange(1, SITES + 1)


def V(q, alpha):
    differences = [b - a for a, b in zip((0, *q), (*q, 0), strict=True)]
    return sum(d**2 / 2 + alpha * d**3 / 3 for d in differences)


def mode_energies(q, p):
    """Energies (..., SITES) of the normal modes at states q, p (..., SITES), without the cubic terms."""
    shapes = np.sin(np.pi * np.outer(MODES, MODES) / (SITES + 1)) * np.sqrt(2 / (SITES + 1))
    return (p @ shapes) ** 2 / 2 + 2 * (np.sin(np.pi * MODES / 2 / (SITES + 1)) * (q @ shapes)) ** 2


SYSTEM = System(
    name="fput_recurrence",
    label="FPUT chain, 32 springs",
    V=V,
    q0=[f"{sin(pi * i / (SITES + 1)):.15f}" for i in range(1, SITES + 1)],
    p0=[0] * SITES,
    t_end=11000,
    parameters={"alpha": "0.25"},
    source="Fermi, Pasta, Ulam & Tsingou (1955), Los Alamos report LA-1940, Fig. 1",
)


def main():
    import matplotlib as mpl

    import nearharmonic as nh
    from nearharmonic.plotting.style import SETTINGS, new_figure, save

    mpl.rcParams.update(SETTINGS)
    period = pi / sin(pi / 2 / (SITES + 1))  # of the lowest mode
    panels = new_figure(7, 6).subplots(2, 1, sharex=True, gridspec_kw={"hspace": 0.18})
    looks = (("-", "#000000"), ("--", "#e86a10"), ("-", "#4a90e2"), (":", "#8b0000"))
    for axes, name, tau in zip(panels, ("babps9o7h", "leapfrog"), (2, 8**-0.5), strict=True):
        run = nh.integrate(SYSTEM, name, tau, samples=2000)
        for mode, (dashes, colour) in enumerate(looks):
            energy = mode_energies(run.q.values, run.p.values)[:, mode]
            axes.plot(run.t / period, 1000 * energy, dashes, color=colour, label=f"mode {mode + 1}")
        axes.set(ylabel="energy ($10^{-3}$)", xlim=(0, 170), ylim=(0, 82))
        axes.set_title(f"{nh.integrators[name].label}, $\\tau$ = {tau:.4g}", loc="left")
    panels[1].set_xlabel("time in periods of the lowest mode")
    panels[0].legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=4)
    print("wrote", save(panels[0].figure, ["fput_recurrence.png"])[0].resolve())


if __name__ == "__main__":
    main()
