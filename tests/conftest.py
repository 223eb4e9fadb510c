"""Multiprecision, registries, environment are reset after each test; tests that share a workflow share a process."""

from __future__ import annotations

import os
from pathlib import PurePosixPath

import mpmath
import pytest
from hypothesis import settings
from xdist.scheduler.loadscope import LoadScopeScheduling

import nearharmonic as nh

#: Their tests read the one project in which ``everything`` has run.
FINISHED = {"test_adopt", "test_derive", "test_everything", "test_results", "test_work_precision"}

# A busy machine is no fault: tests have no deadline of their own.
settings.register_profile("shared", deadline=None)
settings.load_profile("shared")


@pytest.fixture(autouse=True)
def _working_precision():
    with mpmath.workdps(60):
        yield


@pytest.fixture(autouse=True)
def _registries():
    """What a config defines stays in the registries of a process, and would be found by the tests after it."""
    with (
        nh.systems.defining(nh.systems.definitions),
        nh.integrators.defining(nh.integrators.definitions),
    ):
        yield


def _own_variables():
    return {name: value for name, value in os.environ.items() if name.startswith("NEARHARMONIC_")}


@pytest.fixture(autouse=True)
def _environment():
    """A variable that a test leaves behind would change what the tests after it find."""
    before = _own_variables()
    yield
    after = _own_variables()
    for name in after.keys() - before.keys():
        del os.environ[name]
    os.environ.update(before)
    assert after == before


class OneProcessAWorkflow(LoadScopeScheduling):
    """Tests go to processes one by one, but those of a file of tests/workflow together, and those of FINISHED."""

    def _split_scope(self, nodeid: str) -> str:
        file = PurePosixPath(nodeid.partition("::")[0])
        if file.parent.name != "workflow":
            return nodeid
        return "finished" if file.stem in FINISHED else str(file)


# Not marks named xdist_group: pytest 9.2 does not let xdist 3.8 put the groups into the names of tests.
def pytest_xdist_make_scheduler(config, log):
    return OneProcessAWorkflow(config, log)
