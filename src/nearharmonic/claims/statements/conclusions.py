"""Sections 5 and 6: discussion and conclusion."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from nearharmonic.claims.claim import Claim, Decision, claim, counted, either
from nearharmonic.claims.curves import Curves, over, range_words
from nearharmonic.claims.results import Results, Undecided, short

NEW = ("abas5o6h", "babs7o7h", "babps8o7h", "babps9o7h")
OPTIMISED = ("s5odr4", "aba104", "aba864", "aba1064")
TEN = ("ruth", "yoshida_s7o6a", *OPTIMISED, *NEW)
PRAISED = ("babps9o7h", "babps8o7h", "abas5o6h")
SYSTEMS = {"sho": "the oscillator", "henon_heiles": "the Hénon-Heiles system", "kepler": "the Sun-Mercury system"}
CUBES = tuple(f"cubes/{system}.h5" for system in SYSTEMS)


def _outperforms_ruth(system: str) -> Claim:
    @claim(
        id=f"outperform-ruth-{system.replace('_', '-')}",
        paper="Section 5, Discussion",
        statement=f"The new schemes outperform Ruth by several orders of magnitude, on {SYSTEMS[system]}",
        threshold="Ruth's maximum error over that of each of the four new methods in the figures at least 100: several "
        f"orders of magnitude are two at least; {range_words('a new one')}",
        needs=(f"cubes/{system}.h5",),
    )
    def decide(results: Results) -> Decision:
        curves = Curves(results.cube(system))
        ruth, new = curves.errors(["ruth"])[0], curves.errors(NEW)
        asked = curves.compared(ruth, new, kept=new)
        least, most = (ruth[asked.asked] / one[asked.asked] for one in (new.max(axis=0), new.min(axis=0)))
        value = f"gain of the least of the four {short(least.min(), 2)} to {short(least.max(), 2)}"
        return over(asked, ruth >= 100 * new.max(axis=0), f"{value}, of the best up to {short(most.max(), 2)}")

    return decide


ruth_on_sho, ruth_on_henon_heiles, ruth_on_kepler = map(_outperforms_ruth, SYSTEMS)


def _outperforms_optimised(system: str) -> Claim:
    @claim(
        id=f"outperform-optimised-{system.replace('_', '-')}",
        paper="Section 6, Conclusion",
        statement=f"The obtained integrators outperform those of Kahan and Blanes, on {SYSTEMS[system]}",
        threshold="the maximum error of each of the four new methods in the figures below those of s5odr4, ABA104, "
        f"ABA864 and ABA1064; {range_words()}",
        needs=(f"cubes/{system}.h5",),
    )
    def decide(results: Results) -> Decision:
        curves = Curves(results.cube(system))
        old, new = curves.errors(OPTIMISED), curves.errors(NEW)
        asked = curves.compared(old, new)
        some = (new.min(axis=0) < old.min(axis=0))[asked.asked]
        value = f"the best of the four is below them at {int(some.sum())} of {some.size}"
        return over(asked, new.max(axis=0) < old.min(axis=0), value)

    return decide


optimised_on_sho, optimised_on_henon_heiles, optimised_on_kepler = map(_outperforms_optimised, SYSTEMS)


def _favourable_to_yoshida(system: str) -> Claim:
    @claim(
        id=f"yoshida-moderate-steps-{system.replace('_', '-')}",
        paper="Section 6, Conclusion",
        statement=f"They compare favorably with Yoshida's of higher order for moderate steps, on {SYSTEMS[system]}",
        threshold="the maximum error of each of the four new methods in the figures below that of Yosh s7o6 A; "
        f"moderate steps are all but rounding and ruin: {range_words('a new one')}",
        needs=(f"cubes/{system}.h5",),
    )
    def decide(results: Results) -> Decision:
        curves = Curves(results.cube(system))
        yoshida, new = curves.errors(["yoshida_s7o6a"])[0], curves.errors(NEW)
        asked = curves.compared(yoshida, new, kept=new)
        some = (new.min(axis=0) < yoshida)[asked.asked]
        return over(asked, new.max(axis=0) < yoshida, f"the best of the four at {int(some.sum())} of {some.size}")

    return decide


yoshida_on_sho, yoshida_on_henon_heiles, yoshida_on_kepler = map(_favourable_to_yoshida, SYSTEMS)


@claim(
    id="best-performance",
    paper="Section 6, Conclusion",
    statement="The best performance is generally achieved by BAB's9o7H, BAB's8o7H and ABAs5o6H",
    threshold="the least maximum error of the ten is that of one of the three at more than half of the step sizes, as "
    "'generally' is read, on each system; from where all curves are 100 times their lowest point, which is rounding, "
    "to where the maximum error of one of the three passes 1 %",
    needs=CUBES,
)
def best_performance(results: Results) -> Decision:
    good, told = [], []
    for system in SYSTEMS:
        curves = Curves(results.cube(system))
        praised, others = curves.errors(PRAISED), curves.errors([name for name in TEN if name not in PRAISED])
        asked = curves.compared(praised, others, kept=praised)
        best = (praised.min(axis=0) < others.min(axis=0))[asked.asked]
        good.append(2 * int(best.sum()) > best.size)
        told.append(f"{system} {int(best.sum())} of {best.size}")
    return counted(good, ", ".join(told))


@claim(
    id="stable-with-large-steps",
    paper="Section 5, Discussion",
    statement="Optimized fourth order schemes achieve high stability, allowing large time steps",
    threshold="the proved linear limit of each new method above Ruth's, per step and per stage, which is at equal cost",
    needs=("cubes/linear_stability.h5",),
    target="stability",
)
def stable_with_large_steps(results: Results) -> Decision:
    cube = results.cube("linear_stability")
    limits = dict(zip(map(str, cube["integrator"].values), cube["start"].values[:, 0], strict=True))
    _require(limits, ("ruth", *NEW))
    stages = {name: results.method(name).stages for name in limits}
    per_step = [limits[name] > limits["ruth"] for name in NEW]
    per_stage = [limits[name] / stages[name] > limits["ruth"] / stages["ruth"] for name in NEW]
    listed = ", ".join(f"{n} {limits[n]:.3f} ({limits[n] / stages[n]:.3f})" for n in ("ruth", *NEW))
    return counted([*per_step, *per_stage], f"limit of tau omega per step (per stage): {listed}")


def _require(found: Collection[str], names: Iterable[str]) -> None:
    for name in names:
        if name not in found:
            message = f"the results do not have the method {name}"
            raise Undecided(message)


@claim(
    id="t-not-quadratic",
    paper="Section 5, Discussion",
    statement="The performance generally declines where T deviates significantly from a squared kinetic energy",
    threshold="on a relativistic oscillator, the maximum error over Ruth's at amplitude 1, where T is off by a "
    "sixth, above that at the least amplitude, for each new method",
    needs=("cubes/kinetic_energy.h5",),
    target="stability",
)
def t_not_quadratic(results: Results) -> Decision:
    cube = results.cube("kinetic_energy")
    _require(cube["integrator"].values, NEW)
    shares = cube["relative_error"].sel(roles="own", integrator=list(NEW))
    declines = (shares.sel(amplitude=1.0, method="nearest") / shares.isel(amplitude=0)).values
    listed = ", ".join(f"{name} {short(one, 2)}" for name, one in zip(NEW, declines, strict=True))
    return counted(list(declines > 1), f"the advantage shrinks by factors of {listed}")


@claim(
    id="high-order-negative",
    paper="Section 5, Discussion",
    statement="Higher order integrators usually involve several negative coefficients with large absolute values",
    threshold="each registered method of order 6 or more for any Hamiltonian has two negative coefficients at least, "
    "and the sum of its absolute values above that of each new method; 'usually' is read as more than half",
    needs=("tables/integrators.csv",),
)
def high_order_negative(results: Results) -> Decision:
    rows = results.rows("integrators")
    new = {row["integrator"]: float(row["sum of absolute values"]) for row in rows if row["integrator"] in NEW}
    _require(new, NEW)
    high = [row for row in rows if int(row["order"]) >= 6]
    good = [
        int(row["negative coefficients"]) >= 2 and float(row["sum of absolute values"]) > max(new.values())
        for row in high
    ]
    if not good:
        message = "the table of methods has none of order 6"
        raise Undecided(message)
    value = f"{sum(good)} of {len(good)} methods: " + ", ".join(
        f"{row['integrator']} {row['negative coefficients']}, sum {short(float(row['sum of absolute values']))}"
        for row in high
    )
    return either(2 * sum(good) > len(good), f"{value}; the new ones up to {short(max(new.values()))}")
