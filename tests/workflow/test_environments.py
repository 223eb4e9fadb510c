"""The workflow where something is scarce: identical files, or one sentence and nothing half-written."""

import os
import shutil
import subprocess
import sys
import time

import pytest

from nearharmonic_paper.config import LONGEST_NAME
from support.projects.killed_runs import clear, files_in
from support.projects.workflow_project import TINY, Project

pytestmark = pytest.mark.long

KIND = "D. scarce environments"
CUBE = "results/tiny/cubes/sho_terms.h5"
WORDS = ("-j1", "--quiet", "rules", *TINY)
#: No entry of the passwd file has this id.
STRANGER = 54321
#: The stranger reads all files, so that any interpreter can be tested, and writes only where it is allowed to.
READER = ("--inh-caps=-all,+dac_read_search", "--ambient-caps=-all,+dac_read_search")
AS_STRANGER = ("setpriv", f"--reuid={STRANGER}", f"--regid={STRANGER}", "--clear-groups", *READER)

needs_root = pytest.mark.skipif(os.geteuid() != 0 or not shutil.which("setpriv"), reason="root starts other users")
needs_prlimit = pytest.mark.skipif(not shutil.which("prlimit"), reason="no command limits the memory")


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A project with a cube and a figure, and the bytes of its results."""
    project = Project(tmp_path_factory.mktemp("environments") / "project")
    done = project.snakemake("fig2", *WORDS)
    assert done.returncode == 0, done.stdout
    return project, files_in(project.results)


@pytest.fixture
def project(drawn, tmp_path):
    """A copy without results, on an odd path; it has Python's compiled modules, which a full disk would truncate."""
    project = drawn[0].copy(tmp_path / "ein Pfad\nüber zwei Zeilen")
    clear(project)
    return project


def start(project, *words, before=(), without=(), umask=-1, **variables):
    """A new process of Snakemake behind the command ``before``, in a changed environment."""
    environment = {name: value for name, value in os.environ.items() if name not in without}
    environment |= {"PYTHONPATH": str(project.folder / "src")} | variables
    return subprocess.run(
        [*before, sys.executable, "-m", "snakemake", *words],
        cwd=project.folder, env=environment, umask=umask, text=True, encoding="utf-8", check=False,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=120,
    )  # fmt: skip


def check_nothing_is_half_written(project, expected):
    """All results are whole, and there is no temporary file; the manifest depends on what exists."""
    assert not list(project.folder.rglob("*.part"))
    found = {name: content for name, content in files_in(project.results).items() if name != "manifest.json"}
    assert found.items() <= expected.items()


def test_bare_environment_and_odd_names_give_identical_files(drawn, project, trials):
    """The path has spaces, umlauts and a newline, the name of the config has the greatest length."""
    config, name = project.folder / "config/tiny.yaml", "n" * LONGEST_NAME
    config.write_text(config.read_text(encoding="utf-8").replace("name: tiny", f"name: {name}"), encoding="utf-8")
    cube = project.folder / CUBE.replace("tiny", name)
    with trials(KIND).case("bare environment"):
        bare = ("HOME", "LANG", "USER", "LOGNAME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME")
        target = str(cube.relative_to(project.folder))
        done = start(project, target, *WORDS, without=bare, umask=0o077, LC_ALL="C")
        assert done.returncode == 0, done.stdout
        assert cube.read_bytes() == drawn[1]["cubes/sho_terms.h5"]
        assert cube.stat().st_mode & 0o777 == 0o600


@needs_root
def test_user_without_passwd_entry_needs_write_access_to_results_alone(drawn, project, tmp_path, trials):
    campaign = trials(KIND)
    project.results.mkdir(parents=True)
    (project.folder / ".snakemake").mkdir()
    for path in (project.folder, *project.folder.rglob("*")):
        path.chmod(path.stat().st_mode & ~0o222)
    for folder in (project.results.parent, project.results, project.folder / ".snakemake"):
        os.chown(folder, STRANGER, STRANGER)
        folder.chmod(0o755)
    home = tmp_path / "home"
    home.mkdir()
    os.chown(home, STRANGER, STRANGER)
    someone = {"before": AS_STRANGER, "HOME": str(home), "USER": "someone"}
    own = ("NEARHARMONIC_CACHE_DIR",)
    with campaign.case("read-only source tree"):
        done = start(project, CUBE, *WORDS, without=own, **someone)
        assert done.returncode == 0, done.stdout
        assert (project.folder / CUBE).read_bytes() == drawn[1]["cubes/sho_terms.h5"]
    (project.folder / CUBE).unlink()
    (project.folder / CUBE).parent.chmod(0o555)
    with campaign.case("read-only folder of results"):
        done = start(project, CUBE, *WORDS, without=own, **someone)
        assert done.returncode == 1
        assert f"{CUBE} cannot be written: Permission denied\n" in done.stdout
        check_nothing_is_half_written(project, drawn[1])


def test_full_disk_is_one_sentence_and_rerun_gives_identical_files(drawn, project, trials):
    expected, campaign = drawn[1], trials(KIND)
    with campaign.case("room for 20000 bytes"):
        done = project.snakemake("fig2", *WORDS, RLIMIT_FSIZE=20_000)
        assert done.returncode == 1
        assert done.stdout.count("results/tiny/figures/fig2_decomposition.pdf cannot be written: File too large\n") == 1
        assert "Traceback" not in done.stdout
        check_nothing_is_half_written(project, expected)
    with campaign.case("room again"):
        done = project.snakemake("fig2", *WORDS)
        assert done.returncode == 0, done.stdout
        assert files_in(project.results) == expected


@needs_prlimit
def test_little_memory_leaves_no_half_written_file(drawn, project, trials):
    """The import or the job that fails depends on the versions of the libraries."""
    with trials(KIND).case("little memory"):
        done = start(project, CUBE, *WORDS, before=("prlimit", f"--as={330 << 20}"))
        assert "SIGSEGV" not in done.stdout
        check_nothing_is_half_written(project, drawn[1])
        assert done.returncode != 0 or (project.folder / CUBE).exists()


def test_clock_set_back_ends_with_a_sentence_about_the_clock(drawn, trials):
    """The cube is dated a day into the future, as if the clock had been right before."""
    project, expected = drawn
    figure = project.results / "figures/fig2_decomposition.svg"
    later = time.time() + 86400
    os.utime(project.folder / CUBE, (later, later))
    figure.unlink()
    with trials(KIND).case("clock set back"):
        done = project.snakemake("fig2", *WORDS)
        assert done.returncode == 1
        assert "older modification time" in done.stdout
        assert CUBE in done.stdout
        check_nothing_is_half_written(project, expected)
