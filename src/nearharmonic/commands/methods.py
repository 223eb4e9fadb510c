"""Commands on integrators and systems: export, list, new and verify-tableau."""

from __future__ import annotations

import argparse
import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nearharmonic.commands import Command
from nearharmonic.errors import bad_setting
from nearharmonic.exchange import TARGETS
from nearharmonic.output.table import Answer, printed

if TYPE_CHECKING:
    from nearharmonic.exchange.proof import Likeness, Order, Residual
    from nearharmonic.exchange.verdict import Verdict


# --- ``nearharmonic export``: coefficients of an integrator for another program, as data or as a running loop.


def export_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("integrator", help="name of an integrator, or FILE.py, or FILE.py:NAME")
    parser.add_argument("--to", required=True, metavar="TARGET", help=f"one of {', '.join(TARGETS)}")
    parser.add_argument(
        "--digits", help="significant digits (default: all in json and toml, the nearest doubles in code)"
    )


def export_answer(chosen: argparse.Namespace) -> Answer:
    """Return the text for the target."""
    from nearharmonic.engine.settings import one_of, whole_number
    from nearharmonic.exchange.files import export
    from nearharmonic.integrators import integrators

    to = one_of("to", chosen.to, TARGETS)
    digits = None if chosen.digits is None else whole_number(chosen.digits, "digits")
    tableau = integrators[chosen.integrator]
    text = export(tableau, to, digits)
    return Answer(header=["integrator", "to", "text"], rows=[[tableau.name, to, text]], text=text)


# --- ``nearharmonic list``: lists of the integrators, of two kinds of them, and of the systems.

LISTED = ("integrators", "modified_integrators", "implicit_integrators", "systems")


def list_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("kind", nargs="?", help=f"{', '.join(LISTED[:-1])} or {LISTED[-1]}; all if not given")


def list_answer(chosen: argparse.Namespace) -> Answer:
    """Return a row for each integrator or system, in the order of the registries."""
    from nearharmonic.engine.settings import one_of

    kinds = (LISTED[0], LISTED[-1]) if chosen.kind is None else (one_of("kind", chosen.kind, LISTED),)
    found = [described for kind in kinds for described in _described(kind)]
    names = dict.fromkeys(name for described in found for name in described if name != "source")
    header = [*(name for name in names if name != "kind" or len(kinds) > 1), "source"]
    return Answer(header=header, rows=[[described.get(name) for name in header] for described in found])


def _described(kind: str) -> list[dict[str, Any]]:
    """Return the facts of all members of one of :data:`LISTED`."""
    from nearharmonic import integrators
    from nearharmonic.systems import systems
    from nearharmonic.theory.order import harmonic_order

    if kind == "systems":
        return [
            {
                "kind": "system", "name": s.name, "label": s.label, "coordinates": s.dimension, "t_end": s.t_end,
                "unit of t": s.units["t"], "source": s.source,
            }
            for s in systems.values()
        ]  # fmt: skip
    chosen = integrators if kind == "integrators" else getattr(integrators, kind)
    return [
        {
            "kind": "implicit integrator" if t.implicit else "modified integrator" if t.modified else "integrator",
            "name": t.name, "label": t.label, "stages": t.stages, "gradients": 0 if t.implicit else t.gradients,
            "order": t.order, "harmonic order": harmonic_order(t), "first": "" if t.implicit else t.first,
            "source": f"{t.source}; requires a {t.requires}" if t.requires else t.source,
        }
        for t in chosen.values()
    ]  # fmt: skip


# --- ``nearharmonic new``: writes a commented Python file of a system or an integrator, which runs and can be edited.

KINDS = ("system", "integrator")
#: Templates of the files, with PLACEHOLDER in place of the name.
TEMPLATES = Path(__file__).parent / "templates"
PLACEHOLDER = "NAME"
#: Commands that run the file without changes.
EXAMPLES = {
    "system": "nearharmonic recommend {} --error 1e-6",
    "integrator": "nearharmonic recommend sho --error 1e-6 --methods {},ruth",
}


