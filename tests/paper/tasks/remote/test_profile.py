"""The profile for SLURM: it names rules that exist, and gives a whole node to each rule that measures times."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[4]
PROFILE = yaml.safe_load((ROOT / "profiles/slurm/config.yaml").read_text(encoding="utf-8"))
TEXTS = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "workflow/rules").rglob("*.smk"))
RULES = dict(re.findall(r"^rule (\w+):\n((?:\n|[ ].*\n)*)", TEXTS, re.MULTILINE))


def test_the_profile_names_rules_that_exist():
    assert "integrate" in PROFILE["set-resources"]
    assert {*PROFILE["set-resources"], *PROFILE["set-threads"]} <= RULES.keys()


def test_measured_times_have_a_node_of_their_own():
    timing = {name for name, text in RULES.items() if "threads: ALL_CORES" in text}
    assert "work_precision_times" in timing
    assert dict.fromkeys(timing, 1) == PROFILE["set-threads"]
    alone = {name for name, given in PROFILE["set-resources"].items() if "--exclusive" in given.get("slurm_extra", "")}
    assert alone == timing


def test_memory_and_time_grow_with_each_attempt():
    limits = [PROFILE["default-resources"], *PROFILE["set-resources"].values()]
    given = [text for one in limits for key, text in one.items() if key in {"mem_mb", "runtime"}]
    assert given
    assert all(re.fullmatch(r"\d+ \* attempt", text) for text in given)
