"""A config whose system and one of whose integrators are files, in a folder of its own."""

import copy
from contextlib import contextmanager
from pathlib import Path

import pytest

from nearharmonic.errors import NearharmonicError

EXAMPLES = Path(__file__).parents[3] / "examples"
GRID = {"lowest": 0.05, "highest": 0.5, "points_per_decade": 4}
WELL = (EXAMPLES / "quartic_well.py").read_text(encoding="utf-8")
METHOD = (EXAMPLES / "fourth_order.py").read_text(encoding="utf-8")
CONFIG = {
    "name": "mine",
    "integrators": ["ruth", "fourth_order.py"],
    "systems": {"mine": {"file": "quartic_well.py", "tau_per_stage": GRID}},
}


def enter(folder, monkeypatch):
    """Make ``folder`` the working directory, with both examples in it."""
    (folder / "quartic_well.py").write_text(WELL)
    (folder / "fourth_order.py").write_text(METHOD)
    monkeypatch.chdir(folder)
    return folder


def changed(**system):
    """CONFIG with other keys of its system, None to take one away."""
    config = copy.deepcopy(CONFIG)
    config["systems"]["mine"] = {k: v for k, v in (config["systems"]["mine"] | system).items() if v is not None}
    return config


def under(key, **system):
    return CONFIG | {"systems": {key: {"tau_per_stage": GRID, **system}}}


@contextmanager
def refused(says):
    with pytest.raises(NearharmonicError) as caught:
        yield
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
