"""Writers of texts: a failure leaves the old file unchanged, and no other file; no module writes a file in place.

Those of HDF5 files and of figures have tests beside their own, in tests/library/output/test_store.py and
tests/library/plotting/test_style.py.
"""

from __future__ import annotations

import ast
import resource
from contextlib import contextmanager
from pathlib import Path

import pytest

import nearharmonic
from nearharmonic.errors import FileWriteError
from nearharmonic.output import table
from nearharmonic.output.atomic import write_text

#: Writer -> a function of (folder, content) that writes its files there; another content makes other bytes.
TEXTS = {
    "a table": lambda folder, number: table.save(
        table.Table(header=("x", "y"), rows=[("long " * 20, number)], caption="A note."),
        [folder / f"table.{suffix}" for suffix in table.SUFFIXES],
    ),
    "a document": lambda folder, number: table.save_document({"x": number, "y": "long " * 20}, folder / "found.toml"),
    "a text": lambda folder, number: write_text(folder / "manifest.json", "long " * 20 + str(number)),
}


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@contextmanager
def full_disk(size):
    """No file may grow beyond ``size`` bytes: what fits is written, and then the write fails, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("writer", TEXTS)
def test_full_disk_leaves_old_files_and_no_partial_file(tmp_path, writer):
    write = TEXTS[writer]
    write(tmp_path, 1)
    before = contents(tmp_path)
    assert min(map(len, before.values())) > 64
    with full_disk(64), pytest.raises(FileWriteError, match=r"cannot be written: File too large"):
        write(tmp_path, 2)
    assert contents(tmp_path) == before
    write(tmp_path, 2)
    after = contents(tmp_path)
    assert after.keys() == before.keys()
    assert all(after[name] != before[name] for name in before)


#: Modules that write files which no other process reads as results: a job's log, the compiled kernels, which have names
#: of their own and are checked when read, and members of an archive that has a temporary name meanwhile.
OTHER_FILES = {"nearharmonic_paper/tasks/job.py", "nearharmonic/core", "nearharmonic_paper/record/archive.py"}


def writes(node, in_memory=()):
    """True if a call opens or makes a file: Path.open("w"), write_text, savefig, to_csv, h5netcdf.File(..., "w")."""
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    if name in ("open", "File", "savefig") and node.args and ast.unparse(node.args[0]) in {*in_memory, "os.devnull"}:
        return False
    if name in ("open", "File"):
        modes = [*node.args, *(keyword.value for keyword in node.keywords)]
        return any(isinstance(mode, ast.Constant) and str(mode.value)[:1] in {"w", "a", "x"} for mode in modes)
    method = isinstance(node.func, ast.Attribute)  # the function write_text is the one that replaces
    return name in ("savefig", "print_figure", "to_csv", "to_netcdf") or (
        method and name in ("write_text", "write_bytes")
    )


def buffers(tree):
    """The names of variables in ``tree`` that are made as ``BytesIO()``."""
    assigned = (node for node in ast.walk(tree) if isinstance(node, ast.Assign))
    return {ast.unparse(node.targets[0]) for node in assigned if ast.unparse(node.value) == "BytesIO()"}


def unguarded(tree, in_memory, inside=False):
    """The calls in ``tree`` that write a file and do not stand in a ``with replacing(...)``."""
    for node in ast.iter_child_nodes(tree):
        guarded = inside
        if isinstance(node, ast.With):
            calls = [item.context_expr for item in node.items if isinstance(item.context_expr, ast.Call)]
            guarded = inside or any(getattr(call.func, "id", "") == "replacing" for call in calls)
        if isinstance(node, ast.Call) and writes(node, in_memory) and not guarded:
            yield node
        yield from unguarded(node, in_memory, guarded)


ROOT = Path(nearharmonic.__file__).parents[1]
SCRIPTS = Path(__file__).parents[4] / "workflow/scripts"


@pytest.mark.slow
def test_no_module_writes_a_file_in_place():
    walked = [
        path
        for folder in (ROOT, SCRIPTS)
        for path in sorted([*folder.glob("nearharmonic*/**/*.py"), *folder.glob("*.py")])
        if not any(str(path.relative_to(folder)).startswith(place) for place in OTHER_FILES)
    ]
    assert {ROOT / "nearharmonic/output/store.py", SCRIPTS / "task.py"} <= set(walked)
    trees = {str(path): ast.parse(path.read_text(encoding="utf-8")) for path in walked}
    found = {f"{name}: {ast.unparse(call)}" for name, tree in trees.items() for call in unguarded(tree, buffers(tree))}
    assert not found
