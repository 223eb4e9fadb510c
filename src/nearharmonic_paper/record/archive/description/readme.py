"""The README of an archive."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import PurePosixPath

from nearharmonic.output.page import pipes
from nearharmonic_paper.record.archive.description.member import Member
from nearharmonic_paper.record.archive.description.summary import Run

#: Descriptions of the files and folders of an archive; missing ones are not mentioned.
PLACES = {
    "report.html": "the page: claims, figures, tables; opens in a browser without a network",
    "cubes": "HDF5 cubes of errors and derived quantities; xarray opens them with the engine h5netcdf",
    "tables": "tables as CSV (every digit), Markdown and LaTeX; `tables/claims.json` holds the claims",
    "figures": "figures as PDF, SVG and PNG",
    "derived": "coefficients that the workflow derived",
    "runs": "trajectories",
    "user_files": "Python files of systems and integrators that the config names",
    "Snakefile": "the workflow, as it was installed when this archive was written",
    "workflow": "rules, scripts and schema of the workflow",
    "config.json": "the settings of the newest run that ended well, as resolved",
    "history.jsonl": "every run of the workflow, one JSON object a line",
    "manifest.json": "size and digest of every result file, with the code that made it",
    "CITATION.cff": "how to cite the software and the paper",
    "LICENSE": "the licence",
    ".zenodo.json": "title, creators, licence and keywords for a deposit at Zenodo",
}


def readme(result: str, members: Sequence[Member], runs: Sequence[Run], left_out: int) -> bytes:
    """Return the README, Markdown in UTF-8.

    The arguments are those of
    :func:`nearharmonic_paper.record.archive.description.metadata.metadata`, without the metadata.
    """
    counts = Counter(PurePosixPath(member.path).parts[0] for member in members)
    folders = {PurePosixPath(member.path).parts[0] for member in members if "/" in member.path}
    rows = [
        (f"`{name}/` (files: {counts[name]})" if name in folders else f"`{name}`", words)
        for name, words in PLACES.items()
        if name in counts
    ]
    newest = runs[-1]
    lines = [
        f"# nearharmonic results: {result}",
        "",
        f"Results of the nearharmonic workflow (runs: {len(runs)}). The newest run started at {newest['start']} "
        f"(commit {newest['commit'] or 'unknown'}).",
        "",
        *pipes(["file", "content"], rows),
        "",
        "The archive is an RO-Crate 1.1 with the profile Workflow Run Crate 0.5. `ro-crate-metadata.json` gives the "
        "size and the SHA-256 of each file, and for each run its settings, its software and its files. "
        "`ro-crate-preview.html` shows the same in a browser, without a network.",
        "",
        *(
            [f"Trajectories, below `runs/` in `manifest.json`, are not in this archive (files: {left_out}).", ""]
            if left_out
            else ()
        ),
        "- Check the archive: `nearharmonic verify FILE.zip`.",
        "- Run again with the same settings: `snakemake -j2 --configfile config.json`.",
        "",
    ]
    return "\n".join(lines).encode()
