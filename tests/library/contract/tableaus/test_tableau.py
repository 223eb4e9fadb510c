"""Tableaus: validation on construction, single rounding of each coefficient, and digests."""

from dataclasses import FrozenInstanceError, replace
from decimal import Decimal, localcontext
from fractions import Fraction
from math import inf, nextafter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nearharmonic.errors import SettingError, TableauError
from nearharmonic.integrators import BENCHMARKED, integrators, plain_integrators
from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau, palindrome
from nearharmonic_paper.tasks.provenance import coefficients_digest

LEAPFROG = {
    "name": "leapfrog", "label": "leapfrog", "order": 2, "first": "kick", "kick": ("0.5", "0.5"), "drift": ("1",),
    "source": "Verlet (1967), doi:10.1103/PhysRev.159.98", "digits": 76,
}  # fmt: skip


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"first": "both"}, "first = 'both', expected 'drift' or 'kick'"),
        ({"first": "drift"}, "rows = '2 kicks, 1 drifts', expected one drift more than the other operator"),
        ({"kick": ("1",)}, "rows = '1 kicks, 1 drifts', expected one kick more"),
        ({"kick": ("1",), "drift": ()}, "rows = '1 kicks, 0 drifts'"),
        ({"kick": ("0.4", "0.6")}, "kick[0] = '0.4', expected its mirror image '0.6'"),
        ({"drift": ("1.1",)}, "drift row sum = '1+1.0e-01', expected 1 within 1e-76"),
        ({"kick": "0.5"}, "kick = '0.5', expected a tuple of decimals"),
        ({"kick": (0.5, True)}, "kick[1] = True, expected a finite decimal number"),
        ({"kick": (0.5, float("nan"))}, "kick[1] = 'nan', expected a finite decimal number"),
        ({"drift": ("nan",)}, "drift[0] = 'nan', expected a finite decimal number"),
        ({"drift": ("inf",)}, "drift[0] = 'inf', expected a finite decimal number"),
        ({"drift": ("1/1",)}, "drift[0] = '1/1', expected a finite decimal number"),
        ({"drift": ("1e999999999",)}, "drift[0] = '1e999999999', expected a finite decimal number"),
        ({"digits": 0}, "digits = 0, expected an integer from 1 to 1000"),
        ({"digits": True}, "digits = True, expected an integer from 1 to 1000"),
        ({"digits": 16.0}, "digits = 16.0, expected an integer from 1 to 1000"),
        ({"digits": 10**9}, "digits = 1000000000, expected an integer from 1 to 1000"),
        ({"drift": ("1." + "0" * 10**5,)}, "drift[0] = '1.000"),
        ({"order": 0}, "order = 0, expected an integer from 1 to 2, twice the stages"),
        ({"order": 99}, "order = 99, expected an integer from 1 to 2, twice the stages"),
        ({"label": 3}, "label = 3, expected a string"),
        ({"symmetric": "yes"}, "symmetric = 'yes', expected True, False or None"),
        ({"kick": ("0.4", "0.6"), "symmetric": True}, "kick[0] = '0.4', expected its mirror image '0.6'"),
        ({"kick": ("0", "1.1")}, "kick row sum = '1+1.0e-01'"),
        ({"kick": ("0", "0", "1", "0"), "drift": ("0.5", "0", "0.5")}, "kick[1] = '0', expected its mirror image '1'"),
        ({"requires": "luck"}, f"requires = 'luck', expected None or '{QUADRATIC_KINETIC_ENERGY}'"),
    ],
)
def test_contradiction_names_tableau_key_value_and_expected_value(change, named):
    with pytest.raises(TableauError) as caught:
        Tableau(**LEAPFROG | change)
    assert str(caught.value).startswith("tableau 'leapfrog': ")
    assert named in str(caught.value)


def test_floats_mean_the_decimals_that_they_print_as():
    given = {
        "first": "drift",
        "drift": palindrome(0.1, np.float64(0.4)),
        "kick": [1 / 3, 1 - 2 / 3, 1 / 3],
        "digits": 16,
    }
    found = Tableau(**LEAPFROG | given)
    assert found.drift == ("0.1", "0.4", "0.4", "0.1")
    assert found.kick == ("0.3333333333333333", "0.33333333333333337", "0.3333333333333333")
    assert Tableau(**LEAPFROG | {"kick": (0.5, 0.5), "drift": (1,)}) == Tableau(**LEAPFROG)


