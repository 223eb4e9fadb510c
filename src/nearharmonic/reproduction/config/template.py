"""Refusal of configs that are templates: Snakemake runs the Python expressions in them while it reads them."""

from __future__ import annotations

import os

from nearharmonic.errors import bad_setting
from nearharmonic.reproduction.config.text import read_mapping

#: Key of a config that makes it a template of ``yte``, a library that Snakemake reads configs with.
SWITCH = "__use_yte__"


def refuse_template(place: str | os.PathLike[str]) -> None:
    """Check that the config in a file is data, before Snakemake reads it.

    Raises
    ------
    SettingError
        It has the key that makes it a template, or :func:`read_mapping` finds an error.
    """
    found = read_mapping(place)
    if SWITCH in found:
        raise bad_setting(SWITCH, found[SWITCH], f"a config is data, and Snakemake would run Python in {place}")
