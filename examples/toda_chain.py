"""A ring of eight particles with Toda's forces, whose Lax matrix keeps its eigenvalues.

H = sum of p^2/2 + exp(d) - d - 1 over d = q_i - q_(i+1); L has p_i/2 on the diagonal, exp(d/2)/2 beside it, in a ring.
"""

import numpy as np

from nearharmonic import System
from nearharmonic.math import exp, sum


def V(q):
    return sum(exp(a - b) - (a - b) - 1 for a, b in zip(q, (*q[1:], q[0]), strict=True))


def lax(q, p):
    """The eigenvalues of L at each sample, in ascending order."""
    q, p, one = np.stack(q, axis=-1), np.stack(p, axis=-1), np.eye(8)
    beside = np.exp((q - np.roll(q, -1, axis=-1)) / 2)[..., None] * np.roll(one, 1, axis=1) / 2
    matrix = p[..., None] * one / 2 + beside + np.swapaxes(beside, -1, -2)
    return tuple(np.moveaxis(np.linalg.eigvalsh(np.where(abs(matrix) < 1e6, matrix, 0)), -1, 0))  # diverged: no error


SYSTEM = System(
    name="toda_chain",
    label="Toda chain",
    V=V,
    q0=[0.3, -0.2, 0.5, 0, -0.4, 0.1, 0.2, -0.5],
    p0=[0.4, 0.1, -0.3, 0.2, -0.5, 0.3, -0.1, -0.1],
    t_end=100,
    invariants={"lax": lax},
    source="Flaschka (1974), Phys. Rev. B 9, 1924, doi:10.1103/PhysRevB.9.1924",
)


def main():
    import matplotlib as mpl

    import nearharmonic as nh
    from nearharmonic.plotting.style import SETTINGS, log_scale, new_figure, save, style_of

    mpl.rcParams.update(SETTINGS)
    times, figure = [i / 10 for i in range(1001)], new_figure(7, 6.6)
    above, below = figure.subplots(2, 1, sharex=True, gridspec_kw={"hspace": 0.1})
    for name in ("ruth", "aba864", "babps9o7h"):
        method = nh.integrators[name]
        run = nh.integrate(SYSTEM, method, 0.1 * method.stages, t=times)  # the same number of forces for each
        drift = abs(run.lax - run.lax[0]).max("lax_component")
        below.plot(times[20:], drift[20:], **style_of(name).line(marker="none", label=method.label))
    above.plot(run.t, run.p / 2, color="#9a9a9a", linewidth=0.7)
    above.plot(run.t, run.lax, color="#0b3c8c", linewidth=1.6)
    log_scale(below, "y")
    above.set(ylabel="eigenvalues of $L$ (bold), $p_i/2$ (thin)")
    below.set(xlabel="time $t$", ylabel="largest drift of an eigenvalue", xlim=(0, 100))
    above.legend(*below.get_legend_handles_labels(), loc="lower center", bbox_to_anchor=(0.5, 1), ncols=3)
    print("wrote", save(figure, ["toda_chain.png"])[0].resolve())


if __name__ == "__main__":
    main()