@pytest.mark.parametrize("name", ["../x", "", None, " x", "-x", "x/y", "x\\y", "x\ny", ".x", "x" * 101, 3, b"x"])
def test_a_name_is_a_name_of_a_file(name):
    with pytest.raises(TableauError, match="expected 1 to 100 printable characters"):
        Tableau(**LEAPFROG | {"name": name})


@pytest.mark.parametrize(("excess", "accepted"), [(1, True), (2, False)])
def test_row_sum_may_differ_by_one_last_unit_per_coefficient(excess, accepted):
    drift = ("1." + "0" * 38 + str(excess),)
    if accepted:
        assert Tableau(**LEAPFROG | {"drift": drift, "digits": 39}).drift == drift
    else:
        with pytest.raises(TableauError, match="drift row sum"):
            Tableau(**LEAPFROG | {"drift": drift, "digits": 39})


@pytest.mark.parametrize(
    ("change", "symmetric"),
    [
        ({}, True),
        ({"symmetric": False}, True),
        ({"symmetric": True}, True),
        ({"kick": ("1", "0")}, False),
        ({"kick": ("0", "1")}, False),
        ({"kick": ("0", "1"), "symmetric": False}, False),
        ({"kick": ("0.4", "0.6"), "symmetric": False}, False),
        ({"kick": ("0.50", "0.5")}, True),
        ({"first": "drift", "kick": ("1",), "drift": ("0.0", "1e0")}, False),
        ({"kick": ("0", "1", "0"), "drift": ("0.5", "0.5")}, True),
    ],
)
def test_tableau_knows_its_symmetry_and_padded_rows_may_lack_it(change, symmetric):
    tableau = Tableau(**LEAPFROG | {"order": 1} | change)
    assert tableau.symmetric is symmetric
    assert replace(tableau, note="again").symmetric is symmetric
    assert ("symmetric no" in repr(tableau)) is not symmetric


def test_nystrom_method_keeps_lower_order_with_exchanged_roles():
    assert integrators["srkn_a14"].role("kick").order == 2
    assert integrators["mclachlan_atela_5"].role("drift").order == 1
    assert integrators["ruth_s3o3"].role("drift").order == 3


@given(data=st.data())
def test_no_digit_of_a_registered_row_can_change_unnoticed(data):
    # Guaranteed decimals but the last two, which the tolerance of the row sum, s + 1 units, is there for.
    tableau = integrators[data.draw(st.sampled_from(BENCHMARKED))]
    key = data.draw(st.sampled_from(["kick", "drift"]))
    row = getattr(tableau, key)
    i = data.draw(st.integers(0, len(row) - 1))
    place = row[i].index(".") + data.draw(st.integers(1, tableau.digits - 2))
    digit = data.draw(st.sampled_from(sorted(set("0123456789") - {row[i][place]})))
    wrong = row[i][:place] + digit + row[i][place + 1 :]
    mirrored = tuple(wrong if k in (i, len(row) - 1 - i) else c for k, c in enumerate(row))
    with pytest.raises(TableauError, match=f"{key} row sum"):
        replace(tableau, **{key: mirrored})


def test_a_palindrome_is_written_once():
    assert palindrome("1", "2") == ("1", "2", "2", "1")
    assert palindrome("1", "2", centre="3") == ("1", "2", "3", "2", "1")


def test_a_tableau_cannot_be_changed():
    with pytest.raises(FrozenInstanceError):
        Tableau(**LEAPFROG).order = 4


def neighbours(value):
    return nextafter(value, -inf), value, nextafter(value, inf)


@pytest.mark.parametrize("name", BENCHMARKED)
def test_doubles_are_the_nearest_to_the_printed_decimals(name):
    tableau = integrators[name]
    for row, rounded in zip((tableau.outer, tableau.inner), tableau.rows_double(), strict=True):
        for text, value in zip(row, rounded, strict=True):
            exact = Fraction(text)
            distance = {x: abs(Fraction(x) - exact) for x in neighbours(value)}
            assert min(distance, key=distance.get) == value


def test_a_step_opens_and_closes_with_the_operator_named_first():
    kick_first, drift_first = integrators["babs7o7h"], integrators["aba104"]
    assert (kick_first.outer, kick_first.inner) == (kick_first.kick, kick_first.drift)
    assert (drift_first.outer, drift_first.inner) == (drift_first.drift, drift_first.kick)
    assert kick_first.first_same_as_last
    assert not drift_first.first_same_as_last
    assert kick_first.stages == drift_first.stages == 7


