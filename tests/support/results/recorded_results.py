"""Results on which the committed verdicts were decided; ``snakemake -j2 verdicts`` records them."""

from __future__ import annotations

import copy
import zipfile
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from nearharmonic.integrators import plain_integrators
from nearharmonic_paper.claims.claim import Results
from nearharmonic_paper.claims.table import FILES

ARCHIVE = Path(__file__).parents[2] / "paper/claims/recorded.zip"


def unpack(folder: Path) -> Path:
    """Put the recorded files into a folder of results."""
    with zipfile.ZipFile(ARCHIVE) as archive:
        archive.extractall(folder)
    return folder


class HeldResults(Results):
    """Results without files: ``cubes``, ``tables`` (rows of texts) and ``document`` may be changed."""

    def __init__(self, cubes, tables, document):
        super().__init__("nowhere", dict(plain_integrators))
        self.cubes, self.tables, self.document = cubes, tables, document

    def has(self, name):
        stem = Path(name).stem
        return stem in (self.cubes if name.startswith("cubes/") else self.tables) or name.startswith("derived/")

    def _read_cube(self, stem):
        return self.cubes[stem]

    def _read_rows(self, stem):
        return self.tables[stem]

    @property
    def derived(self):
        return self.document


@cache
def _parts():
    with TemporaryDirectory() as folder:
        read = Results(unpack(Path(folder)), dict(plain_integrators))
        stems = {kind: [Path(name).stem for name in FILES if name.startswith(kind)] for kind in ("cubes", "tables")}
        cubes = {stem: read._read_cube(stem) for stem in stems["cubes"]}
        return cubes, {stem: read._read_rows(stem) for stem in stems["tables"]}, read.derived


def held_results():
    """The recorded results in memory, to be changed at will."""
    return HeldResults(*copy.deepcopy(_parts()))
