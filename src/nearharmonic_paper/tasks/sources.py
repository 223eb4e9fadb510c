"""Source files of the packages: imports of each module, and digests that do not depend on docstrings and comments."""

from __future__ import annotations

import ast
import atexit
import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from nearharmonic.core import disk
from nearharmonic.errors import NearharmonicError, SettingError
from nearharmonic.registry import is_file

Node = TypeVar("Node")

#: Packages whose sources count, and their common folder.
PACKAGES = ("nearharmonic", "nearharmonic_paper", "nearharmonic_studies")
PACKAGE = PACKAGES[0]
ROOT = Path(__file__).parents[2]
#: Maximum number of entries of the cache on disk, 150 bytes each. A larger cache is cleared.
MOST_CACHED = 3000


class Source(NamedTuple):
    """One source file: ``digest`` of its syntax tree, and the dotted names that it ``imports`` from the package."""

    digest: str
    imports: tuple[str, ...]


def closure(*modules: str, root: Path | None = None) -> tuple[str, ...]:
    """Return ``modules`` and every module of the package that they import, directly or not, sorted.

    The ``__init__`` of the package is excluded: it imports all layers for their names, and computes nothing.
    """
    return _files(root).closure(modules)


def reached(starts: Iterable[Node], following: Callable[[Node], Iterable[Node]]) -> set[Node]:
    """Return ``starts`` and all that follows from them, directly or not."""
    found: set[Node] = set()
    waiting = list(starts)
    while waiting:
        one = waiting.pop()
        if one not in found:
            found.add(one)
            waiting += following(one)
    return found


def module_digest(module: str, root: Path | None = None) -> str:
    """Return the SHA-256 of the syntax tree of ``module`` without docstrings and comments."""
    return _files(root).source(module).digest


def read_source(path: Path) -> Source:
    """Return digest and imports of any Python file in its present state."""
    return _running().parse(path.read_bytes())


def module_of(name: str) -> str | None:
    """Return the module of the running package that a dotted name denotes or belongs to; None if there is none."""
    for module in (name, above(name)):
        if module and path_of(module, ROOT).is_file():
            return module
    return None


def path_of(module: str, root: Path) -> Path:
    """Return the file of the dotted name ``module`` of a package in the folder ``root``."""
    path = root.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


class _Files:
    """The modules of a package, each read once: thousands of jobs ask for the same."""

    def __init__(self, root: Path, parse: Callable[[bytes], Source]) -> None:
        self._root, self.parse = root, parse
        self.source, self.closure, self._imported = cache(self._source), cache(self._closure), cache(self._imports)
        self._is_module = cache(lambda name: path_of(name, root).is_file())

    def _closure(self, modules: tuple[str, ...]) -> tuple[str, ...]:
        found = reached(modules, lambda name: [] if name in PACKAGES else [above(name), *self._imported(name)])
        return tuple(sorted(found - {*PACKAGES}))

    def _source(self, module: str) -> Source:
        path = path_of(module, self._root)
        if not path.is_file():
            message = f"no module {module!r} in {self._root}"
            raise NearharmonicError(message)
        return self.parse(path.read_bytes())

    def _imports(self, module: str) -> list[str]:
        """Return the modules of the package that ``module`` imports; an imported name may be that of a function."""
        is_package = path_of(module, self._root).name == "__init__.py"
        folders = (module if is_package else above(module)).split(".")
        found = []
        for written in self.source(module).imports:
            name = written.lstrip(".")
            level = len(written) - len(name)
            if level:
                name = ".".join([*folders[: len(folders) - level + 1], *([name] if name else [])])
            if name.split(".")[0] in PACKAGES:
                found += [place for place in (name, above(name)) if place and self._is_module(place)]
        return found


def above(name: str) -> str:
    """Return a dotted name without its last part."""
    return name.rpartition(".")[0]


def _files(root: Path | None) -> _Files:
    return _running() if root is None else _Files(root, parsed)


@cache
def _running() -> _Files:
    return _Files(ROOT, SourceCache().parsed)


