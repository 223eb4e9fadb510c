"""Plant mistakes in the sources one by one, and tell which test catches each.

The mistakes are in ``*.toml`` beside this file. Each is planted in a scratch work tree of the last commit, and the
tests of its room run until one fails: those that run by default, then the slow ones. A line of JSON says what caught
it. The checkout itself is never changed. No name here begins with ``test_``, so that pytest collects nothing.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryDirectory

HERE, ROOT = Path(__file__).resolve().parent, Path(__file__).resolve().parents[2]
PYTEST = (sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider")
SLOW = ["-m", "slow and not long and not reproduction and not browser and not slurm"]
ROOMS = tomllib.loads((HERE / "rooms.toml").read_text("utf-8"))
Entry = dict[str, str]


def entries() -> list[Entry]:
    """Return all mistakes."""
    files = [tomllib.loads(path.read_text("utf-8")) for path in sorted(HERE.glob("*.toml"))]
    return [one for file in files for one in file.get("mistake", [])]


def sources(tree: Path) -> Iterator[Path]:
    """Yield the files of a work tree in which mistakes are planted."""
    yield tree / "Snakefile"
    for folder, endings in (("src", {".py"}), ("benchmarks", {".py"}), ("workflow", {".smk", ".py", ".yaml"})):
        yield from (path for path in sorted((tree / folder).rglob("*")) if path.suffix in endings)


def place(entry: Entry, tree: Path) -> tuple[Path, str] | None:
    """Return the file that holds ``before`` and its text with ``after``; None unless there is exactly one such place.

    White space may differ: a line may be broken or indented in another way.
    """
    pattern = re.compile(r"\s+".join(map(re.escape, entry["before"].split())))
    texts = ((path, path.read_text("utf-8")) for path in sources(tree))
    hits = [(path, text, *hit.span()) for path, text in texts for hit in pattern.finditer(text)]
    if len(hits) != 1:
        return None
    ((path, text, begin, end),) = hits
    line = text[text.rfind("\n", 0, begin) + 1 : begin]
    indent = line[: len(line) - len(line.lstrip())]
    return path, text[:begin] + entry["after"].strip("\n").replace("\n", f"\n{indent}") + text[end:]


def tests_in(names: str, tree: Path) -> list[Path]:
    """Return the test files in the folders ``names``, wherever they are now."""
    paths = [tree / "tests" / folder / name for name in names.split() for folder in ROOMS["folders"]]
    files = [file for path in paths for file in (path.rglob("test_*.py") if path.is_dir() else [path])]
    return sorted({file for file in files if file.is_file()})


def first_failure(tree: Path, words: list[str], seconds: float) -> str:
    """Return the first test that fails, ``"time"`` if none does in time, ``""`` if none fails."""
    environment = os.environ | {"PYTHONPATH": str(tree / "src"), "PYTEST_ADDOPTS": ""}
    with (tree / "printed.txt").open("w+") as printed:
        pipes = {"stdin": subprocess.DEVNULL, "stdout": printed, "stderr": subprocess.STDOUT}
        process = subprocess.Popen([*PYTEST, *words], cwd=tree, env=environment, start_new_session=True, **pipes)
        try:
            status = process.wait(max(seconds, 1.0))
        except subprocess.TimeoutExpired:
            return "time"
        finally:
            with suppress(ProcessLookupError):  # what tests have started ends too
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        printed.seek(0)
        found = re.search(r"^(?:FAILED|ERROR) (tests/\S+?\.py(?:::.*?)?)(?: - .*)?$", printed.read(), re.MULTILINE)
    return found[1] if found else "" if status in {0, 5} else "pytest"  # 5: no test has such marks


class Scratch:
    """A work tree of its own, in which one mistake after another is planted."""

    def __init__(self, tree: Path, chosen: argparse.Namespace, before: dict[str, Entry]) -> None:
        self.tree, self.chosen, self.before, self.fails = tree, chosen, before, dict[str, bool]()

    def judge(self, entry: Entry) -> str:
        """Return a line that says what catches a mistake: ``default`` or ``slow`` tests, ``no`` test; or ``lost``."""
        begin, found = time.monotonic(), place(entry, self.tree)
        caught, test = ("lost", "") if found is None else self._caught(entry, *found)
        told = {"id": entry["id"], "room": entry["room"], "kind": entry["kind"], "caught": caught, "test": test}
        return json.dumps(told | {"seconds": round(time.monotonic() - begin, 1)})

    def _caught(self, entry: Entry, path: Path, text: str) -> tuple[str, str]:
        end, sound = time.monotonic() + self.chosen.limit, path.read_text("utf-8")
        for kind, words in self._runs(entry, path.stem):
            while test := self._with(path, sound, text, words, end - time.monotonic()):
                if test == "time" or not self._fails_anyway(test):
                    return ("time" if test == "time" else kind), test
                words += ["--deselect", test]
        return "no", ""

    def _runs(self, entry: Entry, stem: str) -> Iterator[tuple[str, list[str]]]:
        """Yield what to give to pytest: what caught it before, tests that name its module, others, slow ones."""
        before = self.before.get(entry["id"], {"test": "", "caught": "no"})
        name = before["test"].partition("::")[2].partition("[")[0]
        known = [
            file for file in self.tree.glob("tests/**/test_*.py") if name and f"def {name}(" in file.read_text("utf-8")
        ]
        names, more = ROOMS.get(entry["room"]) or (f"{entry['room']} {ROOMS['experiment'][0]}", ROOMS["experiment"][1])
        own, far = tests_in(names, self.tree), tests_in(more, self.tree)
        mentions = {file: len(re.findall(rf"\b{stem}\b", file.read_text("utf-8"))) for file in own}
        near = sorted(filter(mentions.get, own), key=lambda file: -mentions[file])
        rest = [file for file in own if file not in near]
        runs = [("default", near, []), ("default", rest, []), ("slow", near + rest + far, SLOW)]
        yield from ((before["caught"], [str(file), "-k", name, "-m", ""]) for file in known)
        for kind, files, marks in runs[: 2 if self.chosen.default else 3]:
            if files:
                yield kind, [*map(str, files), *marks]

    def _with(self, path: Path, sound: str, text: str, words: list[str], seconds: float) -> str:
        path.write_text(text, "utf-8")
        try:
            return first_failure(self.tree, words, seconds)
        finally:
            path.write_text(sound, "utf-8")

    def _fails_anyway(self, test: str) -> bool:
        if test not in self.fails:
            self.fails[test] = test != "pytest" and bool(first_failure(self.tree, [test, "-m", ""], 600))
        return self.fails[test]


@contextmanager
def scratch_tree() -> Iterator[Path]:
    """Yield a work tree of the last commit, which goes afterwards."""
    with TemporaryDirectory(prefix="mistakes-") as folder:
        tree = Path(folder, "tree")
        subprocess.run(["git", "worktree", "add", "-q", "--detach", str(tree)], cwd=ROOT, check=True)
        try:
            yield tree
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", str(tree)], cwd=ROOT, check=False)


def results_in(path: Path) -> dict[str, Entry]:
    """Return the lines of a file of results, by the ids of mistakes."""
    lines = path.read_text("utf-8").splitlines() if path.exists() else []
    return {one["id"]: one for one in map(json.loads, lines)}


def main() -> None:
    """Judge the mistakes that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="ID", help="these mistakes")
    parser.add_argument("--room", nargs="+", metavar="ROOM", help="the mistakes of these rooms")
    parser.add_argument("--list", action="store_true", help="list the mistakes, and which have lost their place")
    parser.add_argument("--default", action="store_true", help="leave out the slow tests")
    parser.add_argument("--jobs", type=int, default=1, help="mistakes at a time")
    parser.add_argument("--limit", type=float, default=900, help="seconds for a mistake")
    parser.add_argument("--results", type=Path, default=os.devnull, help="file of lines; what it has is not run again")
    parser.add_argument(
        "--before", type=Path, default=os.devnull, help="earlier results: what caught a mistake runs first"
    )
    chosen = parser.parse_args()
    asked = [one for one in entries() if one["id"] in (chosen.only or [one["id"]])]
    asked = [one for one in asked if one["room"] in (chosen.room or [one["room"]])]
    if chosen.list:
        for one in asked:
            print(f"{'' if place(one, ROOT) else 'lost':5}{one['room']:17}{one['id']:34}{one['what']}")
        return
    done, before = results_in(chosen.results), results_in(chosen.before)
    free = SimpleQueue[Scratch]()

    def judged(entry: Entry) -> str:
        scratch = free.get()
        try:
            return scratch.judge(entry)
        finally:
            free.put(scratch)

    with ExitStack() as stack, ThreadPoolExecutor(chosen.jobs) as pool:
        for _ in range(chosen.jobs):
            free.put(Scratch(stack.enter_context(scratch_tree()), chosen, before))
        for future in as_completed([pool.submit(judged, one) for one in asked if one["id"] not in done]):
            print(future.result(), flush=True)
            with chosen.results.open("a", encoding="utf-8") as file:
                file.write(f"{future.result()}\n")


if __name__ == "__main__":
    main()
