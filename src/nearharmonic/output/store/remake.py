"""Commands that make a result file again, for messages about a file that is missing or damaged."""

from __future__ import annotations

import json
import os
from pathlib import Path

from nearharmonic.errors import ResultFileError

#: Config of ``snakemake`` without ``--configfile``.
DEFAULT_CONFIG = "config/config.yaml"


def unusable(path: str | os.PathLike[str], complaint: str) -> ResultFileError:
    """Return the error about a file that cannot be used, with the command that makes it again."""
    return ResultFileError(f"{path} {complaint}. Make it again: {command_for(path)}")


def command_for(path: str | os.PathLike[str]) -> str:
    """Return the command that makes a result file again, with the config for ``results/<name>``."""
    return f"{workflow_command(path)} --force {path}"


def workflow_command(path: str | os.PathLike[str]) -> str:
    """Return the command that updates the results of a file, with their config."""
    parts = Path(path).parts
    if "results" not in parts[:-1]:
        return "snakemake -j2"
    end = parts.index("results") + 2
    config = _config_of(Path(*parts[:end]))
    return "snakemake -j2" if config == DEFAULT_CONFIG else f"snakemake -j2 --configfile {config}"


def _config_of(folder: Path) -> str:
    """Return the config file of the results in ``folder``, or that of their name if it is unknown."""
    guess = DEFAULT_CONFIG if folder.name == "paper" else f"config/{folder.name}.yaml"
    try:
        said = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["configfiles"]
        return " ".join(map(str, said)) or guess
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return guess
