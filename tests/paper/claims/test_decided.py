"""The table of verdicts: its keys, its bytes; missing, damaged, small and odd results."""

from __future__ import annotations

import csv
import json
import re

import numpy as np
import pytest
import xarray as xr

from nearharmonic.errors import ResultFileError
from nearharmonic_paper.claims.claim import KINDS, OPEN, VERDICTS, Results, short
from nearharmonic_paper.claims.table import CLAIMS, FILES, KEYS, decide, decided
from nearharmonic_paper.tasks.experiment import experiments
from nearharmonic_paper.tasks.job import write
from support.projects.targets import TARGETS
from support.results.recorded_results import held_results, unpack

SYSTEMS = ("sho", "henon_heiles", "kepler")
#: Targets whose files may be looked at, written down here and not asked for.
ALLOWED = {"all": TARGETS["all"] | {f"cubes/{name}.h5" for name in (*SYSTEMS, "sho_terms", "henon_heiles_chaos",
                                                              "substeps_displaced")},
           "derive": TARGETS["derive"], "stability": TARGETS["stability"],
           "trained_proof": TARGETS["trained_proof"]}  # fmt: skip


@pytest.fixture(scope="module")
def entries():
    """The entries of all statements on recorded results, for reading alone."""
    return decide(held_results())


@pytest.fixture(scope="module")
def undecided(tmp_path_factory):
    """The entries of all statements on an empty folder, for reading alone."""
    return json.loads(decided(tmp_path_factory.mktemp("empty"))["document"], parse_constant=pytest.fail)


@pytest.fixture
def folder(tmp_path):
    """A folder of results in which half of the files are missing."""
    for name in FILES[::2]:
        (unpack(tmp_path) / name).unlink()
    return tmp_path


def verdicts(results):
    found = decide(results)
    assert not [entry for entry in found if re.search(r"\b(nan|inf)\b", entry["value"])]
    return {entry["id"]: entry["verdict"] for entry in found}


def test_file_of_another_config_counts_as_missing(tmp_path):
    (tmp_path / "sho.h5").touch()
    assert [Results(tmp_path, leftovers=left).has("sho.h5") for left in ((), ["sho.h5"])] == [True, False]


def test_entry_has_agreed_keys_and_words(undecided):
    assert len({entry["id"] for entry in undecided}) == len(undecided) == len(CLAIMS) > 100
    for entry in undecided:
        assert list(entry) == list(KEYS)
        assert list(entry["paper"]) == ["section", "sentence"]
        assert entry["verdict"] in VERDICTS
        assert entry["kind"] in {*KINDS, "finding"}
        texts = [entry[key] for key in ("id", "statement", "value", "threshold")]
        assert all(isinstance(text, str) and text for text in (*texts, *entry["paper"].values()))
        assert bool(entry["margin"]) == (entry["verdict"] != OPEN)


def test_empty_folder_leaves_undecided_what_needs_file_and_names_target(undecided):
    times = {one.cubes_target: one.cubes_duration for one in experiments().values()}
    for claim, entry in zip(CLAIMS, undecided, strict=True):
        assert (entry["verdict"] == OPEN) == bool(claim.needs), claim.id
        if claim.needs:
            assert entry["value"] == f"{claim.needs[0]} is not there: target {claim.target}, {times[claim.target]}"


def test_target_of_statement_makes_files_that_it_needs():
    assert set(FILES) == {name for claim in CLAIMS for name in (*claim.needs, *claim.also)}
    for claim in CLAIMS:
        others = ALLOWED["all"] if claim.target != "all" else set()
        assert set(claim.needs) <= ALLOWED[claim.target] | others, claim.id
        assert set(claim.also) <= set().union(*ALLOWED.values()) - ALLOWED[claim.target], claim.id


@pytest.mark.slow
def test_statement_reads_no_file_but_those_that_it_names():
    """Without any one file, the statements that name it are open, and no other changes."""
    whole = verdicts(held_results())
    for stem in ("sho_terms", "derived_counts"):
        results = held_results()
        (results.cubes if stem in results.cubes else results.tables).pop(stem)
        found = verdicts(results)
        needing = {claim.id for claim in CLAIMS if any(f"/{stem}." in name for name in claim.needs)}
        assert needing
        assert {name for name in whole if found[name] != whole[name]} == needing


