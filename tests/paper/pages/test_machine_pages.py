"""docs/explanation: arithmetic.md, numba_core.md and results_and_digests.md, against the code that they describe."""

from __future__ import annotations

import random
import re
from fractions import Fraction
from hashlib import sha256
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.core import step
from nearharmonic.core.formulas import expression as size
from nearharmonic.core.formulas import tracing as rules
from nearharmonic.systems import gradients
from nearharmonic_paper.record import history
from nearharmonic_paper.tasks.provenance import NUMERICAL_LIBRARIES
from support.results.code_cells import executed
from support.results.formulas import formulas, right_sides
from support.results.stated_numbers import ROOT, flat, numbers, states

ARITHMETIC = "docs/explanation/arithmetic.md"
CORE = "docs/explanation/numba_core.md"
DIGESTS = "docs/explanation/results_and_digests.md"
#: Half a unit in the last place of 1.
U = 2.0**-53


def rounded(exact):
    """The double nearest to a fraction."""
    return Fraction(float(exact))


def test_compensated_sums_are_those_of_the_page():
    assert right_sides(ARITHMETIC, r"\delta") == [r"\mathrm{fl}(d f + \text{carry})"]
    assert right_sides(ARITHMETIC, "p'") == [r"\mathrm{fl}(p + \delta)"]
    assert right_sides(ARITHMETIC, r"\text{carry}'") == [r"\mathrm{fl}\bigl(\delta + \mathrm{fl}(p - p')\bigr)"]
    source = random.Random(1)
    p, carry = 1.0, 0.0
    for _ in range(1000):
        d, f = source.uniform(-1e-3, 1e-3), source.uniform(-1, 1)
        delta = rounded(Fraction(d) * Fraction(f) + Fraction(carry))
        total = rounded(Fraction(p) + delta)
        lost = rounded(delta + rounded(Fraction(p) - total))
        assert total + lost == Fraction(p) + delta  # the carry is exactly what the sum has lost
        found = step.compensated.py_func(p, carry, d, f)
        assert found == (total, lost)
        p, carry = found


def test_the_page_says_when_energies_are_in_double_double():
    (coordinates,) = re.findall(r"For systems of more than (\w+) coordinates", flat(ARITHMETIC))
    assert {"eight": 8}[coordinates] == rules.FEW_COORDINATES
    assert states(ARITHMETIC, [rules.CERTAINTY], "is below", "times that bound")
    assert formulas(ARITHMETIC)[0] == r"u = 2^{-53} \approx 1.1 \times 10^{-16}"
    assert float(f"{U:.1e}") == 1.1e-16


@pytest.mark.slow
def test_curves_of_three_arithmetics_are_as_the_caption_says():
    names = executed(ARITHMETIC)
    plain, compensated, extended = (
        names["curves"][name] for name in ("plain sums", "compensated sums", "double-double")
    )
    lowest, highest = numbers(flat(ARITHMETIC), r"Rounding leaves errors of (10⁻¹⁴) to (10⁻¹²) with plain sums")
    small = extended < lowest / 10
    assert small.sum() >= 4
    assert (lowest < plain[small]).all()
    assert (plain[small] < highest).all()
    (factor,) = numbers(flat(ARITHMETIC), r"at most (\d)u with compensated sums")
    below = extended < U / 2
    assert below.sum() >= 3
    assert compensated[below].max() <= factor * U
    assert compensated.min() < U / 2
    large = extended > 100 * highest
    assert np.allclose(plain[large], extended[large], rtol=1e-2, atol=0)
    assert np.allclose(compensated[large], extended[large], rtol=1e-2, atol=0)
    (axes,) = names["figure"].axes
    assert {line.get_label() for line in axes.lines} >= set(names["curves"])


