"""Durations of the runs of the workflow: one bar for each run of the history."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh import models as bokeh
from bokeh.models import Plot

from nearharmonic.reproduction.report.plots import panels
from nearharmonic.reproduction.report.shown.wording import moment, told

#: Status of a run -> colour of its bar.
COLOURS = {"ok": "#2f6db5", "failed": "#c0392b", "killed": "#8a6d00"}
#: Maximum number of bars on the chart; older runs are only in the table.
_MOST = 60


def durations(runs: Sequence[Mapping[str, Any]]) -> Plot:
    """Draw the durations of ``runs``, lines of a history from the oldest; runs without a duration are omitted."""
    chosen = [(i, run) for i, run in enumerate(runs, start=1) if run.get("duration") is not None][-_MOST:]
    number, seconds = [i for i, _ in chosen], [run["duration"] for _, run in chosen]
    along = panels.span([[i - 0.6 for i in number], [i + 0.6 for i in number]], logarithmic=False)
    upward = panels.span([[0, *seconds]], logarithmic=False)
    upward.start = 0.0
    plot = panels.new_plot((along, upward), ("run, oldest first", "duration (s)"), height=260)
    plot.below[0].ticker = bokeh.SingleIntervalTicker(interval=max(1, len(chosen) // 10), num_minor_ticks=0)
    source = panels.source_of(
        number=number,
        seconds=seconds,
        colour=np.array([COLOURS.get(str(run.get("status")), "#6b6b6b") for _, run in chosen], dtype=str),
        start=np.array([moment(run.get("start")) for _, run in chosen], dtype=str),
        targets=np.array([told(run.get("targets")) for _, run in chosen], dtype=str),
        status=np.array([told(run.get("status")) for _, run in chosen], dtype=str),
        jobs=np.array([told(run.get("jobs_run")) for _, run in chosen], dtype=str),
    )
    place = {"x": "number", "top": "seconds", "width": 0.7}
    bars = panels.add(plot, source, bokeh.VBar(fill_color="colour", line_color=None, **place))
    rows = [
        ("run", "@number"),
        ("began", "@start"),
        ("targets", "@targets"),
        ("duration", "@seconds{%.2f} s"),
        ("jobs run", "@jobs"),
    ]
    panels.add_hover(plot, [bars], [*rows, ("status", "@status")])
    return plot