@pytest.mark.slow
def test_files_have_verdicts_and_same_bytes_each_time(folder):
    for attempt in ("a", "b"):
        results = decided(folder)
        write(results["table"], [folder / f"{attempt}.csv", folder / f"{attempt}.md"], {})
        write(results["document"], [folder / f"{attempt}.json"], {})
    for suffix in ("csv", "md", "json"):
        assert (folder / f"a.{suffix}").read_bytes() == (folder / f"b.{suffix}").read_bytes()
    entries = json.loads((folder / "a.json").read_text(encoding="utf-8"))
    with (folder / "a.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    flat = [{**entry, **entry["paper"], "needs": ", ".join(entry["needs"])} for entry in entries]
    assert [{key: value for key, value in entry.items() if key != "paper"} for entry in flat] == rows
    lines = (folder / "a.md").read_text(encoding="utf-8").splitlines()
    assert sum(line.startswith("| ") for line in lines) == len(rows) + 1


@pytest.mark.slow
@pytest.mark.parametrize("methods", [["ruth", "yoshida_s7o6a", "babs7o7h"], ["ruth"], ["babps9o7h"]])
def test_results_of_few_methods_are_no_error(methods):
    results = held_results()
    for name, cube in results.cubes.items():
        if "integrator" in cube.dims:
            kept = np.isin(cube["integrator"].values, methods)
            results.cubes[name] = cube.isel(integrator=kept if kept.any() else slice(0, 1))
    found = verdicts(results)
    assert found["outperform-blanes-kepler"] == found["fig-5-best-mean"] == OPEN
    assert found["negative-coefficients"] == "holds"


@pytest.mark.slow
@pytest.mark.parametrize("points", [slice(0, 0), slice(0, 2), slice(100, 102)])
def test_results_of_few_step_sizes_are_no_error(points):
    results = held_results()
    for system in SYSTEMS:
        results.cubes[system] = results.cubes[system].isel(tau_per_stage=points)
    found = verdicts(results)
    assert found["fig-1-sixth-order"] == found["fig-4-coincide"] == OPEN


@pytest.mark.slow
def test_runs_that_all_diverged_are_no_error():
    results = held_results()
    for system in SYSTEMS:
        for variable in results.cubes[system].data_vars.values():
            variable[:] = np.inf if "energy_error" in variable.name else np.nan
    found = verdicts(results)
    assert found["fig-3-steepest"] == found["fig-5-best-maximum"] == OPEN


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("cubes/kepler.h5", None, "is truncated "),
        *(("tables/table4_derived.csv", bad, "") for bad in (b"", b"set,coefficient\na\n", b"\xff", b"a,b\n1,2\n")),
        *(("derived/coefficients.toml", bad, "") for bad in (b"", b"agreements = ", b"agreements = 3\n")),
    ],
)
def test_damaged_file_is_named_with_command_that_makes_it_again(tmp_path, name, content, says):
    path = tmp_path / name
    whole = (unpack(tmp_path) / name).read_bytes()
    path.write_bytes(whole[:1000] if content is None else content)
    with pytest.raises(ResultFileError, match=rf"{re.escape(name)} {says}.*Make it again: snakemake"):
        decided(tmp_path)


@pytest.mark.slow
def test_a_method_of_a_users_config_changes_no_verdict(entries):
    """In every cube a method of the worst numbers, in every table of methods one of no order."""
    results = held_results()
    for name, cube in results.cubes.items():
        if "integrator" in cube.dims:
            bad = cube.isel(integrator=[0]).assign_coords(integrator=["mine"])
            for variable in bad.variables.values():
                if variable.dtype.kind == "f" and "integrator" in variable.dims:
                    variable.values = np.full(variable.shape, 0.5)
            results.cubes[name] = xr.concat([bad, cube], "integrator", data_vars="minimal")
    for rows in results.tables.values():
        if "integrator" in rows[0]:
            rows.insert(0, dict.fromkeys(rows[0], "0") | {"integrator": "mine", "symmetric": "yes", "order": "7"})
    assert decide(results) == entries


def test_statements_look_at_the_methods_that_the_job_names(tmp_path):
    (claim,) = (claim for claim in CLAIMS if claim.id == "negative-coefficients")
    methods = {name: held_results().methods[name] for name in ("ruth", "leapfrog")}
    assert claim.decision(Results(tmp_path, methods)).value == "1 of 1 registered methods of order above 2"


@pytest.mark.parametrize(
    ("number", "text"),
    [(0.0123456, "0.0123"), (2.8e6, "2.8 × 10⁶"), (3e-11, "3 × 10⁻¹¹"), (0.0, "0"), (np.inf, "beyond all bounds")],
)
def test_numbers_are_written_for_readers(number, text):
    assert short(number) == text
