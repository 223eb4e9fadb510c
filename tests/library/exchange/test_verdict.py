"""Coefficients from other sources: proofs of published claims, bounds of residuals, and errors that are found."""

from __future__ import annotations

import random
from dataclasses import replace
from decimal import Context
from fractions import Fraction
from itertools import chain, pairwise

import pytest
from mpmath import diff, expm, log, matrix, mp, mpf, taylor

import nearharmonic as nh
from nearharmonic.exchange.files import CoefficientFile
from nearharmonic.exchange.method import Printed, digits_of, step_of
from nearharmonic.exchange.proof import majorant, nearest, residuals
from nearharmonic.exchange.verdict import OscillatorStep, Verdict
from nearharmonic.integrators import integrators, plain_integrators
from support.methods.tableau_files import failing, verdict
from support.oracles.multiprecision import energy_errors, trajectory
from support.oracles.reference_solutions import oscillator_step

#: General order, order for quadratic T, and order on the oscillator.
PUBLISHED = {
    "bcss_s3": (2, 2, 2),
    "mclachlan_atela_4": (3, 4, 4),
    "morales_s17o8": (8, 8, 8),
    "na7": (4, 6, 6),
    "nystrom_6a8": (4, 6, 6),
    "omelyan_s7o6": (4, 6, 6),
    "predescu_s3": (2, 2, 2),
    "s17odr8a": (8, 8, 8),
    "sofspa_s11o6": (6, 6, 6),
    "sofspa_s19o8": (8, 8, 8),
    "srkn_a17": (4, 8, 8),
    "srkn_b18": (4, 8, 8),
    "teloy_6a9": (6, 6, 6),
    "teloy_8a17b": (4, 8, 8),
}
#: Claimed order or None, and proved: general, for quadratic T, on the oscillator.
LIBRARIES = {
    "blackjax_mclachlan": (None, 2, 2, 2),
    "blackjax_omelyan": (None, 4, 4, 4),
    "blackjax_yoshida": (None, 2, 2, 2),
    "desolver_abas5o6h": (6, 4, 4, 6),
    "desolver_babs9o7h": (7, 4, 4, 6),
    "diffrax_semi_implicit_euler": (1, 1, 1, 1),
    "galpy_symplec4": (4, 4, 4, 4),
    "galpy_symplec6": (6, 6, 6, 6),
    "geometricintegrators_mclachlan4": (4, 2, 2, 2),
    "geometricintegrators_mclachlan4_since": (4, 4, 4, 4),
    "mici_bcss_s2": (2, 2, 2, 2),
    "mici_bcss_s3": (2, 2, 2, 2),
    "mici_bcss_s4": (2, 2, 2, 2),
    "ordinarydiffeq_calvosanz4": (4, 3, 3, 4),
    "ordinarydiffeq_mcate4": (4, 3, 3, 4),
    "ordinarydiffeq_mcate42": (4, 1, 1, 1),
    "ordinarydiffeq_mcate5": (5, 3, 3, 5),
    "suzuki_yoshida_3": (4, 2, 2, 2),
    "suzuki_yoshida_5": (4, 2, 2, 2),
    "suzuki_yoshida_7": (6, 6, 6, 6),
    "xtrack_yoshida4": (4, 6, 6, 6),
    "xtrack_yoshida_4": (4, 4, 4, 4),
    "xtrack_yoshida_6": (6, 6, 6, 6),
    "xtrack_yoshida_8": (8, 8, 8, 8),
}


def orders(found):
    return found.order.order, found.quadratic_order.order, found.oscillator.order


#: The systems in which the methods show their orders, and starts on which no error term vanishes by chance.
HENON_HEILES = nh.systems["henon_heiles"], ([mpf("0.3"), mpf("0.1")], [mpf("0.2"), mpf("0.4")])
OSCILLATOR = nh.systems["sho"], ([mpf("0.3")], [mpf("0.4")])


