"""The package's own source files: which module imports which, and a digest of each that rewording does not change."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from nearharmonic.errors import NearharmonicError

PACKAGE = "nearharmonic"
ROOT = Path(__file__).parents[1]


class Source(NamedTuple):
    """One source file: ``digest`` of its syntax tree, and the dotted names that it ``imports`` from the package."""

    digest: str
    imports: tuple[str, ...]


def closure(*modules: str, root: Path | None = None) -> tuple[str, ...]:
    """Return ``modules`` and every module of the package that they import, directly or not, sorted.

    The package's own ``__init__`` is left out: it imports all layers to name them, and computes nothing.

    Raises
    ------
    NearharmonicError
        The package has no such module.
    """
    folder = ROOT if root is None else root
    found: set[str] = set()
    waiting = list(modules)
    while waiting:
        module = waiting.pop()
        if module == PACKAGE or module in found:
            continue
        path = path_of(module, folder)
        if not path.is_file():
            message = f"no module {module!r} in {folder}"
            raise NearharmonicError(message)
        found.add(module)
        waiting += [module.rpartition(".")[0], *_imported(module, folder)]
    return tuple(sorted(found))


def module_digest(module: str, root: Path | None = None) -> str:
    """Return the SHA-256 of the syntax tree of ``module`` without docstrings, and hence without comments."""
    return _source(path_of(module, ROOT if root is None else root)).digest


def path_of(module: str, root: Path) -> Path:
    """Return the file of the dotted name ``module`` in a package whose folder is ``root``."""
    path = root.joinpath(*module.split(".")[1:])
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def _imported(module: str, root: Path) -> Iterator[str]:
    """The modules among the names that ``module`` imports; a name may also be that of a function or class."""
    path = path_of(module, root)
    package = (module if path.name == "__init__.py" else module.rpartition(".")[0]).split(".")
    for written in _source(path).imports:
        name = written.lstrip(".")
        level = len(written) - len(name)
        if level:
            name = ".".join([*package[: len(package) - level + 1], *([name] if name else [])])
        if name.split(".")[0] == PACKAGE:
            yield from (place for place in (name, name.rpartition(".")[0]) if place and path_of(place, root).is_file())


def _source(path: Path) -> Source:
    return _parsed(path.read_bytes())


@cache
def _parsed(content: bytes) -> Source:
    tree = ast.parse(content)
    imports = tuple(sorted(_imports(tree)))
    return Source(_digest(tree), imports)


def _digest(tree: ast.Module) -> str:
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and ast.get_docstring(
            node, clean=False
        ):
            del node.body[0]
    return sha256(ast.dump(tree).encode()).hexdigest()


def _imports(tree: ast.AST) -> set[str]:
    """Names that are imported anywhere but for the type checker alone; a relative one keeps its dots."""
    names: set[str] = set()
    for node in _executed(tree):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = "." * node.level + (node.module or "")
            joint = "." if node.module else ""
            names.update([base, *(f"{base}{joint}{alias.name}" for alias in node.names)])
    return names


def _executed(tree: ast.AST) -> Iterator[ast.AST]:
    """The nodes of ``tree`` except what stands under ``if TYPE_CHECKING``."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            continue
        yield node
        yield from _executed(node)
