"""Refusal of config files before Snakemake reads them, and the end of a command for which they are bad input."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NoReturn

from nearharmonic.errors import NearharmonicError, bad_setting
from nearharmonic.output.table import printable
from nearharmonic_paper.config.text import read_mapping

#: Key of a config that makes it a template of ``yte``, a library that Snakemake reads configs with.
SWITCH = "__use_yte__"


def refuse(error: NearharmonicError) -> NoReturn:
    """End with a sentence about bad input and the exit status for it; an error in a Snakefile prints its traceback."""
    sys.stderr.write(printable(f"nearharmonic: {error}\n"))
    sys.exit(2)


def refuse_unreadable(places: Iterable[str | os.PathLike[str]]) -> None:
    """End with the first error of :func:`refuse_template`, or with one about a target among ``places``.

    Snakemake takes all words behind ``--configfile`` for configs.
    """
    try:
        for number, place in enumerate(places):
            if number and not Path(place).exists() and not Path(place).suffix:
                raise bad_setting("--configfile", os.fspath(place), "a file; a target is written before --configfile")
            refuse_template(place)
    except NearharmonicError as error:
        refuse(error)


def warn_of_name(name: str, places: Iterable[str | os.PathLike[str]]) -> None:
    """Warn on standard error of a config, other than the paper's, with the name of the paper's results."""
    if name == "paper" and not any(Path(place).parts[-2:] == ("config", "config.yaml") for place in places):
        effect = "this config replaces its results in results/paper and its pages below docs"
        sys.stderr.write(
            f"nearharmonic: warning: name = 'paper' is that of config/config.yaml, and {effect}: rename it\n"
        )


def refuse_template(place: str | os.PathLike[str]) -> None:
    """Check that the config in a file is data: Snakemake runs the Python expressions of a template while it reads it.

    Raises
    ------
    SettingError
        It has the key that makes it a template, or :func:`read_mapping` finds an error.
    """
    found = read_mapping(place)
    if SWITCH in found:
        raise bad_setting(SWITCH, found[SWITCH], f"a config is data, and Snakemake would run Python in {place}")