def observed_order(file, system, start):
    """From three step sizes; its own next order leaves 0.05 at these."""
    ends = ([*chain(*trajectory(file, system, mpf(2) / n, n, start)[-1])] for n in (64, 128, 256))
    errors = [max(abs(x - y) for x, y in zip(a, b, strict=True)) for a, b in pairwise(ends)]
    return float(log(errors[0] / errors[1], 2))


@pytest.mark.slow
@pytest.mark.parametrize("name", PUBLISHED)
def test_what_a_paper_says_of_its_method_is_proved(name):
    found = verdict("published", name)
    assert found.holds
    assert orders(found) == PUBLISHED[name]
    assert found.file.order == found.quadratic_order.order
    assert found.file.requires is not None or found.file.order == found.order.order


@pytest.mark.slow
@pytest.mark.parametrize("name", LIBRARIES)
def test_order_that_library_states_is_refuted_if_it_is_wrong(name):
    found = verdict("libraries", name)
    claimed, *proved = LIBRARIES[name]
    assert found.file.order == claimed
    assert orders(found) == tuple(proved)
    assert ("order" in failing(found)) == (claimed is not None and claimed > proved[0])


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in LIBRARIES if name.startswith("ordinarydiffeq")])
def test_what_is_proved_of_library_is_what_its_steps_show(name):
    found = verdict("libraries", name)
    assert observed_order(found.file, *HENON_HEILES) == pytest.approx(found.quadratic_order.order, abs=0.1)
    assert observed_order(found.file, *OSCILLATOR) == pytest.approx(found.oscillator.order, abs=0.1)


@pytest.mark.parametrize(("name", "order"), [("ordinarydiffeq_mcate4", 4), ("ordinarydiffeq_mcate5", 5)])
def test_exchanged_nystrom_method_is_reported_in_wrong_role(name, order):
    found = verdict("libraries", name)
    assert failing(found) == ["order", "first"]
    (role,) = [claim for claim in found.claims if claim.says == "first = drift"]
    both = f"order 3 for quadratic T with the drift first, order {order} for quadratic T with the kick first"
    assert role.proof == both
    (suspect,) = found.suspects
    assert (suspect.rows.kick, suspect.rows.drift, suspect.rows.first) == (found.file.drift, found.file.kick, "kick")


def test_nearest_method_decides_role_without_dependent_claim():
    found = verdict("libraries", "desolver_abas5o6h")
    assert failing(found) == ["order"]
    assert found.nearest.tableau.name == "abas5o6h"
    assert found.nearest.is_same
    assert found.nearest.exchanged
    assert found.warnings == [
        "the kick is first here; the coefficients belong to ABAs5o6H (abas5o6h), where the drift is first"
    ]
    own = verdict("libraries", "desolver_babs9o7h")
    assert own.nearest.tableau.name == "babps9o7h"
    assert own.nearest.is_same
    assert not own.nearest.exchanged
    assert own.warnings == []


@pytest.mark.slow
def test_verify_finds_wrong_digit_at_twenty_first_decimal():
    found = verdict("libraries", "teloy_8a17c")
    assert failing(found) == ["rows", "order"]
    assert found.digits_that_hold == 22
    (suspect,) = found.suspects
    start = "drift[5] and its mirror image drift[11] = 0.26500275499062083398"
    assert suspect.says.startswith(start)
    mended = replace(found.file, kick=suspect.rows.kick, drift=suspect.rows.drift)
    assert observed_order(mended, *HENON_HEILES) == pytest.approx(8, abs=0.1)


@pytest.mark.parametrize(
    ("name", "claims", "says"),
    [
        ("digit", ["rows", "order"], "drift[1] and its mirror image drift[5] = 0.60470788"),
        (
            "sign",
            ["rows", "order"],
            "kick[2] and its mirror image kick[4] = 0.19724296189768175230925663095622519644388",
        ),
        ("lines", ["order"], "lines 1 and 2 of kick and drift: exchanged, every claim holds"),
        ("role", ["order", "first"], "the roles: with the drifts as kicks and the kicks as drifts, the kick first"),
    ],
)
def test_a_damage_is_named_for_what_it_is(name, claims, says):
    found = verdict("damaged", name)
    assert failing(found) == claims
    assert [one.says[: len(says)] for one in found.suspects] == [says]


