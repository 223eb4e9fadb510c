"""README and the pages under docs: Python blocks run as printed, links lead somewhere, CI runs the commands."""

from __future__ import annotations

import re
import shutil
from math import isfinite, nan
from pathlib import Path

import pytest

from nearharmonic.engine.settings import Sweep, steps_of
from nearharmonic.integrators import integrators
from nearharmonic.output import store
from nearharmonic.output.dataset import assembled
from nearharmonic_paper.claims.table import CLAIMS
from nearharmonic_paper.experiments.paper.grid.plan import Run
from nearharmonic_paper.experiments.paper.reduce import cube_of
from nearharmonic_paper.experiments.paper.reduce import numbers as reduced_numbers
from nearharmonic_paper.experiments.paper.run import integrate_run
from nearharmonic_paper.experiments.work_precision.peers import PEERS
from nearharmonic_paper.experiments.work_precision.settings import PAPER

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
#: Address of the repository, which stands in one place.
(ADDRESS,) = re.findall(r"^repository-code: (\S+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
#: Pages that the build of the site generates have tests of their own.
PAGES = (
    ROOT / "README.md",
    *sorted(page for page in (ROOT / "docs").glob("**/*.md") if "generated" not in page.parts),
)
#: Pages whose blocks another test runs, which looks at what they find.
RUN_ELSEWHERE = {"adapters.md", "gallery.md", "stepper.md"}
#: Those of README that read no results run in test_wall.py.
BLOCKS = {
    f"{page.name}-{i}": block
    for page in PAGES
    if page.name not in RUN_ELSEWHERE
    for i, block in enumerate(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL))
    if page.name != "README.md" or "results/paper" in block
}


#: Pages whose blocks take seconds.
LONGER = {
    "choosing.md", "exact_oscillator.md", "gauss.md", "own_systems.md", "regularised.md", "systems.md",
    "tabulated_potentials.md", "tailor.md", "trained.md",
}  # fmt: skip


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A folder with a small cube and run files where README expects the paper's."""
    folder = tmp_path_factory.mktemp("results")
    methods = {}
    for name, stages in (("ruth", 3), ("babps8o7h", 8)):
        steps = tuple(steps_of("50", tau * stages) for tau in (0.05, 0.1, 0.2))
        sweep = Sweep(
            system="henon_heiles", t_end="50", lowest=0.05, highest=0.2, points_per_decade=3, precision=("double",),
            samples=10, shards=1,
        )  # fmt: skip
        taus = 0.05, 0.1, 0.2
        run = Run(sweep=sweep, integrator=name, precision="double", tau_per_stage=taus, steps=steps, samples=10)
        runs = assembled(integrate_run(run), ["t"], {"system": "henon_heiles", "integrator": name})
        methods[name] = reduced_numbers(runs).expand_dims(precision=["double"])
        store.write_dataset(folder / f"results/paper/runs/henon_heiles/{name}/0.h5", runs, {})
    settings = {"settings": '{"sweep": {"t_end": "50"}}'}
    store.write_dataset(folder / "results/paper/cubes/henon_heiles.h5", cube_of("henon_heiles", methods), settings)
    shutil.copytree(ROOT / "examples", folder / "examples")
    return folder


@pytest.fixture
def beside_results(results, tmp_path, monkeypatch):
    """A working directory with these results and the examples."""
    shutil.copytree(results, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n.partition("-")[0] in LONGER)) for n in BLOCKS]
)
def test_a_python_block_runs_as_printed(beside_results, name):
    exec(compile(BLOCKS[name], name, "exec"), {})


def test_ci_runs_readmes_test_command():
    (command,) = re.findall(r"```bash\n(python3 .*pytest)\n```", README)
    assert command in (ROOT / ".ci/run").read_text(encoding="utf-8")


def test_smoke_workflow_installs_as_readme_does():
    (command,) = re.findall(r"(python3 -m venv .*) && \S+snakemake -j2\n", README)
    smoke = (ROOT / ".github/workflows/smoke.yml").read_text(encoding="utf-8")
    assert f"run: {command}\n" in smoke


def test_every_test_that_the_script_of_ci_names_exists():
    named = re.findall(r"tests/\S+\.py", (ROOT / ".ci/run").read_text(encoding="utf-8"))
    assert named
    assert [path for path in named if not (ROOT / path).is_file()] == []


