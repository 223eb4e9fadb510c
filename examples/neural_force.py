"""The force of a small neural network, H = p.p/2 + q.q/2 + c.tanh(W q + b), fitted to the Hénon-Heiles potential."""

import numba
import numpy as np

from nearharmonic import System

#: w1, w2, b and c of eight neurons: x^2 y - y^3/3 and a constant, to 1e-4 (rms) up to a radius of 0.75.
NEURONS = np.array([
    (0.7961, 0.5120, -0.4327, -2.0408), (-1.4893, 1.0281, -2.4863, 0.3988), (-0.4825, 0.3282, -0.0008, -5.5028),
    (0.0274, -1.0610, 0.6085, -1.7219), (1.5669, -1.0494, -2.4289, -0.3094), (-0.0256, 1.0074, 0.4022, 2.6034),
    (-0.0580, 1.8755, 0.6553, -0.0865), (-0.8223, -0.5310, -0.4874, 1.8066),
])  # fmt: skip
W, B, C = NEURONS[:, :2].copy(), NEURONS[:, 2].copy(), NEURONS[:, 3].copy()


@numba.njit
def V(q):
    return np.sum(q * q) / 2 + np.sum(C * np.tanh(W @ q + B))


@numba.njit
def grad_V(q):
    hidden = np.tanh(W @ q + B)
    return q + (C * (1 - hidden * hidden)) @ W


SYSTEM = System(
    name="neural_force", label="neural force", V=V, grad_V=grad_V, q0=(0, 0.3), p0=(0.35, 0), t_end=200,
    energy_scale="0.1", source="fitted by least squares to Hénon & Heiles (1964), doi:10.1086/109234",
)  # fmt: skip


def main():
    import matplotlib as mpl

    import nearharmonic as nh
    from nearharmonic.plotting.style import SETTINGS, log_scale, new_figure, save, style_of

    mpl.rcParams.update(SETTINGS)
    figure = new_figure(7, 7.5)
    above, below = figure.subplots(2, 1, height_ratios=(1, 2), gridspec_kw={"hspace": 0.4, "top": 0.94, "bottom": 0.07})
    for name in ("ruth", "aba864", "babps9o7h"):
        method = nh.integrators[name]
        run = nh.integrate(SYSTEM, method, 0.05 * method.stages, t=[i / 20 for i in range(20, 4001)])
        look = style_of(name).line(marker="none", linewidth=0.8, label=method.label)
        above.plot(run.t, abs(run.energy_error), **look)
    exact = nh.integrate("henon_heiles", method, 0.45, q0=SYSTEM.q0, p0=SYSTEM.p0, t=run.t.values, t_end=200)
    below.plot(exact.q[:, 0], exact.q[:, 1], color="#c0c0c0", linewidth=3, label="Hénon-Heiles potential")
    below.plot(run.q[:, 0], run.q[:, 1], color="#000000", linewidth=0.5, label="neural network")
    log_scale(above, "y")
    above.set(xlabel="time $t$", ylabel=r"$|\Delta H| / 0.1$")
    below.set(xlabel="$q_1$", ylabel="$q_2$", aspect="equal")
    for axes in (above, below):
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 0.98), ncols=3)
    print("wrote", save(figure, ["neural_force.png"])[0].resolve())


if __name__ == "__main__":
    main()
