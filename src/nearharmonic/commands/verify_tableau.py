"""``nearharmonic verify-tableau``: proves or refutes the claims of files of coefficients."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from nearharmonic.errors import bad_setting
from nearharmonic.output.table import Answer, printed

if TYPE_CHECKING:
    from nearharmonic.exchange.proof import Likeness, Order, Residual
    from nearharmonic.exchange.verdict import Verdict

HELP = "prove what files of coefficients claim: sums, symmetry, orders, and which operator is first"
HEADER = ("claim", "holds", "proof")
_ORDERS = ("harmonic_order", "momentum_order", "energy_order", "phase_order")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument(
        "files",
        metavar="file",
        nargs="+",
        help="a .json, .toml or .csv file with the rows kick and drift, and claims, or FILE.py of an integrator; "
        "several files are read before the first is verified",
    )
    parser.add_argument(
        "--degree",
        metavar="K",
        help="also prove the order for quadratic T and every polynomial V of degree K, such as 3 or 4",
    )


def answer(chosen: argparse.Namespace) -> Answer:
    """Return a row for each claim of each file; the status is 1 if one does not hold."""
    from nearharmonic.exchange.files import read
    from nearharmonic.exchange.verdict import Verdict

    degree = None if chosen.degree is None else checked_degree(chosen.degree)
    # All are read first: a file that cannot be read ends the command before it has printed anything.
    found = [Verdict(file) for file in [read(place) for place in chosen.files]]
    answers = [_of(one, degree) for one in found]
    if len(answers) == 1:
        return answers[0]
    return Answer(
        header=("file", *HEADER),
        rows=[[one.file.path, *row] for one, of_file in zip(found, answers, strict=True) for row in of_file.rows],
        document=[of_file.document for of_file in answers],
        status=max(of_file.status for of_file in answers),
        text="\n".join(printed(of_file, "table") for of_file in answers),
    )


def checked_degree(text: str) -> int:
    """Return the degree of a potential, from 2."""
    if not text.isdecimal() or int(text) < 2:
        raise bad_setting("degree", text, "an integer from 2, the degree of a polynomial V")
    return int(text)


def _of(found: Verdict, degree: int | None) -> Answer:
    """Return the answer for one file."""
    failing, number = sum(not claim.holds for claim in found.claims), len(found.claims)
    verb = "does" if failing == 1 else "do"
    words = f"{failing} of {number} claims {verb} not hold" if failing else "all claims hold"
    return Answer(
        header=HEADER,
        rows=[list(claim) for claim in found.claims],
        document=_document(found, degree),
        status=1 if failing else 0,
        caption=f"{found.file.label}: {words}",
        notes=list(_notes(found, degree)),
    )


def _notes(found: Verdict, degree: int | None) -> Iterator[str]:
    order, quadratic, oscillator = found.order, found.quadratic_order, found.oscillator
    yield f"digits: {found.digits.number or 'exact'}, {found.digits.basis}"
    if found.digits_that_hold is not None:
        yield f"every claim holds to {found.digits_that_hold} digits"
    yield (
        f"order: {_shown(order)} for every separable H, {_shown(quadratic)} for quadratic T, "
        f"{oscillator.order} on the oscillator"
    )
    if degree is not None:
        yield f"order: {_shown(found.polynomial_order(degree))} for quadratic T and V of degree {degree}"
    if found.stability_limit is not None:
        yield (
            f"on the oscillator, {found.file.first} first: position {oscillator.harmonic_order} (harmonic order), "
            f"momentum {oscillator.momentum_order}, energy {oscillator.energy_order}, phase {oscillator.phase_order}"
        )
        yield f"stability limit: tau = {float(found.stability_limit):.12g}"
    yield f"symmetric: {'yes' if found.is_symmetric else 'no'}"
    yield f"nearest registered method: {_nearest(found.nearest)}"
    yield from (f"warning: {warning}" for warning in found.warnings)
    yield from (f"looks wrong: {suspect.says}" for suspect in found.suspects)


def _shown(order: Order) -> str:
    return f"{order.order}{' or more' if order.failing is None else ''}"


def _nearest(like: Likeness | None) -> str:
    if like is None:
        return "none has as many kicks and drifts"
    changes = [("its roles exchanged", like.exchanged), ("backwards", like.reversed), ("rescaled", like.rescaled)]
    changed = "".join(f", {text}" for text, applies in changes if applies)
    name = f"{like.tableau.label} ({like.tableau.name}){changed}"
    if like.is_same:
        return f"{name}: the same to all digits"
    differing = f"{len(like.differing)} of {like.compared} coefficients differ"
    return f"{name}: {differing}, by at most {float(like.distance):.2g}"


def _document(found: Verdict, degree: int | None) -> dict[str, Any]:
    file, oscillator, like = found.file, found.oscillator, found.nearest
    return {
        "file": file.path,
        **{name: getattr(file, name) for name in ("name", "label", "source", "first")},
        "kicks": len(file.kick),
        "drifts": len(file.drift),
        "digits": found.digits.number or None,
        "digits_basis": found.digits.basis,
        "digits_that_hold": found.digits_that_hold,
        "holds": all(claim.holds for claim in found.claims),
        "claims": [claim._asdict() for claim in found.claims],
        "excess_of_sums": {key: _residual(one) for key, one in found.sums.items()},
        "symmetric": found.is_symmetric,
        "order": _order(found.order),
        "quadratic_order": _order(found.quadratic_order),
        **(
            {} if degree is None else {"polynomial_order": {"degree": degree, **_order(found.polynomial_order(degree))}}
        ),
        "oscillator_order": oscillator.order,
        **{name: getattr(oscillator, name) for name in _ORDERS},
        "stability_limit": None if found.stability_limit is None else float(found.stability_limit),
        "nearest": None if like is None else _likeness(like),
        "warnings": found.warnings,
        "suspects": [{"says": says, **rows._asdict()} for says, rows in found.suspects],
    }


def _residual(one: Residual) -> dict[str, Any]:
    return {"degree": one.degree, "residual": float(one.value), "allowed": float(one.allowed)}


def _order(proved: Order) -> dict[str, Any]:
    """An order, the first condition that fails, and the largest residual of lower orders in units of the tolerance."""
    return {
        "order": proved.order,
        "failing": None if proved.failing is None else _residual(proved.failing),
        "largest_vanishing": _residual(proved.largest),
    }


def _likeness(like: Likeness) -> dict[str, Any]:
    return {
        "name": like.tableau.name,
        "same": like.is_same,
        "roles_exchanged": like.exchanged,
        "reversed": like.reversed,
        "rescaled": like.rescaled,
        "largest_difference": float(like.distance),
        "differing": [
            {"place": place, "here": float(here), "there": float(there)} for place, here, there in like.differing
        ],
    }
