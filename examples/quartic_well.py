"""A particle in a plane well that is nearly harmonic: H = p.p/2 + q.q/2 + b (q.q)^2/4."""

from nearharmonic import Parameter, System


def V(q, b):
    x, y = q
    square = x * x + y * y
    return square / 2 + b * square**2 / 4


def angular_momentum(q, p, b):
    (x, y), (u, v) = q, p
    return x * v - y * u


SYSTEM = System(
    name="quartic_well",
    label="quartic well",
    V=V,
    q0=(1, 0),
    p0=(0, 0.5),
    t_end=100,
    units={"q": "1", "p": "1", "t": "1", "energy": "1"},
    parameters={"b": Parameter(value=0.1, unit="1", meaning="strength of the quartic term")},
    invariants={"angular_momentum": angular_momentum},
    source="textbook example",
)


def main():
    import nearharmonic as nh
    from nearharmonic.plotting.style import save

    times = [i / 20 for i in range(20, 2001)]
    methods = [nh.integrators[name] for name in ("ruth", "aba864", "babps9o7h")]
    runs = [nh.integrate(SYSTEM, method, 0.1 * method.stages, t=times) for method in methods]
    print("wrote", save(nh.plot(runs), ["quartic_well.png"])[0].resolve())


if __name__ == "__main__":
    main()
