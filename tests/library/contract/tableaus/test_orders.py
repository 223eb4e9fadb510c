"""Declared orders of registered tableaus, proved exactly from their printed coefficients to their digits."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal, localcontext

import pytest

import nearharmonic as nh
from nearharmonic.errors import TableauError
from nearharmonic.integrators import load_tableaus
from nearharmonic.integrators import plain_integrators as integrators
from nearharmonic.theory.order import (
    generalised_order_of,
    harmonic_order,
    harmonic_orders_of,
    leading_errors,
    nystrom_order_of,
    order_of,
)
from nearharmonic_paper.experiments.paper.tableaus import overview
from support.methods.ten_methods import EVERY_METHOD

EVERY = pytest.mark.parametrize("name", list(integrators))


def declaring(attribute):
    return pytest.mark.parametrize(
        "name", [name for name, tableau in integrators.items() if getattr(tableau, attribute) is not None]
    )


@pytest.mark.slow
@EVERY
def test_declared_order_holds_for_systems_tableau_is_for(name):
    tableau = integrators[name]
    if tableau.requires is None:
        assert order_of(tableau) == tableau.order
        assert nystrom_order_of(tableau) >= tableau.order
    else:
        assert nystrom_order_of(tableau) == tableau.order
        # A tableau asks for quadratic kinetic energy only if it needs it.
        assert order_of(tableau) < tableau.order


@declaring("harmonic_order")
def test_the_declared_harmonic_order_is_that_of_the_position(name):
    assert harmonic_order(name) == integrators[name].harmonic_order


@declaring("generalised_order")
def test_declared_generalised_order_holds_with_kick_as_small_part(name):
    tableau = integrators[name]
    assert generalised_order_of(name, quadratic=tableau.requires is not None) == tableau.generalised_order


@EVERY
def test_a_harmonic_order_is_no_smaller_than_the_order(name):
    assert min(harmonic_orders_of(name)) >= integrators[name].order


@EVERY_METHOD
def test_the_leading_error_stands_out_from_what_the_digits_leave(name):
    # The smallest so far are 4e-9; a vanishing condition leaves less than 1e-24 of any set with 26 digits or more, and
    # sets with fewer are of order two, which is a matter of their sums.
    assert all(error.norm > 1e-12 for error in leading_errors(name))
    assert leading_errors(name).general.degree == order_of(name) + 1


@EVERY
def test_a_wrong_digit_ten_places_before_the_last_is_found(name):
    # Ten: what the size of the coefficients and the number of products may hide.
    tableau = integrators[name]
    rows = {}
    for key in ("kick", "drift"):
        with localcontext(prec=200):
            row = [Decimal(c) for c in getattr(tableau, key)]
            step = Decimal(1).scaleb(10 - tableau.digits)
            for i, sign in ((0, 1), (1, -1)) if (len(row) > 3 if tableau.symmetric else key == "kick") else ():
                row[i] += sign * step
                if tableau.symmetric:
                    row[-1 - i] += sign * step
            rows[key] = tuple(map(str, row))
    forged = replace(tableau, **rows, label="forged")
    assert max(order_of(forged), nystrom_order_of(forged)) == 1 + tableau.symmetric


@pytest.mark.slow
def test_overview_has_row_and_declarations_of_each_method():
    header, rows = overview()
    assert [row[0] for row in rows] == list(integrators)
    for row in rows:
        cells, tableau = dict(zip(header, row, strict=True)), integrators[row[0]]
        assert cells["stages"] == tableau.stages
        assert cells["composition"] == {"drift": "ABA", "kick": "BAB"}[tableau.first]
        assert cells["order" if tableau.requires is None else "Nystrom order"] == tableau.order
        assert cells["guaranteed digits"] == tableau.digits
        negative = sum(text.startswith("-") for text in tableau.kick + tableau.drift)
        assert cells["negative coefficients"] == negative
        assert cells["sum of absolute values"] == pytest.approx(
            sum(abs(float(c)) for c in tableau.kick + tableau.drift)
        )
        assert len(cells["stability limit"].partition(".")[2]) == 12


def test_overview_can_be_asked_for_some_methods_in_order():
    header, rows = overview("babps9o7h", "ruth")
    assert [row[0] for row in rows] == ["babps9o7h", "ruth"]
    assert dict(zip(header, rows[1], strict=True))["first gap closes"] == "inf"


TABLEAU = """
import nearharmonic as nh
TABLEAU = nh.Tableau(
    name="mine", order={order}, first="kick", kick={kick}, drift=("0.5", "0.5"), digits=15, source="here", {more}
)
"""


@pytest.mark.parametrize(("order", "more"), [(4, ""), (3, ""), (3, 'requires="quadratic kinetic energy"')])
def test_users_tableau_of_lower_order_than_it_declares_is_refused(tmp_path, order, more):
    """Two leapfrogs are of order 2."""
    (tmp_path / "own.py").write_text(TABLEAU.format(order=order, kick=("0.25", "0.5", "0.25"), more=more))
    kind = "a quadratic kinetic energy" if more else "every separable H"
    words = f"the integrator 'mine' declares order {order}, and its coefficients, of 15 digits, have order 2 for {kind}"
    with pytest.raises(TableauError, match=f"own.py: {words}$"):
        load_tableaus(tmp_path / "own.py")
    with pytest.raises(TableauError, match=words):
        nh.integrate("sho", str(tmp_path / "own.py"), 0.1)


def test_users_tableau_of_order_that_it_declares_is_loaded(tmp_path):
    (tmp_path / "own.py").write_text(TABLEAU.format(order=2, kick=("0.25", "0.5", "0.25"), more=""))
    assert load_tableaus(tmp_path / "own.py")["mine"].order == 2
