"""docs/claims.json: the pages are made from it, and some of its numbers are computed again in another way."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from math import inf
from pathlib import Path

import numpy as np
import pytest
from mpmath import mp, mpf

import nearharmonic as nh
from nearharmonic.claims.documents import page, verdict_table, write_documents
from nearharmonic.claims.table import CLAIMS, KEYS
from workflow_project import Project

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs/claims.json").read_text(encoding="utf-8")
ENTRIES = json.loads(TEXT)
BY_ID = {entry["id"]: entry for entry in ENTRIES}
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


def numbers(name, pattern):
    """The numbers that ``pattern`` finds once in the value of a statement."""
    (found,) = re.findall(pattern, BY_ID[name]["value"])
    words = [found] if isinstance(found, str) else found
    return [float(re.sub(r" × 10([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)", lambda m: "e" + m[1].translate(SUPERSCRIPTS), w)) for w in words]


def test_readme_has_the_table_of_the_committed_verdicts():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert verdict_table(ENTRIES) in readme


def test_the_page_is_that_of_the_committed_verdicts():
    assert (ROOT / "docs/claims.md").read_text(encoding="utf-8") == page(ENTRIES)


def test_writing_the_pages_again_changes_nothing(tmp_path):
    (tmp_path / "docs").mkdir()
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    damaged = re.sub(r"\*\*holds\*\*", "**fails**", readme)
    assert damaged != readme
    (tmp_path / "README.md").write_text(damaged, encoding="utf-8")
    write_documents(ROOT / "docs/claims.json", tmp_path)
    for name in ("README.md", "docs/claims.md", "docs/claims.json"):
        assert (tmp_path / name).read_bytes() == (ROOT / name).read_bytes(), name


def test_the_committed_verdicts_are_of_the_statements_in_the_code():
    for entry, one in zip(ENTRIES, CLAIMS, strict=True):
        assert tuple(entry) == KEYS
        assert (one.id, one.paper, one.statement, one.threshold) == tuple(
            entry[key] for key in ("id", "paper", "statement", "threshold")
        )
        assert list(one.needs) == entry["needs"]


def test_everything_that_can_be_decided_is():
    assert [entry["id"] for entry in ENTRIES if entry["verdict"] == "not decided here"] == []


def test_the_changelog_counts_the_statements():
    (stated,) = re.findall(
        r"paper that numbers decide, (\d+) of them", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    )
    assert int(stated) == len(ENTRIES)


def test_the_first_sentence_of_readme_promises_what_was_measured():
    """Whole decades of the best gain over Ruth's method on the near-harmonic system, Hénon-Heiles."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (gain,) = numbers("outperform-ruth-henon-heiles", r"of the best up to (.*)$")
    word = {3: "three", 4: "four", 5: "five"}[int(np.log10(gain))]
    assert f"up to {word} decades better than Ruth's method" in readme


def test_the_known_errata_fail():
    failing = {entry["id"] for entry in ENTRIES if entry["verdict"] == "fails"}
    assert {
        "c-n-below-eq-6", "table-3-inner-limit", "table-4-c3", "table-4-columns", "listed-stages-babps8o7h",
        "s5odr4-of-kahan-and-li", "figure-of-the-precession",
    } <= failing  # fmt: skip


