"""Commands that make a result file again, for messages about a file that is missing or damaged."""

from __future__ import annotations

import json
import os
from pathlib import Path
from shlex import quote

from nearharmonic.errors import ResultFileError
from nearharmonic.output.reading import read_text

#: Config of ``snakemake`` without ``--configfile``.
DEFAULT_CONFIG = "config/config.yaml"


def unusable(path: str | os.PathLike[str], complaint: str) -> ResultFileError:
    """Return the error about a file that cannot be used, with the command that makes it again."""
    return ResultFileError(f"{path} {complaint}. Make it again: {command_for(path)}")


def command_for(path: str | os.PathLike[str]) -> str:
    """Return the command that makes a result file again, with the config for ``results/<name>``."""
    return f"{workflow_command(path)} --force {quote(os.fspath(path))}"


def workflow_command(path: str | os.PathLike[str]) -> str:
    """Return the command that updates the results of a file, with their config."""
    parts = Path(path).parts
    if "results" not in parts[:-1]:
        return "snakemake -j2"
    end = parts.index("results") + 2
    configs = _configs_of(Path(*parts[:end]))
    return (
        "snakemake -j2"
        if configs == [DEFAULT_CONFIG]
        else f"snakemake -j2 --configfile {' '.join(map(quote, configs))}"
    )


def _configs_of(folder: Path) -> list[str]:
    """Return the config files of the results in ``folder``, or that of their name if they are unknown."""
    try:
        said = json.loads(read_text(folder / "manifest.json"))["configfiles"]
        return usable_configs(said, folder) or [_guess(folder)]
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return [_guess(folder)]


def _guess(folder: Path) -> str:
    return DEFAULT_CONFIG if folder.name == "paper" else f"config/{folder.name}.yaml"


def usable_configs(recorded: object, folder: Path) -> list[str]:
    """Return the recorded config files of the results in ``folder``; none if one of them may do harm in a command.

    A config among the results could name Python files among the results, and a name with a minus is an option.
    """
    if not isinstance(recorded, list) or not all(isinstance(one, str) for one in recorded):
        return []
    inside = folder.resolve().parent
    harmful = any(one.startswith("-") or Path(os.path.realpath(one)).is_relative_to(inside) for one in recorded)
    return [] if harmful else recorded
