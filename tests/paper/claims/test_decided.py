"""The verdicts: their table and their numbers; missing, damaged, small and odd results; the committed documents."""

import csv
import json
import re

import numpy as np
import pytest
import xarray as xr

from nearharmonic.errors import NearharmonicError, ResultFileError
from nearharmonic.integrators import BENCHMARKED, plain_integrators
from nearharmonic_paper.claims.claim import KINDS, OPEN, VERDICTS, Results, failures, sums, tally, verdicts_line
from nearharmonic_paper.claims.documents import page, verdicts
from nearharmonic_paper.claims.table import CLAIMS, FILES, KEYS, decide, decided
from nearharmonic_paper.pages.targets import stability
from nearharmonic_paper.tasks.experiment import experiments
from nearharmonic_paper.tasks.job import write
from support.projects.targets import TARGETS
from support.projects.workflow_project import Project
from support.results.recorded_results import held_results, unpack
from support.results.stated_numbers import ROOT

# --- the table of verdicts: its keys, its bytes; missing, damaged, small and odd results ------------------------------


SYSTEMS = ("sho", "henon_heiles", "kepler")
#: Targets whose files the statements may use, written out here and not derived.
ALLOWED = {"all": TARGETS["all"] | {f"cubes/{name}.h5" for name in (*SYSTEMS, "sho_terms", "henon_heiles_chaos",
                                                              "substeps_displaced")},
           "derive": TARGETS["derive"], "stability": TARGETS["stability"],
           "trained_proof": TARGETS["trained_proof"]}  # fmt: skip


@pytest.fixture(scope="module")
def entries():
    """Return the entries of all statements on recorded results, not to be changed."""
    return decide(held_results())


@pytest.fixture(scope="module")
def undecided(tmp_path_factory):
    """Return the entries of all statements on an empty folder, not to be changed."""
    return json.loads(decided(tmp_path_factory.mktemp("empty"))["document"], parse_constant=pytest.fail)


@pytest.fixture
def folder(tmp_path):
    """Return a folder of results without half of the files."""
    for name in FILES[::2]:
        (unpack(tmp_path) / name).unlink()
    return tmp_path


def verdicts_on(results):
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


def test_empty_folder_leaves_statements_open_and_names_their_targets(undecided):
    times = {one.cubes_target: one.cubes_duration for one in experiments().values()}
    for claim, entry in zip(CLAIMS, undecided, strict=True):
        assert (entry["verdict"] == OPEN) == bool(claim.needs), claim.id
        if claim.needs:
            assert entry["value"] == f"target {claim.target} decides it ({times[claim.target]})"


def test_target_of_statement_makes_files_that_it_needs():
    assert set(FILES) == {name for claim in CLAIMS for name in (*claim.needs, *claim.also)}
    for claim in CLAIMS:
        others = ALLOWED["all"] if claim.target != "all" else set()
        assert set(claim.needs) <= ALLOWED[claim.target] | others, claim.id
        assert set(claim.also) <= set().union(*ALLOWED.values()) - ALLOWED[claim.target], claim.id


@pytest.mark.slow
def test_statement_reads_only_the_files_that_it_names():
    """Without one file, the statements that name it are open, and all others are unchanged."""
    whole = verdicts_on(held_results())
    for stem in ("sho_terms", "derived_counts"):
        results = held_results()
        (results.cubes if stem in results.cubes else results.tables).pop(stem)
        found = verdicts_on(results)
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
    found = verdicts_on(results)
    assert found["outperform-blanes-kepler"] == found["fig-5-best-mean"] == OPEN
    assert found["negative-coefficients"] == "holds"


@pytest.mark.slow
@pytest.mark.parametrize("points", [slice(0, 0), slice(0, 2), slice(100, 102)])
def test_results_of_few_step_sizes_are_no_error(points):
    results = held_results()
    for system in SYSTEMS:
        results.cubes[system] = results.cubes[system].isel(tau_per_stage=points)
    found = verdicts_on(results)
    assert found["fig-1-sixth-order"] == found["fig-4-coincide"] == OPEN


@pytest.mark.slow
def test_runs_that_all_diverged_are_no_error():
    results = held_results()
    for system in SYSTEMS:
        for variable in results.cubes[system].data_vars.values():
            variable[:] = np.inf if "energy_error" in variable.name else np.nan
    found = verdicts_on(results)
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
    """Every cube has an additional method with bad numbers, every table of methods has a method without an order."""
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


def test_statements_use_the_methods_that_the_job_names(tmp_path):
    (claim,) = (claim for claim in CLAIMS if claim.id == "negative-coefficients")
    methods = {name: held_results().methods[name] for name in ("ruth", "leapfrog")}
    assert claim.decision(Results(tmp_path, methods)).value == "1 of 1 registered methods of order above 2"


# --- docs/claims.json is decided again; README and docs/results/claims.md are made from it ----------------------------


TEXT = (ROOT / "docs/claims.json").read_text(encoding="utf-8")
ENTRIES = json.loads(TEXT)
VALUES = {entry["id"]: entry["value"] for entry in ENTRIES}
PAGE = (ROOT / "docs/results/claims.md").read_text(encoding="utf-8")