def test_limits_of_formulas_are_those_of_the_page():
    assert states(CORE, [size.MOST_UNROLLED], "Formulas with more than", "coordinates")
    assert states(CORE, [size.MOST_OPERATIONS_UNROLLED], "Formulas with more than", "operations")
    assert states(CORE, [gradients.DIGITS], "is compared with V", "digits")


def test_a_move_ahead_is_a_kick_and_a_drift():
    q, p, k, e = (Fraction(n, 7) for n in (3, -5, 2, 4))
    f = q * 3
    kicked = p + k * f
    assert right_sides(CORE, "p'") == ["p + k f"]
    assert right_sides(CORE, "q'") == [r"\bigl(q + e\,v(p)\bigr) + (e\,k)\,a(f)"]
    assert (q + e * p) + (e * k) * f == q + e * kicked


WELL = """
import nearharmonic as nh


def V(q, k):
    return {V}


SYSTEM = nh.System(name="{name}", V=V, q0="1", p0="0.5", t_end=10, parameters={{"k": "{k}"}})
"""


@pytest.mark.slow
def test_only_new_instructions_make_a_new_kernel(tmp_path, monkeypatch):
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", str(tmp_path / "kernels"))

    def kernels_after(name, V, k="2", method="ruth"):
        path = tmp_path / f"{name}.py"
        path.write_text(WELL.format(name=name, V=V, k=k))
        nh.integrate(str(path), method, 0.1)
        return {file.name for file in Path(tmp_path, "kernels").glob("advance-*.kernel")}

    first = kernels_after("well", "k * q[0] ** 2 / 2 + q[0] ** 4 / 4")
    assert len(first) == 1
    assert kernels_after("other", "(k * q[0] ** 2) / 2 + q[0]**4 / 4  # the same", k="3") == first
    assert kernels_after("third", "k * q[0] ** 2 / 2 + q[0] ** 4 / 4", method="babps8o7h") == first
    assert len(kernels_after("fourth", "k * q[0] ** 2 / 2 + q[0] ** 4 / 3")) == 2
    assert "two systems with the same instructions share a kernel" in flat(CORE)


def test_libraries_in_digests_are_those_of_the_page():
    (row,) = re.findall(r"of the versions of (.*?) \|", flat(DIGESTS))
    assert tuple(re.split(r", | and ", row)) == NUMERICAL_LIBRARIES


def test_lines_of_a_history_hold_the_digest_before(tmp_path):
    (link,) = right_sides(DIGESTS, r"\text{before}_n")
    assert link == r"\mathrm{SHA256}(\text{line}_{n-1})"
    for run in ("a", "b", "c"):
        history.append(tmp_path, {"id": run, "start": "2026-01-01T00:00:00.000Z", "config": {}, "status": "ok"})
    place = tmp_path / history.HISTORY
    lines = place.read_bytes().splitlines()
    for before, line in pairwise(lines):
        assert f'"before": "{sha256(before).hexdigest()}"'.encode() in line
    place.write_bytes(b"\n".join([lines[0], lines[2], b""]))
    (fault,) = history.faulty_lines(history.lines_of(place))
    assert fault.number == 2


def test_every_page_is_in_the_list_and_has_sources():
    pages = {path.name for path in (ROOT / "docs/explanation").glob("*.md")} - {"index.md"}
    index = (ROOT / "docs/explanation/index.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^- \[(\S+\.md)\]\(\1\): ", index, re.MULTILINE)) == pages
    known = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "paper.bib").read_text(encoding="utf-8"), re.MULTILINE))
    for page in sorted(pages - {"processors.md"}):
        text = (ROOT / "docs/explanation" / page).read_text(encoding="utf-8")
        cited = {key for keys in re.findall(r"\{cite\}`([\w,]+)`", text) for key in keys.split(",")}
        assert cited, page
        assert cited <= known, page
        prose = re.sub(r"^---\n.*?\n---\n|```.*?```", "", text, flags=re.DOTALL)
        assert 400 <= len(prose.split()) <= 1000, page
