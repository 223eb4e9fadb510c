"""``nearharmonic adopt``: mark results from another machine as up to date."""

from __future__ import annotations

import argparse
import sys

from nearharmonic.output.answers import Answer
from nearharmonic.output.table import printable
from nearharmonic_paper.commands.verify import TRUST

HELP = "take results that were copied here as up to date, after they were verified"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("result", help="a folder of results in results/, or its name")
    parser.add_argument("--configfile", metavar="FILE", help="its config (default: the one that it was made with)")
    parser.add_argument("--trust", metavar="FILE", action="append", default=[], help=TRUST)


def answer(chosen: argparse.Namespace) -> Answer:
    """Return the number of adopted files; the status is 1 if the results are refused."""
    from nearharmonic.errors import RefusedError
    from nearharmonic_paper.record.manifest import check_trusted, folder_of
    from nearharmonic_paper.record.verify import adopt

    folder = folder_of(chosen.result)
    check_trusted(folder, chosen.trust)
    try:
        number, reason = adopt(folder, chosen.configfile), ""
    except RefusedError as refusal:
        number, reason = 0, str(refusal)
        sys.stderr.write(printable(f"nearharmonic: {refusal}\n"))
    return Answer(
        header=["result", "files", "reason"],
        rows=[] if reason else [[str(folder), number, ""]],
        document={"result": str(folder), "adopted": not reason, "files": number, "reason": reason},
        status=1 if reason else 0,
    )