def test_of_a_wrong_claim_no_coefficient_is_suspected():
    found = verdict("damaged", "claim")
    assert failing(found) == ["order"]
    assert found.order.order == 6
    assert found.suspects == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "name", "position", "energy"),
    [
        ("published", "predescu_s3", 2, 6),
        ("published", "mclachlan_atela_4", 4, 4),
        ("libraries", "ordinarydiffeq_mcate5", 5, 5),
        ("libraries", "desolver_babs9o7h", 7, 6),
        ("libraries", "geometricintegrators_mclachlan4", 2, 2),
    ],
)
def test_energy_order_on_oscillator_is_that_of_many_steps(kind, name, position, energy):
    """BAB's9o7H is of order 7 in the position (Nielsen 2015, Table 4)."""
    found = verdict(kind, name)
    assert (found.oscillator.harmonic_order, found.oscillator.energy_order) == (position, energy)
    system, start = OSCILLATOR
    coarse, fine = (max(energy_errors(found.file, system, mpf(1) / n, 40 * n, start)) for n in (8, 16))
    assert float(log(coarse / fine, 2)) == pytest.approx(energy, abs=0.1)


# --- bounds of residuals due to digits: never below the residuals of rounded correct coefficients ---------------------


SOME = ("ruth", "abas5o6h", "babps8o7h", "srkn_b11", "yoshida_s7o6a", "s15odr8")


def file_of(tableau, digits=None, claimed=True):
    context = Context(prec=digits) if digits else None
    rows = {
        key: tuple(str(context.create_decimal(text)) if context else text for text in getattr(tableau, key))
        for key in ("kick", "drift")
    }
    told = ("name", "label", "source", "first", "order", "harmonic_order", "requires")
    own = {key: getattr(tableau, key) for key in told}
    return CoefficientFile(path="", **own, **rows, digits=(digits or tableau.digits) if claimed else None)


def test_majorant_is_series_of_minus_logarithm_of_two_minus_exp():
    for n, coefficient in enumerate(taylor(lambda x: -log(2 - mp.exp(x)), 0, 8)[1:], start=1):
        one = majorant(n)
        assert abs(mpf(one.numerator) / one.denominator - coefficient) < mpf(10) ** -12


@pytest.mark.slow
@pytest.mark.parametrize("digits", [6, 10, 16, 30])
@pytest.mark.parametrize("name", SOME)
def test_no_rounding_of_a_registered_method_refutes_what_it_declares(name, digits):
    tableau = plain_integrators[name]
    for claimed in (True, False):
        assert Verdict(file_of(tableau, digits, claimed=claimed)).holds


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow if name in SOME else pytest.mark.long) for name in plain_integrators],
)
def test_every_registered_method_proves_declarations_from_digits(name):
    for digits in (None, 8, 15, 17, 40):
        if digits is None or digits <= plain_integrators[name].digits:
            found = Verdict(file_of(plain_integrators[name], digits))
            assert found.holds
            assert found.nearest.tableau.name == name
            assert found.nearest.is_same
            assert not found.suspects


@pytest.mark.slow
@pytest.mark.parametrize("name", SOME)
def test_an_order_higher_by_two_is_refuted_with_sixteen_digits(name):
    tableau = plain_integrators[name]
    higher = replace(file_of(tableau, 16), order=tableau.order + 2, harmonic_order=None)
    assert not Verdict(higher).holds


