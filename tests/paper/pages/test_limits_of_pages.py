"""Limits and defaults that pages of several subjects state, compared with the code that has them."""

from __future__ import annotations

import pytest
import yaml

from nearharmonic.core.formulas import expression as graph
from nearharmonic.core.formulas import expression as size
from nearharmonic.core.formulas import tracing as rules
from nearharmonic.numerics import clock
from nearharmonic.output.store import LARGEST_CHUNK
from nearharmonic.plotting.levels import COLUMNS
from nearharmonic.recommendation import own
from nearharmonic.systems.numba_potential import MOST_COORDINATES
from nearharmonic_paper.claims.judging.curves import MOST_JUDGED
from nearharmonic_paper.config.config import Config
from nearharmonic_paper.experiments.paper.grid import plan, shards
from nearharmonic_paper.experiments.paper.grid.reduced_run import SAMPLES
from nearharmonic_paper.report.plots import panels
from support.results.stated_numbers import ROOT, flat, states

PROFILE = yaml.safe_load((ROOT / "profiles/slurm/config.yaml").read_text(encoding="utf-8"))
(SECONDS,) = (float(one.partition("=")[2]) for one in PROFILE["config"])
TIMES = "docs/results/timings.md"
GRIDS, CLUSTER, LARGER = (f"docs/how_to/{name}.md" for name in ("large_grids", "cluster", "larger_systems"))
JOB = Config.__dataclass_fields__["job_seconds"].default


def memory(limit):
    """Megabytes of the first attempt."""
    return float(limit.removesuffix(" * attempt"))


def thousands(number):
    """A number as pages have it, with spaces between groups of three digits, read as numbers one by one."""
    return [float(group) for group in f"{number:,}".split(",")]


@pytest.mark.parametrize(
    ("page", "wanted", "words"),
    [
        (LARGER, [size.MOST_UNROLLED], ("are compiled without loops",)),
        (LARGER, [size.MOST_OPERATIONS_UNROLLED], ("are compiled without loops",)),
        (LARGER, [size.MOST_OPERATIONS], ("operations in total are refused",)),
        (LARGER, thousands(graph.MOST_NODES), ("operations in total are refused",)),
        ("docs/how_to/runs.md", [size.MOST_UNROLLED], ("Formulas of more than",)),
        ("docs/how_to/runs.md", [size.MOST_OPERATIONS_UNROLLED], ("Formulas of more than",)),
        ("docs/how_to/runs.md", [rules.CERTAINTY], ("times that bound", "evaluated again")),
        ("docs/how_to/own_systems.md", [MOST_COORDINATES], ("At most", "coordinates.")),
        (GRIDS, [JOB], ("s on one computer", "in the profile")),
        (GRIDS, [SECONDS], ("s on one computer", "in the profile")),
        (GRIDS, [SAMPLES], ("numbers are those of", "samples")),
        (GRIDS, [4 * COLUMNS], ("show of a curve",)),
        (GRIDS, [COLUMNS], ("of each of", "columns")),
        (GRIDS, [panels.COLUMNS], ("of each of", "on the page")),
        (GRIDS, [MOST_JUDGED], ("Statements of the paper are judged",)),
        (GRIDS, [LARGEST_CHUNK / 2**20], ("Chunks of a cube", "MiB")),
        (GRIDS, thousands(plan.MOST_POINTS), ("A method has at most",)),
        (GRIDS, [plan.MOST_EVALUATIONS], ("A method has at most", "evaluations")),
        (TIMES, [clock.STANDARD.longest], ("interleaved on one core", "at least three times", "twice")),
        (TIMES, [own.FEWEST_MEMBERS], ("members, with", "time per member")),
        (TIMES, [own.MOST_MEMBERS], ("members, with", "time per member")),
        (CLUSTER, [SECONDS, JOB], ("The profile asks for jobs",)),
        (CLUSTER, [memory(PROFILE["default-resources"]["mem_mb"])], ("limit of memory",)),
        (CLUSTER, [memory(PROFILE["set-resources"]["integrate"]["mem_mb"]) / 1000], ("limit of memory", "`integrate`")),
        (CLUSTER, [shards.MOST_BYTES], ("limit of memory", "shards have at most")),
        (CLUSTER, [PROFILE["nearharmonic-init-seconds-before-status-checks"]], ("MinJobAge",)),
    ],
)
def test_limits_on_pages_are_those_of_the_code(page, wanted, words):
    assert states(page, wanted, *words)


def test_the_words_for_times_of_calls_are_the_settings():
    assert clock.STANDARD.least == 3
    assert own.ENSEMBLE_EVALUATIONS == 2**25
    assert "with 2²⁵ evaluations of the force in total" in flat(TIMES)


def test_the_profile_tries_jobs_as_often_as_stated():
    assert f"(`retries: {PROFILE['retries']}`)" in flat(CLUSTER)