def test_page_is_made_from_the_committed_verdicts():
    assert page(ENTRIES) == PAGE


def test_recorded_results_belong_to_registered_methods(tmp_path):
    """Sizes and symmetry follow from the coefficients, without the code that made the table."""
    with (unpack(tmp_path) / "tables/integrators.csv").open(encoding="utf-8") as file:
        rows = {row["integrator"]: row for row in csv.DictReader(file)}
    assert {*BENCHMARKED} < rows.keys() <= {*plain_integrators.registered}
    mirrored = {
        name for name, one in plain_integrators.items()
        if name in rows and one.kick == one.kick[::-1] and one.drift == one.drift[::-1]
    }  # fmt: skip
    assert {name for name, row in rows.items() if row["symmetric"] == "yes"} == mirrored
    assert VALUES["even-orders"] == f"{len(mirrored)} of {len(mirrored)} methods"


@pytest.mark.slow
def test_results_with_open_statements_write_nothing(tmp_path):
    with pytest.raises(NearharmonicError, match=r"undecided, like even-orders \(target .*: no verdict is"):
        verdicts(str(tmp_path), str(ROOT / "README.md"), plain_integrators.registered)


def test_misprints_are_errata_and_everything_else_is_decided():
    assert [entry["id"] for entry in ENTRIES if entry["verdict"] == "not decided here"] == []
    assert {entry["id"] for entry in ENTRIES if entry["verdict"] == "erratum"} == {
        entry["id"] for entry in ENTRIES if entry["kind"] == "misprint"
    }


@pytest.mark.slow
def test_the_committed_verdicts_are_decided_again_from_recorded_results(tmp_path):
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (tmp_path / "README.md").write_text(readme.replace("**holds**", "**fails**"), encoding="utf-8")
    made = verdicts(str(unpack(tmp_path)), str(tmp_path / "README.md"), plain_integrators.registered)
    assert made == made | {"document": TEXT, "page": PAGE, "readme": readme}


@pytest.mark.slow
@pytest.mark.reproduction
def test_a_run_reaches_the_committed_verdicts(tmp_path):
    """Run the default target and the targets that statements need, on the paper's config; a few minutes."""
    project = Project(tmp_path)
    needed = ("all", "derive", "stability", "results/paper/cubes/trained.h5")
    assert project.snakemake(*needed, "-j2").returncode == 0
    done = project.snakemake("results/paper/tables/claims.json", "--force", "-j2")
    assert done.returncode == 0, done.stdout
    assert (tmp_path / "results/paper/tables/claims.json").read_text(encoding="utf-8") == TEXT
    names = ("stability_henon_heiles", "stability_rounding", "kinetic_energy")
    tables = [str(tmp_path / f"results/paper/tables/{name}.csv") for name in names]
    page = ROOT / "docs/results/stability.md"
    assert stability(str(page), tables=tables)["page"] == page.read_text(encoding="utf-8")


# --- numbers of verdicts, and the message of a run on open statements -------------------------------------------------


MAKES = {one.target: one.needs for one in CLAIMS}


def entry(name, verdict, kind="result", needs=()):
    return {"id": name, "verdict": verdict, "kind": kind, "needs": needs}


SUMMED = [
    entry("a", "holds"), entry("b", "holds"), entry("c", "fails"), entry("d", "fails", "attribution"),
    entry("e", "erratum", "misprint"), entry("f", "holds", "finding"), entry("g", "holds but for edges", "background"),
]  # fmt: skip


def test_findings_are_not_counted():
    told = "2 hold, 1 holds but for edges, 2 fail, 1 erratum"
    assert tally(SUMMED) == f"Of 6 statements of the paper, {told}"


def test_sums_are_by_kind_in_the_order_of_their_weight():
    assert [(kind, number) for kind, number, _ in sums(SUMMED)] == [
        ("results", 3), ("background", 1), ("attributions", 1), ("misprints", 1),
    ]  # fmt: skip
    assert sums(SUMMED)[0][2]["holds"] == 2


def test_only_results_and_mathematics_fail_in_substance():
    assert [one["id"] for one in failures(SUMMED)] == ["c"]


@pytest.mark.parametrize(
    ("missing", "end"),
    [
        ((), "statements of the paper, 1 holds"),
        (("derive", "stability"), "; snakemake -j2 derive stability decides them (50 s, 70 s)"),
        (("all", "derive"), "; snakemake -j2 derive decides most of them (50 s)"),
        (("all",), "1 holds, 1 not decided here"),
    ],
)
def test_run_names_command_that_decides_open_statements(tmp_path, missing, end):
    entries = [entry("x", "holds"), *(entry(one, "not decided here", needs=MAKES[one]) for one in missing)]
    document = tmp_path / "claims.json"
    document.write_text(json.dumps(entries), encoding="utf-8")
    line = verdicts_line(document, "snakemake -j2")
    assert line.startswith(f"Of {len(entries)} statements")
    assert line.endswith(end)
    other = verdicts_line(document, "snakemake -j2 --configfile a.yaml")
    assert other == re.sub("(snakemake -j2.*?)( decides)", r"\1 --configfile a.yaml\2", line)
