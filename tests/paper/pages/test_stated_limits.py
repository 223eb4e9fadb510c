"""Limits, settings and defaults that pages state, compared with the code that has them."""

from __future__ import annotations

from inspect import signature

import pytest
import yaml

from nearharmonic.cli import main
from nearharmonic.core.formulas import expression as graph
from nearharmonic.core.formulas import expression as size
from nearharmonic.core.formulas import tracing as rules
from nearharmonic.numerics import clock
from nearharmonic.output.store import LARGEST_CHUNK
from nearharmonic.plotting.levels import COLUMNS
from nearharmonic.recommendation import own
from nearharmonic.recommendation.question import question
from nearharmonic.systems.numba_potential import MOST_COORDINATES
from nearharmonic.training import question as starts
from nearharmonic.training import question as tailor
from nearharmonic.training.objective import DIGITS, LARGEST_SUM, NEAREST
from nearharmonic.training.search import SAMPLES as SURFACE
from nearharmonic.training.search import Effort
from nearharmonic_paper.claims.judging.curves import MOST_JUDGED
from nearharmonic_paper.config.config import Config
from nearharmonic_paper.experiments.derivation.run import derive
from nearharmonic_paper.experiments.derivation.search.simplex import Simplex
from nearharmonic_paper.experiments.paper.grid import plan, shards
from nearharmonic_paper.experiments.paper.grid.reduced_run import SAMPLES
from nearharmonic_paper.experiments.stability.henon_heiles.reductions import TOLERATED
from nearharmonic_paper.experiments.stability.kinetic_energy.reductions import COMPARED_AT
from nearharmonic_paper.experiments.stability.settings import EnsembleSettings
from nearharmonic_paper.report.plots import panels
from nearharmonic_studies.trained.comparison.resampling import CONFIDENCE
from nearharmonic_studies.trained.ideas.oscillators import STRONGEST, WEAKEST
from nearharmonic_studies.trained.long_runs.run import BACK, FINE, STARTS, TAU_PER_STAGE
from nearharmonic_studies.trained.problems.purpose import (
    CHARGE,
    CHARGE_OF_ORBITS,
    ECCENTRICITIES,
    MODERATE,
    SMALL,
    STRONG,
    WEAK,
)
from nearharmonic_studies.trained.problems.random_potentials import FREQUENCIES
from nearharmonic_studies.trained.proof.settings import ProofSettings
from nearharmonic_studies.trained.settings import SearchSettings
from support.results.stated_numbers import ROOT, flat, states

