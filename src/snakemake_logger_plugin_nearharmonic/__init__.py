"""Plugin of Snakemake that checks the files of ``--configfile`` before Snakemake reads them; the profiles ask for it.

A logger is the only plugin that Snakemake creates so early. Snakemake's own reader of configs runs the Python in
templates, ends with a traceback for files that are no text or too deep, and takes forever for aliases of aliases.
"""

from __future__ import annotations

import argparse
import logging
import sys

from snakemake_interface_logger_plugins.base import LogHandlerBase


class LogHandler(LogHandlerBase):
    """A logger that prints nothing: the one of Snakemake stays in use."""

    writes_to_stream = False
    writes_to_file = False
    has_filter = True
    has_formatter = True
    needs_rulegraph = False

    def __post_init__(self) -> None:
        """Check the config files, and end with status 2 if one is no config."""
        from nearharmonic_paper.config.refusal import refuse_unreadable

        self.setLevel(logging.CRITICAL + 1)
        refuse_unreadable(configfiles(sys.argv[1:]))

    def emit(self, record: logging.LogRecord) -> None:
        """Print nothing."""


def configfiles(words: list[str]) -> list[str]:
    """Return the values of ``--configfile`` among the words of a command of Snakemake."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--configfile", "--configfiles", nargs="+", default=[])
    return list(parser.parse_known_args(words)[0].configfile)
