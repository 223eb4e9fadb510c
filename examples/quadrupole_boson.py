"""Vibrations of a nuclear surface, the quadrupole boson, with a tangle of three-fold symmetry.

H = A p.p/2 + A q.q/2 + B q1 (3 q2^2 - q1^2)/sqrt(2) + D (q.q)^2/4.
"""

from fractions import Fraction
from math import isqrt

from nearharmonic import Parameter, System

SQRT2 = Fraction(isqrt(2 * 10**60), 10**30)  # to 30 digits: a float would have 16


def V(q, A, B, D):
    x, y = q
    square = x * x + y * y
    return A * square / 2 + B * x * (3 * y * y - x * x) / SQRT2 + D * square**2 / 4


def T(p, A, B, D):
    return A * (p[0] ** 2 + p[1] ** 2) / 2


SYSTEM = System(
    name="quadrupole_boson",
    label="quadrupole boson",
    V=V,
    T=T,
    q0=("4.919080920016389", "2.836942666663649"),
    p0=(0, 0),
    t_end=100,
    parameters={
        "A": Parameter(value=1, unit="1", meaning="strength of the harmonic terms"),
        "B": Parameter(value=0.55, unit="1", meaning="strength of the cubic terms"),
        "D": Parameter(value=0.4, unit="1", meaning="strength of the quartic term"),
    },
    source="Baran & Raduta (1998), Int. J. Mod. Phys. E 7, 527; initial values of SciMLBenchmarks, "
    "Quadrupole_boson_Hamiltonian_energy_conservation_benchmark",
)


def main():
    import nearharmonic as nh
    from nearharmonic.plotting.style import save

    times = [i / 50 for i in range(50, 1501)]
    methods = [nh.integrators[name] for name in ("ruth", "aba864", "babps9o7h")]
    runs = [nh.integrate(SYSTEM, method, 0.02 * method.stages, t=times, t_end=30) for method in methods]
    print("wrote", save(nh.plot(runs), ["quadrupole_boson.png"])[0].resolve())


if __name__ == "__main__":
    main()