class SourceCache:
    """On-disk cache of parsed sources, by the SHA-256 of their text.

    Parsing the package takes 0.3 s, reading the cache 10 ms. The file is in the folder of compiled code, which is
    writable only for the user. Its name depends on the text of this module and on the version of Python. It is written
    at the end of the process.
    """

    def __init__(self) -> None:
        version = sha256(Path(__file__).read_bytes() + sys.version.encode()).hexdigest()
        self._place = disk.place_of(f"sources-{version[:32]}")
        kept = disk.read(self._place) if self._place else None
        self._known: dict[str, list[Any]] = json.loads(kept[1]) if kept else {}
        self._met: dict[str, Source] = {}

    def parsed(self, text: bytes) -> Source:
        """Return the result of the function :func:`parsed`, from the cache if possible."""
        key = sha256(text).hexdigest()
        if key in self._known:
            digest, imports = self._known[key]
            return Source(digest, tuple(imports))
        if not self._met:
            atexit.register(self.keep)
        return self._met.setdefault(key, parsed(text))

    def keep(self) -> None:
        """Write the cache: all entries, or only the new ones if there are more than :data:`MOST_CACHED`."""
        if self._place:
            known = self._known if len(self._known) < MOST_CACHED else {}
            disk.write(self._place, "sources", json.dumps({**known, **self._met}).encode())


@cache
def parsed(text: bytes) -> Source:
    """Return digest and imports of a source file."""
    tree = ast.parse(text)
    imports = tuple(sorted(_imports(tree)))
    return Source(_digest(tree), imports)


def _digest(tree: ast.Module) -> str:
    for node in [*_statements(tree)]:
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and ast.get_docstring(
            node, clean=False
        ):
            del node.body[0]
    return sha256(ast.dump(tree).encode()).hexdigest()


def _imports(tree: ast.AST) -> set[str]:
    """Yield imported names, except those under TYPE_CHECKING; a relative name keeps its dots."""
    names: set[str] = set()
    for node in _statements(tree, skip=_is_for_type_checker):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = "." * node.level + (node.module or "")
            joint = "." if node.module else ""
            names.update([base, *(f"{base}{joint}{alias.name}" for alias in node.names)])
    return names


def _is_for_type_checker(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def _statements(tree: ast.AST, skip: Callable[[ast.AST], bool] = lambda _: False) -> Iterator[ast.AST]:
    """Yield ``tree`` and all its statements, at any depth. Expressions, which are most nodes, are not visited."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        if not skip(node):
            yield node
            for part in ("body", "orelse", "finalbody", "handlers", "cases"):
                waiting += getattr(node, part, ())


# --- Digests of users' Python files, and of the modules that they import from their folder.
def files_of(place: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Return a user's file, followed by the sorted files in its folder that it imports, directly or indirectly.

    Files that it reads in another way, for example with ``open``, are not included.
    """
    first = Path(place)
    return first, *sorted(reached([first], partial(_beside, first.parent)) - {first})


def _beside(folder: Path, path: Path) -> Iterator[Path]:
    """Return the files below ``folder`` that a file there imports."""
    package = path.parent if path.parent != folder else folder
    for written in _source(path).imports:
        name = written.lstrip(".")
        level = len(written) - len(name) - 1
        if level > len(package.parents):
            continue
        above = package.parents[level - 1] if level > 0 else package
        start = above if written.startswith(".") else folder
        parts = name.split(".") if name else []
        for end in range(1, len(parts) + 1):
            stem = start.joinpath(*parts[:end])
            beside = (stem.with_suffix(".py"), stem / "__init__.py")
            yield from (one for one in beside if one.is_relative_to(folder) and is_file(one))


def package_modules_of(place: str | os.PathLike[str]) -> set[str]:
    """Return the dotted names of this package that a user's file and its imported files import.

    A name may also be that of a function or class.
    """
    written = (name for path in files_of(place) for name in _source(path).imports)
    return {name for name in written if name.split(".")[0] in PACKAGES}


def digest_of(place: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of the syntax trees of the files of :func:`files_of` without docstrings and comments."""
    first, *others = files_of(place)
    digest = sha256(_source(first).digest.encode())
    for path in others:
        digest.update(f"{path.relative_to(first.parent).as_posix()} {_source(path).digest}\n".encode())
    return digest.hexdigest()


def _source(path: Path) -> Source:
    if not is_file(path):
        raise SettingError(f"{path} is no file")
    try:
        return read_source(path)
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError) as error:
        message = f"{path} cannot be read: {error}"
        raise SettingError(message) from error
