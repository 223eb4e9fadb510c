"""Help texts of the commands, as the program prints them on a terminal of fixed width."""

from __future__ import annotations

from nearharmonic.cli import PROGRAM, command_names, help_text

#: Width of the terminal: lines of this length fit a page of the site.
COLUMNS = 90


def commands_part() -> str:
    """Return a section for the program and for each of its commands."""
    texts = {PROGRAM: help_text(columns=COLUMNS)}
    texts |= {f"{PROGRAM} {name}": help_text(name, columns=COLUMNS) for name in command_names()}
    return "\n".join(f"## {name}\n\n```text\n{text.rstrip()}\n```\n" for name, text in texts.items())
