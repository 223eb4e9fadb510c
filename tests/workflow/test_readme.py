"""README and the pages under docs: Python blocks run as printed, links lead somewhere, CI runs the commands."""

import re
import shutil
from pathlib import Path

import pytest

import nearharmonic as nh
from nearharmonic.engine.settings import Sweep, steps_of
from nearharmonic.output import store
from nearharmonic.output.store import assembled
from nearharmonic_paper.experiments.paper.reductions import cube_of
from nearharmonic_paper.experiments.paper.reductions import numbers as reduced_numbers
from nearharmonic_paper.experiments.paper.run import Run, integrate_run

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
#: Address of the repository, which stands in one place.
(ADDRESS,) = re.findall(r"^repository-code: (\S+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
#: Pages that the build of the site generates have tests of their own.
PAGES = (ROOT / "README.md", *sorted(page for page in (ROOT / "docs").glob("**/*.md") if "generated" not in page.parts))
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


def evaluations():
    """(system, error, method, evaluations) of README's table of costs."""
    header, *lines = re.findall(r"^\| .* \|$", README.partition("## ")[0], flags=re.MULTILINE)
    names = {"leapfrog": "leapfrog", "Ruth": "ruth", "Yoshida": "yoshida_s7o6a", "BAB's9o7H": "babps9o7h"}
    system = ""
    for line in lines:
        first, error, *cells = [cell.strip(" *") for cell in line.strip("|").split("|")]
        system = {"Hénon-Heiles": "henon_heiles", "Sun-Mercury": "kepler", "": system}[first.partition(",")[0]]
        methods = [names[cell.strip().partition(",")[0]] for cell in header.strip("|").split("|")[2:]]
        for method, cell in zip(methods, cells, strict=True):
            yield system, {"10⁻⁶": 1e-6, "10⁻⁹": 1e-9}[error], method, int(cell.replace(" ", ""))


@pytest.mark.parametrize(("system", "error", "method", "needed"), list(evaluations()))
def test_readmes_evaluations_are_the_fewest_for_an_error(system, error, method, needed):
    def error_of(evaluations):
        stages, t_end = nh.integrators[method].stages, float(nh.systems[system].t_end)
        steps = round(evaluations / stages)
        return nh.integrate(system, method, t_end / steps, samples=2).max_energy_error.item()

    assert error_of(1.02 * needed) <= error < error_of(0.96 * needed)


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
            anchors = {re.sub(r"[^\w\- ]", "", heading).lower().replace(" ", "-") for heading in headings}
            assert section in anchors, section


def test_no_link_is_named_after_a_file():
    named = [(page.name, link) for page in PAGES for link in re.findall(r"\[([\w/]+\.md)\]\(", page.read_text("utf-8"))]
    assert named == []


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
