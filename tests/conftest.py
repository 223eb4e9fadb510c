"""Multiprecision, registries, environment are reset after each test; tests that share a workflow share a process."""

from __future__ import annotations

import gc
import os
import signal
from pathlib import Path, PurePosixPath

import mpmath
import pytest
from hypothesis import settings
from xdist.scheduler.loadscope import LoadScopeScheduling

import nearharmonic as nh
from support.trials.campaign import Campaign, TrialsPlugin

#: Their tests read the projects in which the workflow has run.
FINISHED = {
    "test_adopt", "test_damage", "test_derive", "test_dry_runs", "test_everything", "test_frozen_jobs", "test_pages",
    "test_repairs", "test_results", "test_rules", "test_settings_of_results", "test_without_numba",
    "test_work_precision",
}  # fmt: skip

# A shell starts what runs in its background with SIGINT ignored, and so would everything that a test interrupts.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# A busy machine is no fault: tests have no deadline of their own.
settings.register_profile("shared", deadline=None)
settings.load_profile("shared")


@pytest.fixture(autouse=True)
def _working_precision():
    with mpmath.workdps(60):
        yield


@pytest.fixture(autouse=True)
def _registries():
    """Definitions of a config stay in the registries of a process, and later tests would find them."""
    with nh.systems.defining(nh.systems.definitions), nh.integrators.defining(nh.integrators.definitions):
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


@pytest.fixture
def trials(request):
    """Start campaigns of one kind of cases, such as ``trials("E. bad configs")``, checked at the end."""
    started = []

    def start(kind):
        started.append(Campaign(kind))
        return started[-1]

    yield start
    for one in started:
        request.node.user_properties.append(("trials", (one.kind, one.tried, len(one.failed))))
    for one in started:
        one.check()


def pytest_addoption(parser):
    parser.addoption("--trials", metavar="FILE", help="run trials alone, and write how many cases of each kind failed")


def pytest_configure(config):
    if config.getoption("--trials") and not hasattr(config, "workerinput"):
        config.pluginmanager.register(TrialsPlugin(Path(config.getoption("--trials"))))


class OneProcessAFile(LoadScopeScheduling):
    """The tests of a file go to one process, so that they share fixtures and caches.

    So do the files of FINISHED, and the files of an experiment: two processes would compile its kernels twice.
    """

    def _split_scope(self, nodeid: str) -> str:
        file = PurePosixPath(nodeid.partition("::")[0])
        if file.parent.name == "workflow" and file.stem in FINISHED:
            return "finished"
        return str(file.parent if file.parent.parent.name == "experiments" else file)


# Not marks named xdist_group: pytest 9.2 does not let xdist 3.8 put the groups into the names of tests.
def pytest_xdist_make_scheduler(config, log):
    config.option.loadscopereorder = False  # in the order of the items, not by their number
    return OneProcessAFile(config, log)


@pytest.hookimpl(tryfirst=True)  # before tests are chosen by their marks
def pytest_collection_modifyitems(config, items):
    """Put the workflow first: its files take longest, and a long file at the end keeps one process busy alone."""
    items.sort(key=lambda item: item.path.parent.name != "workflow")
    for item in items:
        if "trials" in item.fixturenames:
            item.add_marker("trials")
    if config.getoption("--trials"):
        items[:] = [item for item in items if "trials" in item.fixturenames]


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Keep the garbage collector from scanning the syntax trees, modules and items of all tests again and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()