def test_exchanged_roles_swap_outer_row_and_drop_source_claims():
    tableau = integrators["babps8o7h"]
    swapped = tableau.role("drift")
    assert (swapped.first, swapped.outer, swapped.inner) == ("drift", tableau.outer, tableau.inner)
    assert (swapped.drift, swapped.kick) == (tableau.kick, tableau.drift)
    assert (swapped.order, swapped.harmonic_order, tableau.harmonic_order) == (4, None, 7)
    assert swapped.role("kick").kick == tableau.kick


def test_a_role_that_is_already_played_changes_nothing():
    tableau = integrators["babps8o7h"]
    assert tableau.role("kick") is tableau
    assert tableau.role(None) is tableau


def test_an_unknown_role_is_refused():
    with pytest.raises(SettingError, match="first = 'both' is not allowed: it is 'drift' or 'kick'"):
        integrators["ruth"].role("both")


def nudged(tableau, row, i):
    """``tableau`` with entry i of ``row`` and its mirror image changed below the last decimal that its source vouches
    for, which the tableau cannot tell from rounding."""
    values = list(getattr(tableau, row))
    change = Decimal(10) ** (-tableau.digits - 3)
    with localcontext(prec=400):
        for k in {i, len(values) - 1 - i} if tableau.symmetric else {i}:
            values[k] = f"{Decimal(values[k]) + change:f}"
    return replace(tableau, **{row: tuple(values)})


@pytest.mark.parametrize("name", plain_integrators)
def test_every_row_entry_and_first_operator_count(name):
    tableau = integrators[name]
    other = tableau.role("drift" if tableau.first == "kick" else "kick")
    changed = [tableau, other]
    for row in ("kick", "drift"):
        changed += [nudged(tableau, row, i) for i in range((len(getattr(tableau, row)) + 1) // 2)]
    assert len(changed) == 2 + tableau.stages + 1  # of 2 s + 1 numbers every second is a mirror image
    assert len({one.digest() for one in changed}) == len(changed)
    assert len({coefficients_digest([one]) for one in changed}) == len(changed)


def test_digest_does_not_know_names():
    tableau = integrators["aba864"]
    assert replace(tableau, name="x", label="y", source="z", note="").digest() == tableau.digest()
    assert len({t.digest() for t in integrators.values()}) == len(integrators)
    assert len(tableau.digest()) == 64


@pytest.mark.parametrize(
    ("tau", "t_end", "cost", "steps"),
    [
        (0.1, "1", None, 3),  # 0.1 * 3 is above 3/10: below 3.34
        (0.1, 1.0, None, 3),
        (Fraction(1, 10), Fraction(3, 4), None, 2),  # 2.5 exactly, to even
        (0.1, "0.75", None, 2),  # 0.1 * 3 in doubles is above 3/10, and the quotient below 2.5
        (10.0, "1", None, 1),
        (0.1, 1.0, 4.0, 2),
    ],
)
def test_steps_are_those_of_the_nearest_whole_number(tau, t_end, cost, steps):
    assert integrators["ruth"].steps(tau, t_end, cost) == steps


def test_a_double_is_divided_as_doubles_and_a_text_exactly():
    """10.05 / 0.3 in doubles is a tie, 33.5, and goes to the even number; the quotient of the doubles is below."""
    assert 10.05 / (0.1 * 3) == 33.5
    assert Fraction(10.05) / Fraction(0.1 * 3) < Fraction(67, 2)
    assert integrators["ruth"].steps(0.1, 10.05) == 34
    assert integrators["ruth"].steps(0.1, Fraction(10.05)) == 33


def test_evaluations_are_stages_step_and_one_to_begin_with_kick():
    assert integrators["ruth"].evaluations(7) == 21
    assert integrators["leapfrog"].evaluations(7) == 7 + (integrators["leapfrog"].first == "kick")
    assert integrators["chin_4a"].evaluations(7) == 15
    assert integrators["chin_4a"].evaluations(np.array([1, 7])).tolist() == [3, 15]


def test_a_processor_without_squares_is_refused():
    processor = integrators["rowlands"].processor
    with pytest.raises(TableauError, match="expected None, as there are kicks of V alone"):
        replace(integrators["ruth"], processor=processor)
