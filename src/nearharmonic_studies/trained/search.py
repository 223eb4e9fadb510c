"""Search for the method of one purpose, and the modules that register the methods found."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from hashlib import sha256
from inspect import getfile
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.table import Table, progress
from nearharmonic.theory.order import generalised_order_of, harmonic_order, nystrom_order_of, order_of
from nearharmonic.theory.oscillator import stability_limit
from nearharmonic.training.family import TRAINED_EXACT, Family, palindrome_lines, published
from nearharmonic.training.objective import DIGITS, Ensemble, Objective, mean_errors, tableau_of
from nearharmonic.training.search import Found, Searcher, search, starts_in
from nearharmonic_studies.trained.settings import PURPOSES, Purpose, SearchSettings

# --- Search for the method of one purpose: families one after another, selection on a validation set, all digits.

SOURCE = "trained by nearharmonic_studies.trained"
CAPTION = (
    "{title}: families searched for {what}, tau/s {low:.3g} to {high:.3g}, {problems}. The objective is the mean log10 "
    "of the largest energy error relative to the best published method: its maximum over the window plus half of its "
    "mean. Gains are in decades, on other problems and intervals twice as long, smallest in the window and mean."
)
#: Number of methods of each family that are compared on the validation set.
SHORT_LIST = 3
#: Ratio of the intervals of validation and test to the intervals of training.
LONGER = 2.0
#: A method of the short list: its objective on the validation set, and its search result.
Candidate = tuple[float, Found]


def train(purpose: str, settings: SearchSettings, known: Sequence[str], before: Sequence[str] = ()) -> dict[str, Any]:
    """Search for the method of a purpose.

    Starts are the ``known`` methods, of which the published ones are the reference, and the methods of other purposes,
    from the paths of their documents ``before``.

    The result has ``document`` with the method, for a TOML file, and ``landscape``, a :class:`Table` of the families.
    """
    goal = PURPOSES[purpose]
    begun = [*(_method(Path(place)) for place in before), *map(integrators.__getitem__, known)]
    references = published(map(integrators.__getitem__, known))
    training, validation, test = (
        _Judge(goal, settings, references, which, longer) for which, longer in enumerate((1.0, LONGER, LONGER))
    )
    all_findings = _all_findings(goal, settings, training, begun)
    short = [one for findings in all_findings for one in _short_list(findings, validation)]
    _, best = min(short, key=itemgetter(0))
    rows = [_row(findings, short, test) for findings in all_findings]
    low, high = goal.window
    caption = CAPTION.format(title=goal.title, what=goal.what, low=low, high=high, problems=goal.problems)
    return {
        "document": _document(goal, settings, best, test),
        "landscape": Table(header=[*rows[0]], rows=[[*row.values()] for row in rows], caption=caption),
    }


def _all_findings(
    goal: Purpose,
    settings: SearchSettings,
    training: _Judge,
    begun: Sequence[Tableau],
) -> list[Searcher]:
    """Return the findings of each family, each chain from its first."""
    effort = goal.effort(settings.trials, settings.random, settings.refinements)
    found: list[Searcher] = []
    for chain in goal.chains:
        before: list[Searcher] = []
        for family in chain.families():
            starts = starts_in(family, begun, [one.best for one in before if one.found], effort)
            before.append(search(training.objective(family, effort.population), starts, effort, settings.seed))
            if not before[-1].found:  # no published method has its shape, and there are no random starts
                continue
            best = before[-1].best
            progress(
                f"{goal.title}: {family.stages} stages, {family.first} first: objective {best.value:.3f} from "
                f"{best.origin}, {before[-1].again} of {len(before[-1].found)} searches ended there"
            )
        found += [one for one in before if one.found]
    if not found:
        raise bad_setting("trained.search.random", settings.random, "at least 1, as no published method is a start")
    return found


class _Judge:
    """The objective on a set, 0 training, 1 validation or 2 test, with intervals ``longer`` by a factor."""

    def __init__(
        self, goal: Purpose, settings: SearchSettings, published: Sequence[Tableau], which: int, longer: float
    ) -> None:
        count = settings.held_out if which else settings.systems
        self._goal = goal
        self.ensembles: list[Ensemble] = goal.ensembles(count, 3 * settings.seed + which, longer)
        self.references = [
            mean_errors(one, published, goal.tau_per_stage, goal.charge).min(axis=0) for one in self.ensembles
        ]

    def objective(self, family: Family, size: int = 1) -> Objective:
        """The objective of a family."""
        return Objective(
            family, self.ensembles, self._goal.tau_per_stage, self.references, size=size, charge=self._goal.charge,
        )  # fmt: skip

    def gains(self, found: Found) -> Any:
        """Gains in decades (T,), the mean over the ensembles."""
        return self.objective(found.family).gains(found.unknowns[None])[:, 0].mean(axis=0)


def _method(place: Path) -> Tableau:
    """Return the method of a document, at least in double precision."""
    found = tomllib.loads(place.read_text(encoding="utf-8"))
    rows: dict[str, Any] = {name: tuple(found[name]) for name in ("kick", "drift")}
    about = {name: found[name] for name in ("name", "first", "order", "digits")}
    return Tableau(**about, **rows, source=SOURCE)


def _short_list(findings: Searcher, validation: _Judge) -> list[Candidate]:
    """Return the best methods of a family, with objectives on the validation set."""
    ranked = sorted(findings.found, key=lambda one: one.value)[:SHORT_LIST]
    objective = validation.objective(findings.best.family, SHORT_LIST)
    values = objective(np.stack([one.unknowns for one in ranked])).tolist()
    return list(zip(values, ranked, strict=True))


def _row(findings: Searcher, short: Sequence[Candidate], test: _Judge) -> dict[str, Any]:
    family, best = findings.best.family, findings.best
    validation, own = min((one for one in short if one[1].family == family), key=itemgetter(0))
    gains = test.gains(own)
    return {
        "composition": "BAB" if family.first == "kick" else "ABA", "stages": family.stages,
        "order for quadratic T": family.order, "harmonic order": family.harmonic_order,
        "squares": " ".join(map(str, family.squares)), "searches": len(findings.found),
        "methods tried": findings.trials, "ended at the best": findings.again, "best from": best.origin,
        "objective": best.value, "validation": validation, "least gain": float(gains.min()),
        "mean gain": float(gains.mean()),
    }  # fmt: skip


def _document(goal: Purpose, settings: SearchSettings, best: Found, test: _Judge) -> Mapping[str, Any]:
    """Return the method with all digits, its proved properties, and its search."""
    tableau = tableau_of(best.family, best.unknowns.tolist(), name=goal.title, source=SOURCE)
    gains = test.gains(best)
    squares = {"square": list(tableau.square)} if tableau.modified else {}
    return {
        "name": tableau.name,
        "first": tableau.first,
        "kick": list(tableau.kick),
        "drift": list(tableau.drift),
        **squares,
        "digits": DIGITS,
        "family_order": best.family.order,
        **({"potential_degree": best.family.potential_degree} if best.family.potential_degree else {}),
        "order": order_of(tableau),
        "order_for_quadratic_T": nystrom_order_of(tableau),
        **({} if tableau.modified else {"harmonic_order": harmonic_order(tableau)}),
        **({"generalised_order": list(generalised_order_of(tableau))} if best.family.generalised_order else {}),
        **({} if tableau.modified else {"stability_limit": float(stability_limit(tableau))}),
        "sum_of_absolute_values": sum(abs(float(c)) for c in (*tableau.kick, *tableau.drift)),
        "purpose": goal.what,
        "window": list(goal.window),
        "ensemble": goal.problems,
        "seed": settings.seed,
        "origin": best.origin,
        "tau_per_stage": list(goal.tau_per_stage),
        "gain": gains.tolist(),
        "digest": _digest(goal, settings, tableau),
    }


def _digest(goal: Purpose, settings: SearchSettings, tableau: Tableau) -> str:
    """Return the SHA-256, in hex, of the settings of the search and of its result in doubles."""
    rows = [[float(c) for c in row] for row in (tableau.kick, tableau.drift)]
    asked = {"purpose": asdict(goal), "settings": asdict(settings), "rows": rows}
    return sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()


# --- Generator of the modules that register trained methods, from the results of their searches.

#: Line after which the methods of a module stand, and maximum length of a line for formatters.
BEGIN, LONGEST = "TABLEAUS = (", 120


def register(documents: Sequence[str]) -> dict[str, str]:
    """Return the texts of ``module``, ``exact_module`` and ``polynomial_module``, from the TOML files of searches."""
    methods = [tomllib.loads(Path(place).read_text(encoding="utf-8")) for place in documents]
    exact = [one for one in methods if one["name"].startswith(TRAINED_EXACT)]
    polynomial = [one for one in methods if one not in exact and "potential_degree" in one]
    others = [one for one in methods if one not in exact and one not in polynomial]
    return {
        "module": _module("trained", others),
        "exact_module": _module("trained_exact", exact),
        "polynomial_module": _module("trained_polynomial", polynomial),
    }


def _module(name: str, methods: Sequence[Mapping[str, Any]]) -> str:
    """Return the text of a module of integrators with these methods, and with the head of the present module."""
    names = [*(["QUADRATIC_KINETIC_ENERGY"] if any(map(_needs_requirement, methods)) else []), "Tableau", "palindrome"]
    present = Path(getfile(Tableau)).with_name(f"{name}.py").read_text(encoding="utf-8")
    head = present[: present.index(BEGIN) + len(BEGIN)]
    lines = [re.sub(r"(?<=import ).*palindrome$", ", ".join(names), head, count=1, flags=re.MULTILINE)]
    for one in methods:
        lines += ["    Tableau(", *(f"        {line}" for line in _fields(one)), "    ),"]
    return "\n".join([*lines, ")", ""])


def _order(one: Mapping[str, Any]) -> int:
    """Return the order for quadratic T and any V."""
    return int(one["order_for_quadratic_T"] if "potential_degree" in one else one["family_order"])


def _needs_requirement(one: Mapping[str, Any]) -> bool:
    """Return True if a method needs a quadratic T but has no squares that imply it."""
    return _order(one) > 4 and "square" not in one


def _fields(one: Mapping[str, Any]) -> list[str]:
    lines = [
        f'name="{one["name"]}",', f'label="{one["name"].replace("_", " ")}",', f"order={_order(one)},",
        f'first="{one["first"]}",',
    ]  # fmt: skip
    for row in ("kick", "square", "drift"):
        if row in one:
            lines += palindrome_lines(row, one[row], "")
    lines += ["source=SOURCE,", f"digits={one['digits']},"]
    if _needs_requirement(one):
        lines.append("requires=QUADRATIC_KINETIC_ENERGY,")
    if "generalised_order" in one:
        lines.append(f"generalised_order=({', '.join(map(str, one['generalised_order']))}),")
    return [*lines, *_note(one)]


def _note(one: Mapping[str, Any]) -> list[str]:
    low, high = one["window"]
    parts = [f"{one['purpose']}: tau/s {low:.3g} to {high:.3g}; ", f"{one['ensemble']}; "]
    if "potential_degree" in one:
        parts.append(f"order {one['family_order']} for V of degree {one['potential_degree']}; ")
    if "stability_limit" in one:
        parts.append(f"stability limit tau = {one['stability_limit']:.4f}; ")
    parts.append(f"seed {one['seed']}; run {one['digest'][:16]}")
    lines: list[str] = []
    line = ""
    for part in parts:
        if len(line) + len(part) > LONGEST - 20:
            lines, line = [*lines, line], ""
        line += part
    return ["note=(", *(f'    "{text}"' for text in [*lines, line]), "),"]
