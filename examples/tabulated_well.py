"""A double well that is known at 17 points: between them a natural cubic spline, with V'' = 0 at both ends."""

import numba
import numpy as np

from nearharmonic import System

TABLE = np.round([q**4 / 4 - q**2 / 2 for q in np.linspace(-2, 2, 17)], 3)  # as if it had been measured
FIRST, H, LAST = -2.0, 0.25, TABLE.size - 2
BENT = np.pad(np.linalg.solve(4 * np.eye(15) + np.eye(15, k=1) + np.eye(15, k=-1), np.diff(TABLE, 2)), 1)


@numba.njit
def piece(x):
    place = (x - FIRST) / H
    i = min(max(int(place), 0), LAST)  # beyond the table, the last piece goes on
    return i, 1 - (place - i), place - i


@numba.njit
def V(q):
    i, a, b = piece(q[0])
    return a * TABLE[i] + b * TABLE[i + 1] + (a**3 - a) * BENT[i] + (b**3 - b) * BENT[i + 1]


@numba.njit
def grad_V(q):
    i, a, b = piece(q[0])
    return ((TABLE[i + 1] - TABLE[i] + (3 * b * b - 1) * BENT[i + 1] - (3 * a * a - 1) * BENT[i]) / H,)


SYSTEM = System(
    name="tabulated_well", label="tabulated double well", V=V, grad_V=grad_V, q0=(1.42,), p0=(0.1,), t_end=100,
    energy_scale="0.25", source="Press et al. (2007), Numerical Recipes, Sec. 3.3: natural cubic splines",
)  # fmt: skip


def main():
    import matplotlib as mpl

    import nearharmonic as nh
    from nearharmonic.plotting.style import SETTINGS, new_figure, save, style_of

    mpl.rcParams.update(SETTINGS)
    above, below = new_figure(7, 7).subplots(2, 1, height_ratios=(2, 3), gridspec_kw={"hspace": 0.4, "top": 0.97})
    q, tau = np.linspace(-1.7, 1.7, 341), np.geomspace(0.003, 0.15, 40)
    above.plot(q, SYSTEM.V((q,)), "-", [FIRST + H * i for i in range(2, 15)], TABLE[2:-2], "o", color="#404040")
    smooth = System(name="smooth", V=lambda q: q[0] ** 4 / 4 - q[0] ** 2 / 2, q0="1.42", p0="0.1", t_end=100)
    for name in ("ruth", "aba864", "babps9o7h"):
        for system, look in ((SYSTEM, {"label": nh.integrators[name].label}), (smooth, {"linestyle": "dotted"})):
            curve = nh.sweep(system, name, energy_scale=0.25, tau_per_stage=tau)
            below.loglog(tau, curve.max_energy_error, **style_of(name).line(marker="none", **look))
    above.set(xlabel="$q$", ylabel="$V$")
    below.set(xlabel=r"step size per stage $\tau/s$", ylabel=r"$\max\,|\Delta H|/0.25$ (dotted: $q^4/4 - q^2/2$)")
    below.legend(loc="lower center", bbox_to_anchor=(0.5, 0.98), ncols=3)
    print("wrote", save(above.figure, ["tabulated_well.png"])[0].resolve())


if __name__ == "__main__":
    main()