def links(page):
    """(target, section) of the links of a page to files of the repository, relative or by its address."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    found = re.findall(r"\]\((?!https?:)([^)#]*)(?:#([^)]+))?\)", text)
    there = re.findall(rf"{re.escape(ADDRESS)}/(?:blob|raw|tree)/main/([^\s#)]+)(?:#(\S+))?", text)
    return [(page.parent / target if target else page, section) for target, section in found] + [
        (ROOT / target, section) for target, section in there
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    for linked, section in links(page):
        assert linked.exists(), linked
        if section:
            headings = re.findall(r"^#+ (.+)$", linked.read_text(encoding="utf-8"), flags=re.MULTILINE)
            assert section in {re.sub(r"[^\w\- ]", "", heading).lower().replace(" ", "-") for heading in headings}, (
                section
            )


def test_every_page_is_reached_from_readme():
    reached, todo = set(), [ROOT / "README.md", ROOT / "docs/index.md"]
    assert (ROOT / "docs/index.md", "") in links(ROOT / "README.md")
    while todo:
        page = todo.pop().resolve()
        if page not in reached and page.suffix == ".md":
            reached.add(page)
            todo += [linked for linked, _ in links(page)] if page.name in ("README.md", "index.md") else []
    assert {page.resolve() for page in PAGES} <= reached


def test_readme_has_900_words_and_no_relative_link():
    text = re.sub(r"```.*?```|^\[\w+\]: .*$", "", README, flags=re.DOTALL | re.MULTILINE)
    assert len(text.split()) <= 900
    assert re.findall(r"\]\((?!https://)", README) == []
    named = set(re.findall(r"\]\[(\w+)\]", README))
    assert named == set(re.findall(r"^\[(\w+)\]: https://", README, flags=re.MULTILINE))


def test_readme_says_what_the_default_run_leaves_open():
    claims = [one for one in CLAIMS if one.kind != "finding"]
    later = {one.maker for one in claims if one.target != "all"}
    count = sum(one.target != "all" for one in claims)
    targets, times = zip(*sorted(later), strict=True)
    assert (
        f"The default run decides {len(claims) - count}; the other {count} need `snakemake -j2 {' '.join(targets)}` "
        f"({', '.join(times)})." in " ".join(README.split())
    )


def test_the_map_of_the_house_names_what_exists():
    house = (ROOT / "docs/developers/house.md").read_text(encoding="utf-8")
    (listing,) = re.findall(r"```\n(Snakefile.*?)```", house, flags=re.DOTALL)
    package = listing[listing.index("src/nearharmonic/") : listing.index("tests/")]
    named = {"": set(), "reproduction/": set()}
    for line in package.splitlines()[1:]:
        room = "reproduction/" if line.startswith("    ") else ""
        named[room] |= set(re.findall(r"(?<!\S)(\w+(?:\.py|/))(?= )", line[: 26 if room else 24]))
    for room, names in named.items():
        rooms = {f"{path.parent.name}/" for path in (ROOT / "src/nearharmonic" / room).glob("*/__init__.py")}
        assert rooms
        assert rooms <= names
        for name in names:
            assert (ROOT / "src/nearharmonic" / room / name).exists(), name


def tables_of_times():
    """The tables of times in docs/results/timings.md by (system, mode): rows of (ms, ratio), NaN if not reached."""
    text = (ROOT / "docs/results/timings.md").read_text(encoding="utf-8")
    tables = {}
    for system, section in re.findall(r"^### (.+?), t = .*?\n(.*?)(?=^#)", text, flags=re.MULTILINE | re.DOTALL):
        for rows in re.findall(r"(?:^\|.*\n)+", section, flags=re.MULTILINE):
            head, _, *lines = [[cell.strip(" *") for cell in row.strip("|").split("|")] for row in rows.splitlines()]
            tables[system, head[0]] = {label: [numbers(cell) for cell in cells] for label, *cells in lines}
    return tables


def numbers(cell):
    found = [float(number) for number in re.findall(r"[\d.]+(?:e[+-]\d+)?", cell)]
    return (*found, 1.0)[:2] if found else (nan, nan)


def test_ratios_in_tables_of_times_are_those_of_times():
    tables = tables_of_times()
    assert len(tables) == 6
    for table in tables.values():
        for column in zip(*table.values(), strict=True):
            best = min(time for time, _ in column if isfinite(time))
            for time, ratio in column:
                # Both numbers and the best have two digits.
                assert not isfinite(time) or time / best == pytest.approx(ratio, rel=0.16)


def test_readme_and_page_compare_with_heyoka_like_tables():
    others = {peer.label for peer in PEERS.values()}
    page = (ROOT / "docs/results/timings.md").read_text(encoding="utf-8")
    choosing = (ROOT / "docs/start/choosing.md").read_text(encoding="utf-8")
    found = [
        re.findall(r"^\| (.+?), (one trajectory|each of an ensemble) \| (.*) \|$", text, flags=re.MULTILINE)
        for text in (README, choosing)
    ]
    assert list(map(len, found)) == [3, 6]
    rows = [*found[0], *found[1]]
    for system, mode, cells in rows:
        assert f"| {system}, {mode} | {cells} |" in page
        table = tables_of_times()[system, mode]
        for i, cell in enumerate(cells.split("|"), start=1):  # without the first error, 1e-3
            ours = min(row[i][0] for label, row in table.items() if label not in others and isfinite(row[i][0]))
            ratio = ours / table["heyoka (adaptive Taylor)"][i][0]
            assert float(cell.strip(" *")) == pytest.approx(ratio, rel=0.11), (system, mode, i)
            assert ("**" in cell) == (float(cell.strip(" *")) > 1)


def test_heyoka_ties_where_readme_says_and_wins_nowhere():
    sentence = "**heyoka ties** for one oscillator at 10⁻¹² with `fast_math=True`."
    assert sentence in " ".join(README.split())
    others = {peer.label for peer in PEERS.values()}
    for (system, mode), table in tables_of_times().items():
        best = [
            min(row[i][0] for label, row in table.items() if label not in others and isfinite(row[i][0]))
            for i in range(4)
        ]
        for label in table:
            if label.startswith("heyoka"):
                here = (system, mode, label) == ("simple harmonic oscillator", "one trajectory", "heyoka, fast_math")
                assert all(theirs[0] >= ours for theirs, ours in zip(table[label], best, strict=True))
                ties = [theirs[0] == ours for theirs, ours in zip(table[label], best, strict=True)]
                assert ties == [False, False, False, here]  # to the two digits of the table


def test_trained_methods_beat_those_of_paper_where_page_says():
    page = " ".join((ROOT / "docs/start/choosing.md").read_text(encoding="utf-8").split())
    assert "From 10⁻⁹ on trained methods are faster than those of the paper on Hénon-Heiles and on Kepler" in page
    paper = {integrators[name].label for name in integrators if integrators.module_of(name) == PAPER}
    for (system, mode), table in tables_of_times().items():
        if system != "simple harmonic oscillator":
            for i in (2, 3):  # 1e-9 and 1e-12
                trained = min(row[i][0] for label, row in table.items() if label.startswith("trained"))
                # With the loops in C, "BAB's9o7H, a plain loop in C"; NaN stands for an error that is not reached.
                others = [row[i][0] for label, row in table.items() if label.split(",")[0] in paper]
                assert not any(time <= trained for time in others), (system, mode)


def tables_of_regularised_times():
    """The tables in docs/results/regularised.md by (orbit, kind of error): rows of (ms, ratio), NaN if not reached."""
    tables = {}
    text = (ROOT / "docs/results/regularised.md").read_text(encoding="utf-8")
    for rows in re.findall(r"(?:^\|.*\n)+", text, flags=re.MULTILINE):
        head, _, *lines = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows.splitlines()]
        tables[tuple(head[0].split(", "))] = {label: [numbers(cell) for cell in cells] for label, *cells in lines}
    return tables


def test_regularised_ratios_refer_to_default_heyoka():
    tables = tables_of_regularised_times()
    assert set(tables) == {(orbit, kind) for orbit in ("e = 0.206", "e = 0.9") for kind in ("energy", "position")}
    for table in tables.values():
        standard = [time for time, _ in table["heyoka (adaptive Taylor), original equations"]]
        for row in table.values():
            for (time, ratio), theirs in zip(row, standard, strict=True):
                # All three have two digits.
                assert not isfinite(time / theirs) or time / theirs == pytest.approx(ratio, rel=0.11)


def test_the_page_of_regularised_times_says_where_heyoka_is_ahead():
    """Ratios are, for each table, our fastest time over heyoka's on the regularised equations."""
    page = " ".join((ROOT / "docs/results/regularised.md").read_text(encoding="utf-8").split())
    stated = r"by a factor of (\S+) as a user gets it and of up to (\S+) with .* by (\S+) as a user .* by (\S+) with"
    plain, fast, energy, fast_energy = map(float, re.search(stated, page).groups())
    found = {}
    for (orbit, kind), table in tables_of_regularised_times().items():
        ours = [time for time, _ in table["fastest method here, regularised"]]
        for label in ("heyoka, regularised equations", "heyoka, regularised, fast_math"):
            for i, (time, _) in enumerate(table[label]):
                found[orbit, kind, "fast_math" in label, i] = ours[i] / time
    assert max(r for (_, kind, fast_math, i), r in found.items() if kind == "position" and not fast_math) == (
        pytest.approx(plain, abs=0.06)
    )
    assert max(r for (_, kind, fast_math, i), r in found.items() if kind == "position") == pytest.approx(fast, abs=0.06)
    assert found["e = 0.9", "energy", False, 2] == pytest.approx(energy, abs=0.06)
    assert found["e = 0.9", "energy", True, 2] == pytest.approx(fast_energy, abs=0.06)
    for (orbit, kind, fast_math, i), ratio in found.items():
        ahead = i == 2 and (kind == "position" or orbit == "e = 0.9")
        assert (ratio > 1.1) == ahead, (orbit, kind, fast_math, i)
    first = tables_of_regularised_times()["e = 0.206", "energy"]["fastest method here, regularised"][1]
    index = (ROOT / "docs/results/index.md").read_text(encoding="utf-8")
    assert f"in {first[1]} of heyoka's time on the original equations" in " ".join(index.split())
