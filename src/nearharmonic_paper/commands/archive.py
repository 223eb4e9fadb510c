"""``nearharmonic archive``: a result as one zip file, an RO-Crate."""

from __future__ import annotations

import argparse

from nearharmonic.output.table import Answer

HELP = "write a result to one zip file, an RO-Crate with the digests and the runs"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("result", help="folder of a result, or its name below results/")
    parser.add_argument("-o", "--output", metavar="FILE.zip", help="file to write (default NAME.zip)")
    parser.add_argument("--with-runs", action="store_true", help="with the trajectories")


def answer(chosen: argparse.Namespace) -> Answer:
    """Return path and size of the archive; the status is 1, with the reasons, if the result cannot be archived."""
    from nearharmonic_paper.record import archive as pack
    from nearharmonic_paper.record.manifest import folder_of

    folder = folder_of(chosen.result)
    place = pack.target(folder, chosen.output)
    reasons = pack.reasons_against(folder)
    if reasons:
        return Answer(header=["fault"], rows=[[reason] for reason in reasons], status=1)
    saved = pack.save(folder, place, with_runs=chosen.with_runs)
    return Answer(header=["archive", "bytes"], rows=[[str(saved), saved.stat().st_size]])
