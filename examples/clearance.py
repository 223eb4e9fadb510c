"""A mass between two springs with a gap, a potential in three pieces: V = 0 for |q| < 1, k (|q| - 1)^2 / 2 beyond."""

import numba

from nearharmonic import System


@numba.njit
def V(q, k):
    if abs(q[0]) < 1:
        return 0.0
    return k * (abs(q[0]) - 1) ** 2 / 2


@numba.njit
def grad_V(q, k):
    if abs(q[0]) < 1:
        return (0.0,)
    return (k * (q[0] - 1 if q[0] > 0 else q[0] + 1),)


def period(q, p, k):
    """Two flights through the gap, and two halves of an oscillation."""
    from math import pi, sqrt

    speed = sqrt(p[0] ** 2 + 2 * V((q[0],), k))
    return 4 / speed + 2 * pi / sqrt(k)


SYSTEM = System(
    name="clearance", label="oscillator with clearance", V=V, grad_V=grad_V, q0=(1.5,), p0=(0,), t_end=200,
    parameters={"k": 4}, period=period, source="Shaw & Holmes (1983), J. Sound Vib. 90, 129",
)  # fmt: skip


def main():
    import nearharmonic as nh
    from nearharmonic.plotting.style import save

    times = [i / 20 for i in range(20, 4001)]
    methods = [nh.integrators[name] for name in ("ruth", "aba864", "babps9o7h")]
    runs = [nh.integrate(SYSTEM, method, 0.02 * method.stages, t=times) for method in methods]
    print("wrote", save(nh.plot(runs), ["clearance.png"])[0].resolve())


if __name__ == "__main__":
    main()
