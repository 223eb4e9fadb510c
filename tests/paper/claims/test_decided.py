"""The table of verdicts: its keys, its bytes, missing and damaged files."""

from __future__ import annotations

import csv
import json
import re

import numpy as np
import pytest
import xarray as xr

from nearharmonic.errors import ResultFileError
from nearharmonic.output.store import write_dataset
from nearharmonic_paper.claims.pages.summary import KINDS
from nearharmonic_paper.claims.results import Results, short
from nearharmonic_paper.claims.table import CLAIMS, FILES, KEYS, decide, decided
from nearharmonic_paper.tasks.experiment import experiments
from nearharmonic_paper.tasks.job import write
from support.projects.targets import TARGETS
from support.results.sound_results import curves, sound_results

VERDICTS = {"holds", "holds but for edges", "holds in part", "fails", "erratum", "not decided here"}
#: Targets whose files may be looked at, written down here and not asked for.
ALLOWED = {"all": TARGETS["all"] | {f"cubes/{name}.h5" for name in ("sho", "henon_heiles", "kepler", "sho_terms",
                                                              "henon_heiles_chaos", "substeps_displaced")},
           "derive": TARGETS["derive"], "stability": TARGETS["stability"],
           "trained_proof": TARGETS["trained_proof"]}  # fmt: skip


def refused(constant):
    raise AssertionError(constant)


def others(*values):
    """Values of a parameter that make a test slow: each decides all statements."""
    return [pytest.param(value, marks=pytest.mark.slow) for value in values]


def described(cube):
    """``cube`` as a file needs it: every variable has units and a meaning."""
    cube = cube.copy(deep=True)
    for variable in cube.variables.values():
        variable.attrs = {"units": "1", "long_name": "x", **variable.attrs}
    return cube


@pytest.fixture(scope="module")
def sound():
    """The entries of all statements on sound results, for reading alone."""
    return decide(sound_results())


@pytest.fixture(scope="module")
def undecided(tmp_path_factory):
    """The entries of all statements on an empty folder, for reading alone."""
    return json.loads(decided(tmp_path_factory.mktemp("empty"))["document"], parse_constant=refused)


@pytest.fixture
def folder(tmp_path):
    """A folder with cubes of two systems and nothing else."""
    for system in ("sho", "kepler"):
        write_dataset(tmp_path / f"cubes/{system}.h5", described(curves(system)), {})
    return tmp_path


def test_file_of_another_config_counts_as_missing(tmp_path):
    (tmp_path / "sho.h5").touch()
    assert [Results(tmp_path, leftovers=left).has("sho.h5") for left in ((), ["sho.h5"])] == [True, False]


def test_entry_has_agreed_keys_and_no_number_that_json_lacks(undecided):
    assert len(undecided) >= 25
    for entry in undecided:
        assert list(entry) == list(KEYS)
        assert set(entry) == {
            "id", "paper", "statement", "kind", "verdict", "value", "threshold", "margin", "needs",
        }  # fmt: skip
        assert list(entry["paper"]) == ["section", "sentence"]
        assert entry["verdict"] in VERDICTS
        assert entry["kind"] in {*KINDS, "finding"}
        texts = [entry[key] for key in KEYS if key not in ("paper", "margin", "needs")]
        assert all(isinstance(text, str) and text for text in (*texts, *entry["paper"].values()))
        assert bool(entry["margin"]) == (entry["verdict"] != "not decided here")
        assert isinstance(entry["needs"], list)
    assert len({entry["id"] for entry in undecided}) == len(undecided)


def test_no_value_holds_a_number_that_is_none(sound):
    for entry in sound:
        assert not re.search(r"\b(nan|inf)\b", entry["value"]), entry


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
    assert (
        sum(line.startswith("| ") for line in (folder / "a.md").read_text(encoding="utf-8").splitlines())
        == len(rows) + 1
    )


def test_empty_folder_leaves_undecided_what_needs_file_and_names_target(undecided):
    times = {one.cubes_target: one.cubes_duration for one in experiments().values()}
    for one, entry in zip(CLAIMS, undecided, strict=True):
        assert (entry["verdict"] == "not decided here") == bool(one.needs), one.id
        if one.needs:
            assert entry["value"] == f"{one.needs[0]} is not there: target {one.target}, {times[one.target]}"


def test_target_of_statement_makes_files_that_it_needs():
    assert set(FILES) == {name for one in CLAIMS for name in (*one.needs, *one.also)}
    for one in CLAIMS:
        others = ALLOWED["all"] if one.target != "all" else set()
        assert set(one.needs) <= ALLOWED[one.target] | others, one.id
        assert set(one.also) <= set().union(*ALLOWED.values()) - ALLOWED[one.target], one.id


