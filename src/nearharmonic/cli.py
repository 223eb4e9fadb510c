"""The command ``nearharmonic``: it finds subcommands, parses the command line, and prints an answer or an error."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from difflib import get_close_matches
from functools import partial
from importlib import import_module
from typing import NoReturn, TextIO

from nearharmonic import __version__
from nearharmonic.commands import MODULES, Command
from nearharmonic.errors import FileWriteError, NearharmonicError, SettingError, unknown_name
from nearharmonic.output.table import FORMATS, printable, printed

PROGRAM = "nearharmonic"
#: The module with the subcommands for results, which the library knows by this name alone.
OF_THE_RECORD = "nearharmonic_paper.commands"
#: Exit status of a process that the user has interrupted: 128 plus the number of the signal.
INTERRUPTED = 130

#: The name of a column after a minus sign, which argparse would interpret as an option.
_DESCENDING = re.compile(r"-[a-z_]\w{2,}")


class _Parser(argparse.ArgumentParser):
    """An argument parser that raises errors of the package, for a common message format and exit status."""

    def error(self, message: str) -> NoReturn:
        given = re.match(r"unrecognized arguments: (--[\w-]+)", message)
        nearest = get_close_matches(given[1], re.findall(r"--[\w-]+", self.format_usage()), n=1) if given else []
        hint = f". Did you mean {nearest[0]!r}?" if nearest else "."
        raise SettingError(f"{message}{hint} See: {self.prog} --help")


def command_names() -> tuple[str, ...]:
    """Return the sorted names of the subcommands, of the library and for results."""
    return tuple(sorted(_modules()))


def _modules() -> dict[str, str]:
    """Return the module of each subcommand, by its name."""
    found = {name: f"nearharmonic.commands.{module}" for module, names in MODULES.items() for name in names}
    return found | dict.fromkeys(import_module(OF_THE_RECORD).COMMANDS, OF_THE_RECORD)


def _command(name: str) -> Command:
    found: Command = import_module(_modules()[name]).COMMANDS[name]
    return found


def _top_parser(words: Sequence[str]) -> argparse.ArgumentParser:
    overview = None
    if {"-h", "--help"} & set(words[:1]):  # all commands are imported only for the help text
        names = command_names()
        lines = [f"  {name:<{max(map(len, names))}}  {_command(name).HELP}" for name in names]
        end = f"Exit status: 0 yes, 1 no, 2 bad input. See: {PROGRAM} COMMAND --help"
        overview = "\n".join(["commands:", *lines, "", end])
    top = _Parser(
        prog=PROGRAM,
        description="Near-harmonic symplectic integrators: lists, coefficients, runs and results.",
        epilog=overview,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    top.add_argument("--version", action="version", version=f"{PROGRAM} {__version__}")
    top.add_argument("command", nargs="?", help="one of the commands below")
    top.add_argument("words", nargs=argparse.REMAINDER, metavar="...", help="its own arguments")
    return top


def _parser_of(command: str) -> argparse.ArgumentParser:
    chosen = _command(command)
    description = f"{chosen.HELP[0].upper()}{chosen.HELP[1:]}."
    parser = _Parser(prog=f"{PROGRAM} {command}", description=description, allow_abbrev=False)
    chosen.arguments(parser)
    parser.add_argument("--format", default="table", metavar="FORMAT", help=f"{', '.join(FORMATS)} (default table)")
    return parser


def help_text(command: str | None = None, *, columns: int = 100) -> str:
    """Return the text of ``--help``, of a command or of the program, for a terminal of so many ``columns``."""
    if command is not None and command not in command_names():
        raise unknown_name("command", command, command_names())
    parser = _top_parser(["--help"]) if command is None else _parser_of(command)
    made = partial(parser.formatter_class, width=columns - 2)  # type: ignore[call-arg]  # as argparse computes it
    parser.formatter_class = made
    parser.color = False  # type: ignore[attr-defined]  # since Python 3.14
    return parser.format_help()


def _joined(words: Sequence[str]) -> list[str]:
    """``words`` with ``--sort=-column`` in place of ``--sort -column``, which argparse does not understand."""
    joined: list[str] = []
    for word in words:
        if _DESCENDING.fullmatch(word) and joined and re.fullmatch(r"--[\w-]+", joined[-1]):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command with these words, by default the words of the process.

    The exit status is 0 for yes, 1 for no, 2 for bad input with a message, 130 for an interrupt by the user.
    """
    if sys.stderr is None:  # closed; warnings and bars of progress are written to it without a question
        sys.stderr = open(os.devnull, "w")  # noqa: PTH123, SIM115
    try:
        return _run(sys.argv[1:] if arguments is None else list(arguments))
    except NearharmonicError as error:
        return _refused(error)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] in {*sys.stdlib_module_names, PROGRAM}:
            raise
        return _refused(f"{error.name} is not installed: pip install '{PROGRAM}[workflow]'")
    except OSError as error:
        return _refused(error)
    except KeyboardInterrupt:
        return INTERRUPTED


def _run(words: Sequence[str]) -> int:
    try:
        top = _top_parser(words).parse_args(words)
        if top.command is None:
            raise SettingError(f"a command is missing: one of {', '.join(command_names())}. See: {PROGRAM} --help")
        if top.command not in command_names():
            raise unknown_name("command", top.command, command_names())
        chosen = _parser_of(top.command).parse_args(_joined(top.words))
    except SystemExit as end:  # argparse has printed the help or the version
        _write("")
        return int(end.code or 0)
    from nearharmonic.engine.settings import one_of
    from nearharmonic.registry import trusting_only

    form = one_of("format", chosen.format, FORMATS)
    command, reads_results = _command(top.command), _modules()[top.command] == OF_THE_RECORD
    with trusting_only(getattr(chosen, "trust", ())) if reads_results else nullcontext():  # results never run code
        answer = command.answer(chosen)
    _write(printed(answer, form))
    return int(answer.status)


def _refused(reason: object) -> int:
    """Print why a command is refused, if anybody listens, and return the exit status."""
    try:
        sys.stderr.write(printable(f"{PROGRAM}: {reason}\n"))
    except OSError:
        _drop(sys.stderr)
    return 2


def _write(text: str) -> None:
    """Print ``text``; control characters are escaped, letters that the terminal does not have are question marks.

    A closed output or a full disk raises FileWriteError.
    """
    if sys.stdout is None:
        if text:
            raise FileWriteError("the answer cannot be written: the standard output is closed")
        return
    encoding = sys.stdout.encoding or "utf-8"
    try:
        sys.stdout.write(printable(text).encode(encoding, "replace").decode(encoding))
        sys.stdout.flush()
    except BrokenPipeError:  # the reader, such as head, has closed the pipe
        _drop(sys.stdout)
    except OSError as error:
        _drop(sys.stdout)
        raise FileWriteError(f"the answer cannot be written: {error.strerror}") from error


def _drop(stream: TextIO) -> None:
    """Let what a stream still holds go nowhere, so that the process does not fail at its exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


if __name__ == "__main__":
    sys.exit(main())
