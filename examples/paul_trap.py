"""An ion in a Paul trap, q'' + (a - 2 s cos 2t) q = 0 (Mathieu): for which a and s it stays, by 40 000 runs."""

import numpy as np

from nearharmonic import System
from nearharmonic.math import cos


def V(q, t, a, s):
    return (a - 2 * s * cos(2 * t)) * q[0] ** 2 / 2


SYSTEM = System(
    name="paul_trap",
    label="Paul trap",
    V=V,
    q0=(1,),
    p0=(0,),
    t_end=100,
    time_dependent=True,
    parameters={"a": "0", "s": "0.4"},  # the static and the alternating voltage, scaled; s is q in Mathieu's equation
    surface_limit=1e6,  # p_t is part of H, and a stable orbit has any
    source="Paul (1990), Rev. Mod. Phys. 62, 531, doi:10.1103/RevModPhys.62.531",
)


def half_trace(a, s, integrator="babps9o7h", steps=10):
    """Half the trace of the linear map of a period, for arrays a, s (n,): orbits stay where it is between -1 and 1."""
    import nearharmonic as nh

    runs = [
        nh.ensemble(
            SYSTEM, integrator, np.pi / steps, t_end=np.pi, q0=[q], p0=[p], parameters={"a": a, "s": s},
            samples=1, energy="none", threads=2,
        )
        for q, p in ((1, 0), (0, 1))
    ]  # fmt: skip
    return (runs[0].q.values[:, 0, 0] + runs[1].p.values[:, 0, 0]) / 2


def main():
    import matplotlib as mpl

    from nearharmonic.plotting.style import SETTINGS, new_figure, save

    mpl.rcParams.update(SETTINGS)
    a, s = np.meshgrid(np.linspace(-1.5, 8, 200), np.linspace(0, 5, 200), indexing="ij")
    half = half_trace(a.ravel(), s.ravel()).reshape(a.shape)
    phase = np.arccos(np.where(abs(half) <= 1, half, np.nan)) / np.pi
    figure = new_figure(6.4, 5)
    axes = figure.subplots()
    image = axes.pcolormesh(s, a, phase, cmap="cividis", vmin=0, vmax=1, rasterized=True)
    figure.colorbar(image, label=r"phase of the map of a period ($\pi$); blank: the ion is lost")
    axes.set(xlabel="$s$, alternating voltage", ylabel="$a$, static voltage")
    print("wrote", save(figure, ["paul_trap.png"])[0].resolve())


if __name__ == "__main__":
    main()