def new_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("kind", help=" or ".join(KINDS))
    parser.add_argument("name", metavar="NAME", help="its name: a letter, then letters, digits and _")
    parser.add_argument("-o", "--output", metavar="FILE.py", help="file to write (default NAME.py)")


def new_answer(chosen: argparse.Namespace) -> Answer:
    """Write the file, and return its path and a command that runs it."""
    from nearharmonic.engine.settings import one_of
    from nearharmonic.output.atomic import write_text

    kind = one_of("kind", chosen.kind, KINDS)
    place = _target(chosen.name, chosen.output)
    _check_name(kind, chosen.name, place)
    written = place.as_posix()
    text = (TEMPLATES / f"{kind}.py").read_text(encoding="utf-8")
    write_text(place, text.replace(f"{PLACEHOLDER}.py", written).replace(PLACEHOLDER, chosen.name))
    return Answer(header=["file"], rows=[[written]], notes=[f"Run it: {EXAMPLES[kind].format(written)}"])


def _target(name: str, output: str | None) -> Path:
    """Return the file to write: it is new, ends in ``.py``, and its path can be written in the text of the file."""
    place = Path(f"{name}.py" if output is None else output)
    key, value = ("NAME", name) if output is None else ("-o", output)
    if place.suffix != ".py" or not str(place).isprintable() or '"' in str(place):
        raise bad_setting(key, value, "a file with the ending .py, of printable letters other than quotes")
    if place.exists() or place.is_symlink():
        raise bad_setting(key, value, f"{place} exists already, and is not overwritten")
    return place


def _check_name(kind: str, name: str, place: Path) -> None:
    """Refuse a name that is not valid in Python and in a config, is registered, or hides a module of Python."""
    from nearharmonic.integrators import integrators
    from nearharmonic.systems import systems
    from nearharmonic_paper.config import check_name

    check_name(PLACEHOLDER, name)
    registered = {"system": systems.registered, "integrator": integrators.registered}[kind]
    if name in registered:
        raise bad_setting(PLACEHOLDER, name, f"a registered {kind} has this name: choose another")
    if _is_module(place.stem, place.parent.resolve()):
        key, value = (PLACEHOLDER, name) if place.stem == name else ("-o", str(place))
        allowed = f"scripts beside {place.name} would import it in place of the module {place.stem}: choose another"
        raise bad_setting(key, value, allowed)


def _is_module(name: str, folder: Path) -> bool:
    """Return True if ``import name`` finds a module outside ``folder``."""
    if name in sys.stdlib_module_names:
        return True
    found = importlib.util.find_spec(name) if name.isidentifier() else None
    own = {folder / f"{name}.py", folder / name / "__init__.py"}
    return found is not None and found.origin is not None and Path(found.origin).resolve() not in own


# --- ``nearharmonic verify-tableau``: proves or refutes the claims of files of coefficients.

CLAIM = ("claim", "holds", "proof")
_ORDERS = ("harmonic_order", "momentum_order", "energy_order", "phase_order")


def verify_arguments(parser: argparse.ArgumentParser) -> None:
    files = "a .json, .toml or .csv file with the rows kick and drift, and claims, or FILE.py of an integrator; "
    files += "several files are read before the first is verified"
    degree = "also prove the order for quadratic T and every polynomial V of degree K, such as 3 or 4"
    parser.add_argument("files", metavar="file", nargs="+", help=files)
    parser.add_argument("--degree", metavar="K", help=degree)


def verify_answer(chosen: argparse.Namespace) -> Answer:
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
        header=("file", *CLAIM),
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
        header=CLAIM,
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


COMMANDS = {
    "export": Command(
        "write an integrator for another program: as data, or as code with a loop that runs",
        export_arguments, export_answer,
    ),
    "list": Command("list the integrators or the systems", list_arguments, list_answer),
    "new": Command("write a commented file to fill in, of a system or an integrator", new_arguments, new_answer),
    "verify-tableau": Command(
        "prove what files of coefficients claim: sums, symmetry, orders, and which operator is first",
        verify_arguments, verify_answer,
    ),
}  # fmt: skip
