"""Writers of texts: a failure leaves the old file unchanged, and no other file.

Those of HDF5 files and of figures have tests beside their own, in tests/library/output/test_store.py and
tests/library/plotting/test_style.py.
"""

import resource
from contextlib import contextmanager

import pytest

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