@pytest.mark.slow
@pytest.mark.parametrize("quadratic", [False, True])
@pytest.mark.parametrize("name", SOME[:4])
def test_residuals_of_rounded_coefficients_stay_within_what_the_digits_allow(name, quadratic):
    """Each coefficient is off by up to three units of its tenth decimal, one of each row by what closes the sum too."""
    tableau, generator = plain_integrators[name], random.Random(1)
    exact = step_of(tableau.kick, tableau.drift, tableau.first, 10)
    for _ in range(5):
        moved = [generator.uniform(-1, 1) * c.uncertainty for _, c in exact]
        for letter in "AB":
            places = [i for i, (x, _) in enumerate(exact) if x == letter]
            moved[generator.choice(places)] -= sum(moved[i] for i in places)
        step = tuple(
            (letter, Printed(c + Fraction(d), c.uncertainty, c.place))
            for (letter, c), d in zip(exact, moved, strict=True)
        )
        found = [one for n in range(1, tableau.order + 1) for one in residuals(step, n, quadratic=True)]
        assert all(one.vanishes for one in found)
        # The bound is no idle one: somewhere a residual comes within a factor of a thousand of it.
        assert max(abs(one.value) / one.allowed for one in found if one.degree > 1) > 1e-3
        limit = OscillatorStep(step)
        assert limit.harmonic_order >= (tableau.harmonic_order or tableau.order)


