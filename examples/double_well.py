"""A particle that crosses the barrier between two wells, H = p^2/2 - q^2/2 + q^4/4: far from harmonic."""

from nearharmonic import System


def V(q):
    return q[0] ** 4 / 4 - q[0] ** 2 / 2


SYSTEM = System(
    name="double_well",
    label="double well",
    V=V,
    q0=(1.42,),
    p0=(0,),
    t_end=100,
    energy_scale="0.25",  # the depth of the wells: H is nearly 0 on an orbit that just crosses the barrier
    source="Guckenheimer & Holmes (1983), Sec. 2.2: the unforced Duffing equation, doi:10.1007/978-1-4612-1140-2",
)


def main():
    import nearharmonic as nh
    from nearharmonic.plotting.style import save

    times = [i / 50 for i in range(50, 5001)]
    methods = [nh.integrators[name] for name in ("ruth", "aba864", "babps9o7h")]
    runs = [nh.integrate(SYSTEM, method, 0.05 * method.stages, t=times) for method in methods]
    print("wrote", save(nh.plot(runs), ["double_well.png"])[0].resolve())


if __name__ == "__main__":
    main()