def closed_form_error(name, tau_per_stage):
    """|K21/K12 + 1| of a method's step matrix on the oscillator, multiplied out shear by shear."""
    tableau = nh.integrators[name]
    outer, inner = (tableau.kick, tableau.drift) if tableau.first == "kick" else (tableau.drift, tableau.kick)
    tau = mpf(tau_per_stage) * len(inner)
    step, drifts = mp.eye(2), tableau.first == "drift"
    for i in range(2 * len(inner) + 1):
        c = mpf(outer[i // 2] if i % 2 == 0 else inner[i // 2])
        shear = mp.matrix([[1, tau * c], [0, 1]]) if drifts == (i % 2 == 0) else mp.matrix([[1, 0], [-tau * c, 1]])
        step = shear * step
    return float(abs(step[1, 0] / step[0, 1] + 1))


@pytest.mark.parametrize("statement", ["fig-1-sixth-order", "fig-1-fourth-order", "fig-1-yoshida"])
def test_orders_on_the_oscillator_are_those_of_the_closed_form(statement):
    for name, value, interval in re.findall(r"(\w+) (\d\.\d+) ± (\d\.\d+)", BY_ID[statement]["value"]):
        x = [1e-4, 2e-4]
        exact = np.log2(closed_form_error(name, x[1]) / closed_form_error(name, x[0]))
        # Toward zero step size, where the next term of the error is gone: it bends the fitted slopes by up to 0.05.
        assert exact == pytest.approx(round(exact), abs=1e-4)
        assert float(value) == pytest.approx(exact, abs=float(interval) + 0.05)


def test_the_gain_over_ruth_on_the_oscillator_is_that_of_the_closed_form():
    low, high = numbers("outperform-ruth-sho", r"step sizes of τ/s = (\S+) to ([\d.]+);")
    least, most, best = numbers("outperform-ruth-sho", r"least of the four (.*?) to (.*?), of the best up to (.*)")
    # Forty a decade from 1e-4 on. A run of a few steps does not meet the largest error of the closed form.
    grid = [x for x in 10.0 ** np.arange(-4, 0.001, 1 / 40) if low * 0.999 < x < 0.1]
    ruth = np.array([closed_form_error("ruth", x) for x in grid])
    new = np.array(
        [[closed_form_error(n, x) for x in grid] for n in ("abas5o6h", "babs7o7h", "babps8o7h", "babps9o7h")]
    )
    assert most == pytest.approx((ruth / new.max(axis=0)).max(), rel=0.1)
    assert best == pytest.approx((ruth / new.min(axis=0)).max(), rel=0.1)
    assert high < 1
    assert least < 100


def test_the_best_methods_on_kepler_win_inside_the_stated_range_and_lose_outside():
    names = ("yoshida_s7o6a", "aba104", "babps9o7h", "abas5o6h", "babps8o7h")
    for statement, ours, variable in (
        ("fig-5-best-maximum", "aba104", "max_energy_error"), ("fig-5-best-mean", "babps9o7h", "mean_energy_error"),
    ):  # fmt: skip
        low, high = numbers(statement, r"^τ/s = (\S+) to (\S+) h, in one piece")
        for tau_per_stage, wins in ((low * 1.02, True), (2 * low, True), (high * 0.98, True), (low * 0.7, False)):
            found = {}
            for name in names:
                run = nh.sweep("kepler", name, [tau_per_stage * nh.integrators[name].stages])
                found[name] = float(run[variable][0])
            assert (min(found, key=found.__getitem__) == ours) is wins, (statement, tau_per_stage)


def test_the_coincidence_of_the_advances_is_that_of_runs_at_240_evaluations():
    stated = numbers("fig-4-coincide", r"orbit abas5o6h (\S+), aba104 (\S+), babps8o7h (\S+) × 10⁻⁶ rad")
    kepler = nh.systems["kepler"]
    start = [tuple(map(float, row)) for row in (kepler.q0, kepler.p0)]
    period = kepler.period(*start, float(kepler.parameters["GM"].value))
    for name, advance in zip(("abas5o6h", "aba104", "babps8o7h"), stated, strict=True):
        run = nh.integrate(kepler, name, tau=period / 240 * nh.integrators[name].stages)
        angle = np.unwrap(run.perihelion_angle.values.squeeze())
        rate = np.polyfit(run.t.values.squeeze() / period, angle, 1)[0]
        # The intervals of the fits are 0.2 to 0.3 %.
        assert abs(rate) == pytest.approx(advance * 1e-6, rel=3e-3)


def test_yoshidas_run_on_henon_heiles_leaves_at_the_stated_iteration():
    """Figure 6 (C) stepped here: a drift first, tau = 2, from y = p_y = 0.4 with x at rest."""
    tableau = nh.integrators["yoshida_s7o6a"]
    (stated,) = numbers("fig-6-c-unstable", r"at iteration (\d+)$")
    y, p, left = 0.4, 0.4, 0
    energy = lambda y, p: p * p / 2 + y * y / 2 - y**3 / 3  # noqa: E731
    first = energy(y, p)
    for iteration in range(1, 1000):
        for drift, kick in zip(tableau.drift, (*tableau.kick, "0"), strict=True):
            y += 2 * float(drift) * p
            p -= 2 * float(kick) * (y - y * y)
        error = abs(energy(y, p) - first) / first
        if not error <= 1.0 or error == inf:
            left = iteration
            break
    assert left == stated


def test_the_largest_term_of_yoshida_is_that_of_its_step_matrix():
    (stated,) = numbers("fig-2-yoshida-diverges", r"^(.*?) against")
    q, p = [mpf(1)] + [mpf(0)] * 15, [mpf(-1)] + [mpf(0)] * 15
    tableau = nh.integrators["yoshida_s7o6a"]
    for drift, kick in zip(tableau.drift, (*tableau.kick, "0"), strict=True):
        q = [q[0], *(a + mpf(drift) * b for a, b in zip(q[1:], p, strict=False))]
        p = [p[0], *(b - mpf(kick) * a for b, a in zip(p[1:], q, strict=False))]
    terms = [abs((1, -1, -1, 1)[n % 4] - mp.factorial(n) * q[n]) for n in range(1, 16)]
    assert float(max(terms)) == pytest.approx(stated, rel=5e-3)  # three digits are stated


@pytest.mark.slow
def test_the_committed_verdicts_are_those_of_a_run(tmp_path):
    """The default run and the targets that statements need, on the paper's config; a few minutes."""
    project = Project(tmp_path)
    assert project.snakemake("all", "derive", "stability", "-j2").returncode == 0
    done = project.snakemake("results/paper/tables/claims.json", "--force", "-j2")
    assert done.returncode == 0, done.stdout
    assert (tmp_path / "results/paper/tables/claims.json").read_text(encoding="utf-8") == TEXT


def test_the_pages_are_written_by_a_command(tmp_path):
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_bytes((ROOT / "README.md").read_bytes())
    done = subprocess.run(
        [sys.executable, "-m", "nearharmonic.claims.documents", str(ROOT / "docs/claims.json")],
        cwd=tmp_path, capture_output=True, text=True, check=False, env={"PYTHONPATH": str(ROOT / "src")},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "docs/claims.json").read_text(encoding="utf-8") == TEXT
