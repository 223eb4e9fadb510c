"""``nearharmonic new``: writes a commented Python file of a system or an integrator, which runs and can be edited."""

from __future__ import annotations

import argparse
import importlib.util
import sys
from pathlib import Path

from nearharmonic.output.answers import Answer

HELP = "write a commented file to fill in, of a system or an integrator"
KINDS = ("system", "integrator")
#: Templates of the files, with PLACEHOLDER in place of the name.
TEMPLATES = Path(__file__).parent / "templates"
PLACEHOLDER = "NAME"
#: Commands that run the file without changes.
EXAMPLES = {
    "system": "nearharmonic recommend {} --error 1e-6",
    "integrator": "nearharmonic recommend sho --error 1e-6 --methods {},ruth",
}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("kind", help=" or ".join(KINDS))
    parser.add_argument("name", metavar="NAME", help="its name: a letter, then letters, digits and _")
    parser.add_argument("-o", "--output", metavar="FILE.py", help="file to write (default NAME.py)")


def answer(chosen: argparse.Namespace) -> Answer:
    """Write the file, and return its path and a command that runs it."""
    from nearharmonic.engine.settings import one_of
    from nearharmonic.output.atomic import write_text

    kind = one_of("kind", chosen.kind, KINDS)
    place = _target(chosen.name, chosen.output)
    _check_name(kind, chosen.name, place)
    written = place.as_posix()
    text = (TEMPLATES / f"{kind}.py").read_text(encoding="utf-8")
    write_text(place, text.replace(f"{PLACEHOLDER}.py", written).replace(PLACEHOLDER, chosen.name))
    return Answer(header=["file"], rows=[[written]], notes=[f"Run it: {EXAMPLES[kind].format(written)}"])


def _target(name: str, output: str | None) -> Path:
    """Return the file to write: it is new, ends in ``.py``, and its path can be written in the text of the file."""
    from nearharmonic.errors import bad_setting

    place = Path(f"{name}.py" if output is None else output)
    key, value = ("NAME", name) if output is None else ("-o", output)
    if place.suffix != ".py" or not str(place).isprintable() or '"' in str(place):
        raise bad_setting(key, value, "a file with the ending .py, of printable letters other than quotes")
    if place.exists() or place.is_symlink():
        raise bad_setting(key, value, f"{place} exists already, and is not overwritten")
    return place


def _check_name(kind: str, name: str, place: Path) -> None:
    """Refuse a name that is not valid in Python and in a config, is registered, or hides a module of Python."""
    from nearharmonic.errors import bad_setting
    from nearharmonic.integrators import integrators
    from nearharmonic.systems import systems
    from nearharmonic_paper.config import check_name

    check_name(PLACEHOLDER, name)
    registered = {"system": systems.registered, "integrator": integrators.registered}[kind]
    if name in registered:
        raise bad_setting(PLACEHOLDER, name, f"a registered {kind} has this name: choose another")
    if _is_module(place.stem, place.parent.resolve()):
        key, value = (PLACEHOLDER, name) if place.stem == name else ("-o", str(place))
        allowed = f"scripts beside {place.name} would import it in place of the module {place.stem}: choose another"
        raise bad_setting(key, value, allowed)


def _is_module(name: str, folder: Path) -> bool:
    """Return True if ``import name`` finds a module outside ``folder``."""
    if name in sys.stdlib_module_names:
        return True
    found = importlib.util.find_spec(name) if name.isidentifier() else None
    own = {folder / f"{name}.py", folder / name / "__init__.py"}
    return found is not None and found.origin is not None and Path(found.origin).resolve() not in own