@pytest.mark.slow
def test_what_is_in_a_folder_is_decided_as_in_memory(folder, sound):
    held = {entry["id"]: entry for entry in sound}
    entries = {entry["id"]: entry for entry in json.loads(decided(folder)["document"])}
    for name in ("fig-1-sixth-order", "fig-5-best-maximum", "outperform-ruth-kepler", "floor-of-double"):
        assert entries[name] == held[name]
    assert entries["fig-3-orders"]["verdict"] == "not decided here"


@pytest.mark.slow
@pytest.mark.parametrize("methods", [["ruth", "yoshida_s7o6a", "babs7o7h"], *others(["ruth"], ["babps9o7h"])])
def test_results_of_few_methods_are_no_error(methods):
    sound = sound_results()
    for name, cube in sound.cubes.items():
        if "integrator" not in cube.dims:
            continue
        kept = np.isin(cube["integrator"].values, methods)
        sound.cubes[name] = cube.isel(integrator=kept if kept.any() else slice(0, 1))
    verdicts = {entry["id"]: entry["verdict"] for entry in decide(sound)}
    assert verdicts["outperform-blanes-kepler"] == verdicts["fig-5-best-mean"] == "not decided here"
    assert verdicts["negative-coefficients"] == "holds"


@pytest.mark.slow
@pytest.mark.parametrize("points", [slice(0, 0), *others(slice(0, 2), slice(100, 102), slice(160, 161))])
def test_results_of_few_step_sizes_are_no_error(points):
    sound = sound_results()
    for system in ("sho", "henon_heiles", "kepler"):
        sound.cubes[system] = sound.cubes[system].isel(tau_per_stage=points)
    verdicts = {entry["id"]: entry["verdict"] for entry in decide(sound)}
    assert verdicts["fig-1-sixth-order"] == verdicts["fig-4-coincide"] == "not decided here"


@pytest.mark.slow
def test_runs_that_all_diverged_are_no_error():
    sound = sound_results()
    for system in ("sho", "henon_heiles", "kepler"):
        cube = sound.cubes[system]
        cube["status"][:] = "diverged"
        cube["perihelion_advance"][:] = np.nan
        cube["perihelion_advance_interval"][:] = np.nan
        for variable in ("max_energy_error", "mean_energy_error"):
            cube[variable][:] = np.inf
    verdicts = {entry["id"]: entry["verdict"] for entry in decide(sound)}
    assert verdicts["fig-3-steepest"] == verdicts["fig-5-best-maximum"] == "not decided here"


@pytest.mark.slow
def test_truncated_cube_is_named_with_command_that_makes_it_again(folder):
    path = folder / "cubes/kepler.h5"
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(ResultFileError, match=r"kepler\.h5 is truncated .* Make it again: snakemake"):
        decided(folder)


@pytest.mark.slow
@pytest.mark.parametrize("content", [b"", b"set,coefficient\na\n", b"\xff\xfe", b"set,coefficient\n", b"a,b\n1,2\n"])
def test_a_damaged_table_is_named_with_a_command(tmp_path, content):
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables/table4_derived.csv").write_bytes(content)
    with pytest.raises(ResultFileError, match=r"tables/table4_derived\.csv .*Make it again: snakemake"):
        decided(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("content", [b"", b"agreements = ", b"agreements = 3\n"])
def test_a_damaged_document_is_named_with_a_command(tmp_path, content):
    (tmp_path / "derived").mkdir()
    (tmp_path / "derived/coefficients.toml").write_bytes(content)
    with pytest.raises(ResultFileError, match=r"derived/coefficients\.toml .*Make it again: snakemake"):
        decided(tmp_path)


@pytest.mark.slow
def test_a_method_of_a_users_config_changes_no_verdict(sound):
    """In every cube a method of the worst numbers, in every table of methods one of no order."""
    results = sound_results()
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
    assert decide(results) == sound


def test_statements_look_at_the_methods_that_the_job_names(tmp_path):
    (entry,) = (
        one
        for one in json.loads(decided(tmp_path, ["ruth", "leapfrog"])["document"])
        if one["id"] == "negative-coefficients"
    )
    assert entry["value"] == "1 of 1 registered methods of order above 2"


@pytest.mark.parametrize(
    ("number", "text"),
    [(0.0123456, "0.0123"), (2.8e6, "2.8 × 10⁶"), (3e-11, "3 × 10⁻¹¹"), (0.0, "0"), (np.inf, "beyond all bounds")],
)
def test_numbers_are_written_for_readers(number, text):
    assert short(number) == text
