"""Where a result comes from: digests of the code behind it, settings, coefficients, versions; no clock goes inside."""

from __future__ import annotations

import ast
import json
import os
import platform
import sys
from collections.abc import Iterable, Iterator, Mapping
from datetime import UTC, datetime
from functools import cache
from hashlib import file_digest, sha256
from pathlib import Path
from typing import Any

import nearharmonic
from nearharmonic.errors import NearharmonicError
from nearharmonic.tableau import Tableau

PACKAGE = "nearharmonic"
ROOT = Path(__file__).parent
#: Libraries whose version may change the last bit of a result or the bytes of its file.
LIBRARIES = ("numpy", "numba", "h5py")


def code_digest(*modules: str, also: Iterable[str] = (), root: Path = ROOT) -> str:
    """SHA-256 over the sources of ``modules`` (dotted names), of all they import within the package, and over ``also``.

    Imports inside functions count. What a registry loads by name does not: say which system's module it is, and pass
    digests of data, such as coefficients, as ``also``.

    Raises:
        NearharmonicError: a module that the package does not have.
    """
    digest = sha256()
    for module in closure(*modules, root=root):
        digest.update(f"{module} {_source_digest(_path_of(module, root))}\n".encode())
    for text in also:
        digest.update(f"+ {text}\n".encode())
    return digest.hexdigest()


def closure(*modules: str, root: Path = ROOT) -> tuple[str, ...]:
    """``modules`` and every module of the package they import, directly or not, sorted.

    The package's own ``__init__`` is left out: it imports all layers to name them, and computes nothing.

    Raises:
        NearharmonicError: a module that the package does not have.
    """
    found: set[str] = set()
    waiting = list(modules)
    while waiting:
        module = waiting.pop()
        if module == PACKAGE or module in found:
            continue
        path = _path_of(module, root)
        if not path.is_file():
            message = f"no module {module!r} in {root}"
            raise NearharmonicError(message)
        found.add(module)
        waiting += [module.rpartition(".")[0], *_imports(module, path, root)]
    return tuple(sorted(found))


def _path_of(module: str, root: Path) -> Path:
    path = root.joinpath(*module.split(".")[1:])
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


@cache
def _source_digest(path: Path) -> str:
    return sha256(path.read_bytes()).hexdigest()


@cache
def _imports(module: str, path: Path, root: Path) -> tuple[str, ...]:
    """Modules of the package that the file ``path`` imports anywhere but for the type checker alone."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    names: set[str] = set()
    for node in _executed(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            members = [f"{base}.{alias.name}" for alias in node.names]
            names.update([base, *(name for name in members if _path_of(name, root).is_file())])
    return tuple(sorted(name for name in names if name.split(".")[0] == PACKAGE))


def _executed(tree: ast.AST) -> Iterator[ast.AST]:
    """The nodes of ``tree`` except what stands under ``if TYPE_CHECKING``."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            continue
        yield node
        yield from _executed(node)


def coefficients_digest(tableaus: Iterable[Tableau]) -> str:
    """SHA-256 over names and coefficients of ``tableaus``."""
    return sha256("\n".join(f"{t.name} {t.digest()}" for t in tableaus).encode()).hexdigest()


def provenance(settings: Mapping[str, Any], *, code: str, coefficients: str) -> dict[str, str]:
    """Attributes that say how a result was made: version, ``code`` digest, ``settings`` as JSON, coefficient digest."""
    return {
        "package_version": nearharmonic.__version__,
        "code_digest": code,
        "settings": json.dumps(settings, sort_keys=True),
        "coefficients_digest": coefficients,
        **{f"{library}_version": library_version(library) for library in LIBRARIES},
    }


def library_version(library: str) -> str:
    """Version of an installed library, from the library itself where it is loaded: reading metadata takes 25 ms."""
    loaded = sys.modules.get(library)
    if loaded is not None:
        return str(loaded.__version__)
    from importlib.metadata import version

    return version(library)


def write_manifest(place: str | os.PathLike[str], outputs: Iterable[str | os.PathLike[str]]) -> None:
    """Write ``place``: when and where ``outputs`` were made, and the SHA-256 of each by its path from that folder."""
    target = Path(place)
    manifest = {
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "host": platform.node(),
        "platform": platform.platform(),
        "python": platform.python_version(),
        "versions": {PACKAGE: nearharmonic.__version__, **{library: library_version(library) for library in LIBRARIES}},
        "sha256": {os.path.relpath(path, target.parent): _file_digest(path) for path in sorted(map(Path, outputs))},
    }
    part = target.with_name(f".{target.name}.part")
    part.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    part.replace(target)


def _file_digest(path: Path) -> str:
    with path.open("rb") as file:
        return file_digest(file, "sha256").hexdigest()
