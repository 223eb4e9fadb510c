"""The subcommands of ``nearharmonic``: modules of this package have them, by name in ``COMMANDS``.

Slow imports are inside of ``answer``, because ``nearharmonic --help`` imports all modules.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from nearharmonic.output.table import Answer

#: Modules of this package, and the names of their commands: a command line imports only the module that it needs.
MODULES = {"methods": ("export", "list", "new", "verify-tableau"), "choice": ("recommend", "tailor")}


class Command(NamedTuple):
    """A subcommand: one line of help, a function that adds its arguments to a parser, and one that answers them."""

    HELP: str
    arguments: Callable[[ArgumentParser], None]
    answer: Callable[[Namespace], Answer]
