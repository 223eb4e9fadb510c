"""The history of a folder of results: one sealed line of JSON for each run of the workflow with executed jobs.

A run writes a marker at its start and removes it at its end. The next start records runs without a live process as
"killed".
"""

from nearharmonic_paper.record.history.lines import HISTORY, Line, Run, append, faulty_lines, lines_of
from nearharmonic_paper.record.history.markers import MARKERS, close_killed, mark, running_in, unmark
from nearharmonic_paper.record.history.runs import (
    doubts_in,
    flattened,
    makers_in,
    newest_finished,
    run_named,
    runs_newest_first,
    runs_of,
)

__all__ = [
    "HISTORY",
    "MARKERS",
    "Line",
    "Run",
    "append",
    "close_killed",
    "doubts_in",
    "faulty_lines",
    "flattened",
    "lines_of",
    "makers_in",
    "mark",
    "newest_finished",
    "run_named",
    "running_in",
    "runs_newest_first",
    "runs_of",
    "unmark",
]
