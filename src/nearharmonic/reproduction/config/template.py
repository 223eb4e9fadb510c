"""Refusal of configs that are templates: Snakemake runs the Python expressions in them while it reads them."""

from __future__ import annotations

import os
from collections.abc import Mapping

from nearharmonic.errors import SettingError, bad_setting
from nearharmonic.output.reading import read_text

#: Key of a config that makes it a template of ``yte``, a library that Snakemake reads configs with.
SWITCH = "__use_yte__"


def refuse_template(place: str | os.PathLike[str]) -> None:
    """Check that the config in a file is data, before Snakemake reads it.

    Raises
    ------
    SettingError
        It has the key that makes it a template, or is no YAML without tags of Python.
    """
    import yaml

    try:
        found = yaml.safe_load(read_text(place))
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        says = " ".join(str(error).split())
        raise SettingError(f"{os.fspath(place)} cannot be read as a config: {says}") from error
    if isinstance(found, Mapping) and SWITCH in found:
        raise bad_setting(SWITCH, found[SWITCH], f"a config is data, and Snakemake would run Python in {place}")
