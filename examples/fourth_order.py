"""An integrator of five stages and order four: five leapfrogs in a row, the third one backwards (Suzuki 1990)."""

from fractions import Fraction

from nearharmonic import Tableau, palindrome

DIGITS = 30


def decimal(number):
    """A number rounded to DIGITS decimals, as a string."""
    return f"{round(number * 10**DIGITS)}e-{DIGITS}"


#: Solves 4 u^3 + (1 - 4 u)^3 = 0, in doubles and then by Newton's method in fractions: u = 1 / (4 - 4^(1/3)).
u = Fraction(1 / (4 - 4 ** (1 / 3)))
for _ in range(3):
    u -= (4 * u**3 + (1 - 4 * u) ** 3) / (12 * u**2 - 12 * (1 - 4 * u) ** 2)

TABLEAU = Tableau(
    name="five_leapfrogs",
    label="five leapfrogs",
    order=4,
    first="drift",
    drift=palindrome(decimal(u / 2), decimal(u), decimal((1 - 3 * u) / 2)),
    kick=palindrome(decimal(u), decimal(u), centre=decimal(1 - 4 * u)),
    source="Suzuki (1990), Phys. Lett. A 146, 319, doi:10.1016/0375-9601(90)90962-N",
    digits=DIGITS,
)


def main():
    import nearharmonic as nh
    from nearharmonic.plotting.style import save

    methods = [TABLEAU, nh.integrators["ruth"], nh.integrators["babps9o7h"]]
    sizes = [0.01 * 10 ** (i / 12) for i in range(19)]  # per stage
    sweeps = [nh.sweep("henon_heiles", one, tau_per_stage=sizes) for one in methods]
    print("wrote", save(nh.plot(sweeps), ["fourth_order.png"])[0].resolve())


if __name__ == "__main__":
    main()
