"""The subcommands of ``nearharmonic``.

A module of a package of commands is the command of its name, an underscore standing for a hyphen, and has the
attributes of a :class:`Command`; or it has several, by name in ``COMMANDS``, and :data:`SEVERAL` lists them. Slow
imports are inside of ``answer``, because ``nearharmonic --help`` imports all modules.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from nearharmonic.output.table import Answer

#: Modules with several commands, and the names of these: a command line imports only the module that it needs.
SEVERAL = {"methods": ("export", "list", "new", "verify-tableau"), "choice": ("recommend", "tailor")}


class Command(NamedTuple):
    """A subcommand: one line of help, a function that adds its arguments to a parser, and one that answers them."""

    HELP: str
    arguments: Callable[[ArgumentParser], None]
    answer: Callable[[Namespace], Answer]
