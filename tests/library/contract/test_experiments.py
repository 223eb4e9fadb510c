"""Experiments are declared once, and the workflow, the config, the documents and codecheck.yml have all of it."""

from pathlib import Path

import yaml

from nearharmonic_paper.config import cube_rows, target_rows
from nearharmonic_paper.tasks.experiment import Experiment, beside_the_paper, experiments
from support.projects.targets import TARGETS

# --- every experiment is declared once, and the workflow, the config and the documents have all of it -----------------


ROOT = Path(__file__).parents[3]
EXPERIMENTS = list(experiments().values())


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def test_every_folder_of_experiments_is_one_in_order_of_places():
    places = ("src/nearharmonic_paper/experiments/*/__init__.py", "src/nearharmonic_studies/*/__init__.py")
    folders = {path.parent.name for place in places for path in ROOT.glob(place)}
    assert set(experiments()) == folders
    assert [one.place for one in EXPERIMENTS] == sorted(one.place for one in EXPERIMENTS)
    assert EXPERIMENTS[0].name == "paper"
    assert len(beside_the_paper()) == len(EXPERIMENTS) - 1


def test_no_two_experiments_share_target_key_or_file():
    for values in (
        [one.target for one in EXPERIMENTS],
        [one.key for one in EXPERIMENTS],
        [one.title for one in EXPERIMENTS],
        [name for one in EXPERIMENTS for name in (*one.cubes, *one.runs)],
        [name for one in EXPERIMENTS for name in one.tables],
        [name for one in EXPERIMENTS for name in one.figures],
    ):
        assert len(set(values)) == len(values)


def test_documents_have_the_cubes_and_targets_of_all_experiments():
    """As ``python -m nearharmonic_paper.config`` writes them."""
    assert cube_rows() in text_of("docs/how_to/files.md")
    assert target_rows() in text_of("docs/index.md")
    assert all(f"snakemake -j2 {one.target}`" in target_rows() for one in beside_the_paper())


def test_placeholders_are_filled_with_every_combination():
    one = Experiment(
        name="one", title="", about="", cubes={"a": ("", "")}, tables=("t_{x}",), figures={"f_{x}_{y}": "F"},
        others=("tables/{y}.csv", "b/c.toml"), runs=("r/{x}", "s"),
    )  # fmt: skip
    made = one.files(x="pq", y="u")
    assert made == [
        "cubes/a.h5", "tables/t_p.csv", "tables/t_q.csv", "tables/t_p.md", "tables/t_q.md", "tables/t_p.tex",
        "tables/t_q.tex", "figures/f_p_u.pdf", "figures/f_q_u.pdf", "figures/f_p_u.svg", "figures/f_q_u.svg",
        "figures/f_p_u.png", "figures/f_q_u.png", "tables/u.csv", "b/c.toml",
    ]  # fmt: skip
    assert one.run_files(x="pq") == ["runs/r/p.h5", "runs/r/q.h5", "runs/s.h5"]
    assert one.table_patterns == ("t_*", "*")
    assert one.figure_titles == {"f_*_*": "F"}
    assert (one.target, one.key) == ("one", "one")


# --- codecheck.yml: its manifest is the figures and tables of the paper, as the default target makes them -------------


def test_the_manifest_is_the_figures_and_tables_of_the_paper():
    told = yaml.safe_load((ROOT / "codecheck.yml").read_text(encoding="utf-8"))
    files = {one["file"].removeprefix("results/paper/") for one in told["manifest"]}
    assert len(files) == len(told["manifest"])
    assert files <= TARGETS["all"]
    numbered = {name for name in TARGETS["all"] if name.startswith(("figures/fig", "tables/table"))}
    wanted = {name for name in numbered if name.endswith((".pdf", ".csv")) and "displaced" not in name}
    assert files == wanted | {"tables/claims.csv"}
