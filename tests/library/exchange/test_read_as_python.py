"""Exported programs read as Python where their compiler or library may be absent: their examples give our states."""

from __future__ import annotations

import re
from itertools import product
from textwrap import dedent

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.exchange.files import export
from support.projects.exported_programs import array, check, unwrapped

#: Kick first and drift first, with and without a harmonic order, and two that require a quadratic kinetic energy.
METHODS = pytest.mark.parametrize("name", ["leapfrog", "ruth", "babps8o7h", "abas5o6h", "srkn_b11", "srkn_a14"])
#: The few words of a language in which a program is written, as Python.
JULIA = (
    (r"!", ""), (r"^const ", ""), (r"\bRun: .*$", ""),
    (r"^function (.*)$", r"def \1:"),
    (r"^( +)(.*) && return", r"\1if \2: return"),
    (r"&&", "and"), (r"\^", "**"), (r"\b(\d)([a-z])", r"\1 * \2"),
    (r"for step in 1:steps, i in 1:stages", "for step, i in product(range(1, steps + 1), range(1, stages + 1)):"),
    (r"^( +if [^:\n]*)$", r"\1:"),
    (r"^ *end$", ""),
    (r"\blength\b", "len"),
    (r"(\w)\[([^]]+)\]", r"\1[\2 - 1]"),
    (r"(\w) \.\+= h \.\* (\w)$", r"\1[:] = [a + h * b for a, b in zip(\1, \2)]"),
)  # fmt: skip
FORTRAN = (
    (r"!.*$", ""), (r"^ *(?:procedure|real|integer).*::.*$", ""), (r"^ *end .*$", ""), (r"_real_kind", ""),
    (r"\bsubroutine (.*)$", r"def \1:"), (r"\bcall ", ""),
    (r"^( +)if \((.*)\) (return|c = .*)$", r"\1if \2: \3"), (r"\.and\.", "and"),
    (r"do (\w+) = (\w+), (.*)$", r"for \1 in range(\2, \3 + 1):"),
    (r"\b(c_\w+)\(([^)]+)\)", r"\1[\2]"), (r"\b([qp])\((\d)\)", r"\1[\2 - 1]"), (r"^( *)q = ", r"\1q[:] = "),
)  # fmt: skip

C = (
    (r"^.*\*(\w) = N_VGetArrayPointer\(z\)(?: \+ (\d))?;$", r"    \1 = z[\2:]"),
    (r"^.*\*rate = N_VGetArrayPointer\(zdot\);$", "    rate = zdot"),
    (r";$", ""),
)


def as_python(text, words):
    for theirs, ours in words:
        text = re.sub(theirs, ours, text, flags=re.MULTILINE)
    return text


@METHODS
def test_the_program_in_julia_gives_our_states(name):
    printed = []
    space = {"product": product, "join": lambda x, between: between.join(map(repr, x))}
    exec(as_python(export(nh.integrators[name], "julia"), JULIA), space | {"println": lambda *x: printed.append(x)})
    check(name, "\n".join("".join(words) for words in printed))


@METHODS
def test_the_program_in_fortran_gives_our_states(name):
    text = export(nh.integrators[name], "fortran")
    # Arrays begin with 0 and hold as many numbers as their bounds say.
    rows = {f"c_{key}": list(map(float, array(text, f"c_{key}"))) for key in ("kick", "drift")}
    ends = dict(re.findall(r"parameter :: (c_\w+)\(0:([^)]*)\) =", text))
    stages = int(re.search(r"parameter :: stages = (\d+)", text)[1])
    assert {key: eval(end, {"stages": stages}) + 1 for key, end in ends.items()} == {k: len(r) for k, r in rows.items()}
    space = rows | {"stages": stages}
    bodies = re.findall(r"^  subroutine (?!substep).*?^  end subroutine", text, flags=re.MULTILINE | re.DOTALL)
    for body in bodies:
        exec(dedent(as_python(body, FORTRAN)), space)
    main = re.search(r"^program example.*", text, flags=re.MULTILINE | re.DOTALL)[0]
    given = re.findall(r"([qp])\(2\) = \[(.*?)\]", as_python(main, FORTRAN[3:4]))
    space |= {key: np.array([float(x) for x in values.split(",")]) for key, values in given}
    exec(as_python(re.search(r"^  call (.*)$", main, flags=re.MULTILINE)[1], FORTRAN), space)
    shown = re.findall(r'"(. =)", (\w)', main)
    check(name, "\n".join(" ".join([label, *map(repr, map(float, space[key]))]) for label, key in shown))


@pytest.mark.slow
@METHODS
def test_the_table_of_sundials_gives_our_states(name):
    """As sprkStep_TakeStep: a stage kicks with ahat, then drifts with a; a table is of (stages, order, a, ahat)."""
    text = unwrapped(export(nh.integrators[name], "sundials"))
    stages, order, *rows = re.search(r"ARKodeSPRKTable_Create\((.*)\)", text)[1].split(", ")
    drifts, kicks = (list(map(float, array(text, row))) for row in rows)
    assert [int(stages), int(order)] == [len(kicks), nh.integrators[name].order]
    assert {re.search(rf" {row}\[(\d+)\]", text)[1] for row in rows} == {stages}
    rates = re.findall(r"^static int (force|velocity)\(.*?\n{\n(.*?)    return", text, flags=re.MULTILINE | re.DOTALL)
    bodies = {key: dedent(as_python(body, C)) for key, body in rates}
    first, second = re.search(r"SPRKStepCreate\((\w+), (\w+), 0, state", text).groups()
    z = np.full(4, np.nan)
    for line in re.findall(r"^    (z\[.*);", text, flags=re.MULTILINE):
        exec(line, {"z": z})
    steps = int(re.search(r"step < (\d+); step", text)[1])
    tau = float(re.search(r"ARKodeSetFixedStep\(arkode, (.*?)\)", text)[1])
    for _, stage in product(range(steps), zip(kicks, drifts, strict=True)):
        for key, c in zip((first, second), stage, strict=True):
            exec(bodies[key], {"z": z, "zdot": (rate := np.zeros(4))})
            z += c * tau * rate
    check(name, re.sub(r"z\[(\d)\]", lambda found: repr(float(z[int(found[1])])), "q = z[0] z[1]\np = z[2] z[3]"))
    assert re.findall(r"\(double\)(z\[\d\])", text) == ["z[0]", "z[1]", "z[2]", "z[3]"]