def test_a_residual_is_that_of_matrices():
    """On 3 by 3 matrices that vanish in triple products, log(exp(aA) exp(bB)...) has two degrees alone."""
    A, B = matrix([[0, 1, 0], [0, 0, 2], [0, 0, 0]]), matrix([[0, 3, 0], [0, 0, 1], [0, 0, 0]])
    step = step_of(("0.3", "0.7"), ("0.4", "0.6"), "kick", 0)
    product = matrix([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    for letter, c in step:
        product = product * expm({"A": A, "B": B}[letter] * (mpf(c.numerator) / c.denominator))
    X = product - matrix([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    corner = (X - X * X / 2 - A - B)[0, 2]
    (one,) = residuals(step, 2, quadratic=False)
    bracket = (A * B - B * A)[0, 2]
    assert abs(mpf(one.value.numerator) / one.value.denominator - corner / bracket) < mpf(10) ** -25


@pytest.mark.parametrize(
    ("kick", "drift", "first", "limit"),
    [(("1",), ("1",), "kick", 2), (("2", "-1"), ("-1", "2"), "kick", 0.5), (("0.5", "0.5"), ("1",), "kick", 2)],
)
def test_the_stability_limit_is_where_the_trace_leaves_two(kick, drift, first, limit):
    """tr K of the second is 2 - tau^2 + 4 tau^4, less than 2 up to tau = 1/2."""
    assert float(OscillatorStep(step_of(kick, drift, first, 0)).stability_limit(0)) == pytest.approx(limit, abs=1e-15)


def test_asymmetric_stability_limit_matches_multiprecision_trace():
    file = file_of(plain_integrators["mclachlan_atela_4"])
    step = step_of(file.kick, file.drift, file.first, digits_of(file).number)

    def trace(tau):
        K = oscillator_step(file, tau)
        return K[0, 0] + K[1, 1]

    limit = mpf(OscillatorStep(step).stability_limit(0))
    assert abs(abs(trace(limit)) - 2) < mpf(10) ** -25
    assert abs(diff(trace, limit)) > 0.01
    assert all(abs(trace(limit * k / 200)) < 2 for k in range(1, 200))


@pytest.mark.parametrize(
    ("texts", "number"),
    [
        (("0.5", "0.5"), 0),
        (("0.1932", "0.3068"), 0),
        (("0.25000000", "0.50000000"), 0),
        (("0.04649290043965892", "0.154901012702888", "0.31970548287359174"), 16),
        (("0.675604", "0.1756"), 6),
        (("0.351166139915740498", "0.15585935917621682", "-0.007025499091957318"), 16),
        (("0.26500275499062083398646002963079872",), 35),
        (("0.04649290043965891900", "0.15490101270288800000"), 15),
        ((f"{0.04649290043965892:.22f}", f"{0.154901012702888:.25f}", "0.5"), 16),
    ],
)
def test_unclaimed_digits_of_file_are_its_shown_digits(texts, number):
    file = CoefficientFile(path="", name="", label="", source="", first="kick", kick=texts, drift=("1",))
    assert digits_of(file).number == number
    assert digits_of(replace(file, digits=12)).number == 12


# --- deliberate errors in correct coefficients are found at their positions -------------------------------------------


def sound():
    """6A8 of 8 kicks and 9 drifts, which asks for quadratic kinetic energy."""
    return verdict("published", "nystrom_6a8").file


def altered(key, changes):
    row = list(getattr(sound(), key))
    for i, text in changes.items():
        row[i] = text
    return Verdict(replace(sound(), **{key: tuple(row)}))


def suspected(found):
    assert not found.holds
    assert all(Verdict(replace(found.file, **one.rows._asdict())).holds for one in found.suspects)
    return [one.rows for one in found.suspects]


def rows_of(file):
    return (file.kick, file.drift, file.first)


@pytest.mark.slow
@pytest.mark.parametrize("place", [0, 5, 30, 70])
def test_mirror_image_reveals_wrong_digit(place):
    text = sound().drift[2]
    k = text.index(".") + 1 + place
    wrong = f"{text[:k]}{(int(text[k]) + 5) % 10}{text[k + 1 :]}"
    assert suspected(altered("drift", {2: wrong})) == [rows_of(sound())]


def test_a_digit_of_the_middle_is_found_by_the_sum():
    found = altered("kick", {4: "0.38"})
    assert suspected(found) == [rows_of(sound())]
    assert found.suspects[0].says == "kick[4] = 0.38: with 2 for 3 as decimal 1, 0.28, every claim holds"


def test_two_neighbouring_digits_exchanged_are_found():
    text = sound().drift[1]
    wrong = text.replace("0.3278", "0.2378")
    found = altered("drift", {1: wrong, -2: wrong})
    assert rows_of(sound()) in suspected(found)
    assert "two neighbouring digits exchanged" in found.suspects[0].says


def test_exchanged_coefficients_are_found_with_and_without_mirror_images():
    k = sound().kick
    assert suspected(altered("kick", {1: k[2], 2: k[1]})) == [rows_of(sound())]
    found = altered("kick", {1: k[3], 3: k[1], -2: k[3], -4: k[1]})
    assert suspected(found) == [rows_of(sound())]
    assert found.suspects[0].says == "kick[1] and kick[3]: exchanged, as their mirror images, every claim holds"


def test_digit_is_found_although_middle_of_row_closes_sum():
    """0.327... is 0.337... in two places, and 0.268... in the middle, twice, is less by 0.01."""
    d = sound().drift
    wrong, closing = d[1].replace("0.327", "0.337"), d[3].replace("0.268", "0.258")
    found = altered("drift", {1: wrong, -2: wrong, 3: closing, 4: closing})
    assert suspected(found) == [rows_of(sound())]
    assert found.suspects[0].says.endswith(", every claim holds, drift[3] closing the sum")


def test_of_rows_of_one_length_first_operator_is_suspected_too():
    own = verdict("published", "mclachlan_atela_4").file
    found = Verdict(replace(own, first="drift"))
    assert failing(found) == ["order"]
    assert rows_of(own) in suspected(found)
    found = Verdict(replace(own, kick=own.drift, drift=own.kick))
    assert rows_of(own) in suspected(found)


def test_nothing_is_suspected_where_all_claims_hold():
    assert Verdict(sound()).suspects == []
    assert Verdict(sound()).digits_that_hold is None


def test_coefficients_without_claims_are_suspected_by_their_sums():
    found = Verdict(replace(altered("kick", {4: "0.38"}).file, order=None, requires=None))
    assert failing(found) == ["rows"]
    assert suspected(found) == [rows_of(sound())]


def registered(name, **changes):
    tableau = integrators[name]
    rows = {"kick": tableau.kick, "drift": tableau.drift, "first": tableau.first}
    return Verdict(replace(sound(), order=None, requires=None, **(rows | changes)))


def test_nearest_method_is_found_with_fewer_digits_and_exchanged_roles():
    short = tuple(f"{float(text):.9f}" for text in integrators["aba864"].kick)
    shorter = registered("aba864", kick=short, drift=tuple(f"{float(t):.9f}" for t in integrators["aba864"].drift))
    assert (shorter.nearest.tableau.name, shorter.nearest.is_same, shorter.nearest.exchanged) == ("aba864", True, False)
    t = integrators["aba864"]
    exchanged = registered("aba864", kick=t.drift, drift=t.kick, first="kick")
    assert (exchanged.nearest.tableau.name, exchanged.nearest.is_same, exchanged.nearest.exchanged) == (
        "aba864", True, True,
    )  # fmt: skip
    assert exchanged.warnings[-1].startswith("the kick is first here; the coefficients belong to ABA864")


def test_nearest_method_is_found_in_other_units_of_step():
    twice = registered("leapfrog", kick=("1", "1"), drift=("2",))
    assert (twice.nearest.tableau.name, twice.nearest.is_same, twice.nearest.rescaled) == ("leapfrog", True, True)


def test_coefficients_that_differ_from_the_nearest_method_are_named():
    wrong = ("0.0711334264982231177779387300061549964174", *integrators["aba864"].drift[1:])
    found = registered("aba864", drift=wrong)
    (differing,) = found.nearest.differing
    assert (found.nearest.tableau.name, differing[0]) == ("aba864", "drift[0]")
    assert any(warning.startswith("drift[0] = 0.0711334264982231") for warning in found.warnings)


def test_methods_with_another_number_of_stages_are_not_compared():
    three = verdict("damaged", "sign").step[:11]
    assert nearest(three).compared == 11
    assert nearest(three[:1] + three[2:3] * 40) is None


def test_asymmetric_method_is_recognised_reversed_and_with_exchanged_roles():
    exchanged = verdict("libraries", "ordinarydiffeq_mcate5").nearest
    assert (exchanged.tableau.name, exchanged.is_same) == ("mclachlan_atela_5", True)
    assert (exchanged.exchanged, exchanged.reversed) == (True, False)
    file = verdict("published", "mclachlan_atela_4").file
    back = replace(file, kick=file.kick[::-1], drift=file.drift[::-1], first="drift")
    found = Verdict(back)
    assert (found.nearest.tableau.name, found.nearest.is_same) == ("mclachlan_atela_4", True)
    assert (found.nearest.exchanged, found.nearest.reversed) == (False, True)
    assert "the step is a backward step of McLachlan-Atela 4 (mclachlan_atela_4)" in found.warnings


def test_a_claimed_symmetry_is_judged_both_ways():
    for claimed in (True, False):
        found = Verdict(replace(sound(), symmetric=claimed))
        assert failing(found) == ([] if claimed else ["symmetric"])
    lopsided = altered("kick", {0: "0.07", -1: "0.0688588868853"})
    assert failing(Verdict(replace(lopsided.file, symmetric=True, order=None, digits=10)))[-1] == "symmetric"


def test_a_harmonic_order_decides_the_role():
    t = integrators["babps8o7h"]
    own = registered("babps8o7h")
    claimed = Verdict(replace(own.file, order=4, harmonic_order=7))
    assert claimed.holds
    assert claimed.claims[-1].proof == "harmonic order 7 with the kick first, harmonic order 6 with the drift first"
    wrong = Verdict(replace(claimed.file, kick=t.drift, drift=t.kick, first="drift"))
    assert failing(wrong) == ["harmonic_order", "first"]
