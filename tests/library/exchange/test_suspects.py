"""Deliberate errors in correct coefficients are found at their positions, without other suspects."""

from __future__ import annotations

from dataclasses import replace

import pytest

from nearharmonic.exchange.proof import nearest
from nearharmonic.exchange.verdict import Verdict
from nearharmonic.integrators import integrators
from support.methods.tableau_files import failing, verdict


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
    assert exchanged.warnings[-1].startswith("the kick is first here, and the drift is in ABA864")


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
    assert "the step is that of McLachlan-Atela 4 (mclachlan_atela_4), backwards" in found.warnings


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


def test_few_digits_are_said_to_prove_little():
    found = registered("ruth", kick=("1.3512", "-1.7024", "1.3512"), drift=("0.6756", "-0.1756", "-0.1756", "0.6756"))
    warning = "5 digits allow so much that orders may be proved to them which the method does not have"
    assert found.warnings[0] == warning
    assert not any("allow so much" in warning for warning in registered("ruth").warnings)


def test_method_with_most_common_coefficients_is_nearest():
    found = registered("aba864", drift=("9.5", *integrators["aba864"].drift[1:]))
    assert found.nearest.tableau.name == "aba864"
    assert [place for place, _, _ in found.nearest.differing] == ["drift[0]"]