PROFILE = yaml.safe_load((ROOT / "profiles/slurm/config.yaml").read_text(encoding="utf-8"))
(SECONDS,) = (float(one.partition("=")[2]) for one in PROFILE["config"])
GRIDS, CLUSTER, LARGER, TIMES, TRAINED, TRAINING, STABILITY, DERIVATION = (
    f"docs/{name}.md" for name in ("how_to/large_grids", "how_to/cluster", "how_to/larger_systems", "results/timings",
                                   "results/trained", "results/training", "results/stability", "results/derivation")
)  # fmt: skip
JOB = Config.__dataclass_fields__["job_seconds"].default
PROOF, SEARCH, EFFORT, ENSEMBLES = ProofSettings(), SearchSettings(), Effort(trials=1), EnsembleSettings()


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
        ("docs/how_to/runs.md", [rules.CERTAINTY], ("times that bound", "evaluated again")),
        ("docs/how_to/own_systems.md", [MOST_COORDINATES], ("At most", "coordinates.")),
        ("docs/start/choosing.md", [question("sho", 1e-3).budget // 1000, 0.0], ("exit status is 1", "evaluations")),
        (GRIDS, [JOB], ("s on one computer", "in the profile")),
        (GRIDS, [SAMPLES], ("numbers are those of", "samples")),
        (GRIDS, [4 * COLUMNS], ("show of a curve",)),
        (GRIDS, [panels.COLUMNS], ("of each of", "on the page")),
        (GRIDS, [MOST_JUDGED], ("Statements of the paper are judged",)),
        (GRIDS, [LARGEST_CHUNK / 2**20], ("Chunks of a cube", "MiB")),
        (GRIDS, thousands(plan.MOST_POINTS), ("A method has at most",)),
        (GRIDS, [plan.MOST_EVALUATIONS], ("A method has at most", "evaluations")),
        (TIMES, [clock.STANDARD.longest], ("interleaved on one core", "at least three times", "twice")),
        (TIMES, [own.FEWEST_MEMBERS], ("members, with", "time per member")),
        (TIMES, [own.MOST_MEMBERS], ("members, with", "time per member")),
        (CLUSTER, [PROFILE["latency-wait"]], ("waits up to", "latency-wait")),
        (CLUSTER, [SECONDS, JOB], ("The profile asks for jobs",)),
        (CLUSTER, [memory(PROFILE["default-resources"]["mem_mb"])], ("limit of memory",)),
        (CLUSTER, [memory(PROFILE["set-resources"]["integrate"]["mem_mb"]) / 1000], ("limit of memory", "`integrate`")),
        (CLUSTER, [shards.MOST_BYTES], ("limit of memory", "shards have at most")),
        (CLUSTER, [PROFILE["slurm-init-seconds-before-status-checks"]], ("MinJobAge",)),
        (STABILITY, [ENSEMBLES.trajectories], ("trajectories on each of four energy surfaces",)),
        (STABILITY, [100 * TOLERATED], ("grey where more than",)),
        (STABILITY, [COMPARED_AT], ("on a relativistic oscillator",)),
        (DERIVATION, [signature(derive).parameters["digits"].default], ("refined to", "Krawczyk")),
        (DERIVATION, [Simplex().bits], ("adaptive simplex",)),
        (TRAINED, [float(PROOF.t_end)], ("radians of the fastest", "runs cover")),
        (TRAINED, [100 * CONFIDENCE], ("by resampling the problems",)),
        (TRAINED, [CHARGE], ("charged for their gradients", "most systems")),
        (TRAINED, [CHARGE_OF_ORBITS], ("charged for their gradients", "Kepler orbits")),
        (TRAINED, [WEAKEST, STRONGEST], ("except for strengths from",)),
        (TRAINED, [PROOF.steps, TAU_PER_STAGE, STARTS], ("The runs have", "starts each")),
        (TRAINED, [float(PROOF.steps * BACK)], ("The way back", "steps forwards and backwards")),
        (TRAINED, [FINE], ("in double-double with the same coefficients",)),
        (TRAINING, FREQUENCIES, ("frequency 1 and the others",)),
        (TRAINING, STRONG, ("log-uniform",)),
        (TRAINING, WEAK, ("`trained_weak`", "log-uniform")),
        (TRAINING, [*SMALL, *MODERATE], ("coordinates whose strength is",)),
        (TRAINING, [SURFACE], ("The derivatives of", "along the surface")),
        (TRAINING, ECCENTRICITIES, ("Kepler orbits of eccentricity",)),
        (TRAINING, [SEARCH.systems, SEARCH.held_out, SEARCH.held_out], ("problems for training", "for the gains")),
        (TRAINING, [EFFORT.population], ("methods of a generation",)),
        (TRAINING, [DIGITS], ("onto the exact equations", "digits")),
        (TRAINING, [NEAREST], ("onto the exact equations", "by less than")),
        (TRAINING, [EFFORT.same_value, EFFORT.same_unknowns], ("number of searches", "within")),
        (TRAINING, [LARGEST_SUM], ("keeps this sum below",)),
    ],
)  # fmt: skip
def test_limits_and_settings_on_pages_are_those_of_the_code(page, wanted, words):
    assert states(page, wanted, *words)


def test_options_of_tailor_are_those_of_the_page(capsys):
    page = flat("docs/how_to/tailor.md")
    assert main(["tailor", "--help"]) == 0
    for option in {word for word in capsys.readouterr().out.split() if word.startswith("--")} - {"--help", "--format"}:
        assert f"| `{option.strip('[],')}" in page, option
    assert f"HIGH is {tailor.NARROWEST:g} to {tailor.WIDEST:g} times LOW" in page
    assert f"{tailor.FEWEST_STAGES} to {tailor.MOST_STAGES}, or `6:12`" in page
    assert f"more than {tailor.MOST_COORDINATES} coordinates" in page
    assert f"{starts.LEAST} to {starts.MOST} in all" in page
