"""Provenance of results: digests of sources, tasks of rules, and receipts of the files that jobs wrote."""

from __future__ import annotations

import ast
import atexit
import gc
import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, fields, is_dataclass
from functools import cache, partial
from hashlib import file_digest, sha256
from importlib import import_module
from importlib.util import resolve_name
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from nearharmonic.core import disk
from nearharmonic.errors import NearharmonicError, SettingError
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output import atomic as reading
from nearharmonic.output.atomic import sealed, unsealed, write_text
from nearharmonic.output.store import sealed_digest
from nearharmonic.registry import is_file
from nearharmonic.systems import systems

Node = TypeVar("Node")
Measuring = TypeVar("Measuring", bound=Callable[..., Any])

# --- Source files of the packages: imports of each module, and digests without docstrings and comments.

#: Packages whose sources count, and their common folder.
PACKAGES = ("nearharmonic", "nearharmonic_paper", "nearharmonic_studies")
PACKAGE = PACKAGES[0]
ROOT = Path(__file__).parents[2]
#: Maximum number of entries of the cache on disk, 150 bytes each.
MOST_CACHED = 3000


class Source(NamedTuple):
    """One source file: ``digest`` of its syntax tree, and the dotted names that it ``imports`` from the package."""

    digest: str
    imports: tuple[str, ...]


def closure(*modules: str, root: Path | None = None) -> tuple[str, ...]:
    """Return ``modules`` and every module of the package that they import, directly or not, sorted.

    The ``__init__`` of the package is excluded: it imports all layers for their names, and computes nothing.
    """
    return _modules(root).closure(modules)


def module_digest(module: str, root: Path | None = None) -> str:
    """Return the SHA-256 of the syntax tree of ``module`` without docstrings and comments."""
    return _modules(root).source(module).digest


def path_of(module: str, root: Path) -> Path:
    """Return the file of the dotted name ``module`` of a package in the folder ``root``."""
    path = root.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def reached(starts: Iterable[Node], following: Callable[[Node], Iterable[Node]]) -> set[Node]:
    """Return ``starts`` and all that follows from them, directly or not."""
    visited: set[Node] = set()
    waiting = list(starts)
    while waiting:
        node = waiting.pop()
        if node not in visited:
            visited.add(node)
            waiting += following(node)
    return visited


class _Modules:
    """The modules of the packages in one folder, each read once: thousands of jobs ask for the same."""

    def __init__(self, root: Path, parse: Callable[[bytes], Source]) -> None:
        self._root, self.parse = root, parse
        self.source, self.closure, self._imported = cache(self._source), cache(self._closure), cache(self._imports)
        self.digest = cache(self._digest)
        self._is_module = cache(lambda name: path_of(name, root).is_file())

    def _closure(self, modules: tuple[str, ...]) -> tuple[str, ...]:
        names = reached(modules, lambda name: [] if name in PACKAGES else [_above(name), *self._imported(name)])
        return tuple(sorted(names - {*PACKAGES}))

    def _digest(self, versions: tuple[str, ...], modules: tuple[str, ...]) -> str:
        told = (f"{module} {self.source(module).digest}" for module in self.closure(modules))
        return sha256("".join(f"{line}\n" for line in (*versions, *told)).encode()).hexdigest()

    def _source(self, module: str) -> Source:
        path = path_of(module, self._root)
        if not path.is_file():
            raise NearharmonicError(f"no module {module!r} in {self._root}")
        return self.parse(path.read_bytes())

    def _imports(self, module: str) -> list[str]:
        """Return the modules of the package that ``module`` imports; an imported name may belong to a function."""
        is_package = path_of(module, self._root).name == "__init__.py"
        imported = []
        for written in self.source(module).imports:
            name = resolve_name(written, module if is_package else _above(module))
            if name.split(".")[0] in PACKAGES:
                imported += [place for place in (name, _above(name)) if place and self._is_module(place)]
        return imported


def _above(name: str) -> str:
    """Return a dotted name without its last part."""
    return name.rpartition(".")[0]


def _modules(root: Path | None) -> _Modules:
    return _running() if root is None else _Modules(root, parsed)


@cache
def _running() -> _Modules:
    """Return the modules that run, whose parsed sources are kept on disk."""
    return _Modules(ROOT, SourceCache().parsed)


class SourceCache:
    """On-disk cache of parsed sources, by the SHA-256 of their text.

    Parsing the packages takes 0.5 s, reading the cache 10 ms. The file, written at the end of the process, is in the
    folder of compiled code, writable only for the user. Its name depends on this module's text and Python's version.
    """

    def __init__(self) -> None:
        version = sha256(Path(__file__).read_bytes() + sys.version.encode()).hexdigest()
        self._place = disk.place_of(f"sources-{version[:32]}")
        kept = disk.read(self._place) if self._place else None
        self._known: dict[str, Sequence[Any]] = json.loads(kept[1]) if kept else {}
        self._kept = len(self._known)
        atexit.register(self.keep)

    def parsed(self, text: bytes) -> Source:
        """Return the result of the function :func:`parsed`, from the cache if possible."""
        key = sha256(text).hexdigest()
        digest, imports = self._known[key] if key in self._known else self._known.setdefault(key, parsed(text))
        return Source(digest, tuple(imports))

    def keep(self) -> None:
        """Write the newest :data:`MOST_CACHED` entries of the cache, if it has new ones."""
        if self._place and len(self._known) > self._kept:
            disk.write(self._place, "sources", json.dumps(dict([*self._known.items()][-MOST_CACHED:])).encode())


@cache
def parsed(text: bytes) -> Source:
    """Return digest and imports of a source file; imports under TYPE_CHECKING are left out."""
    collects = gc.isenabled()
    gc.disable()  # a tree is many objects and no garbage: collections would take three quarters of the time
    try:
        tree = ast.parse(text)
        return Source(_tree_digest(tree), tuple(sorted({*_imports_in(tree)})))
    finally:
        if collects:
            gc.enable()


def _tree_digest(tree: ast.Module) -> str:
    """Return the SHA-256 of the nodes of a syntax tree without docstrings, and of their fields, in an order of its own.

    ``ast.dump`` takes three times as long. Contexts, such as the store of an assigned name, follow from the rest.
    """
    told, waiting = list[object](), list[Any]([tree])
    documented = {ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef}
    while waiting:
        part = waiting.pop()
        kind = type(part)
        if kind is ast.Name:  # a third of the nodes
            told += ("Name", part.id)
        elif kind is list:
            told.append(len(part))
            waiting += part
        elif issubclass(kind, ast.AST):
            if kind in documented and ast.get_docstring(part, clean=False):
                del part.body[0]
            told.append(kind.__name__)
            waiting += [getattr(part, name, None) for name in part._fields if name != "ctx"]
        else:
            told.append(part)
    return sha256(repr(told).encode()).hexdigest()


def _imports_in(tree: ast.Module) -> Iterator[str]:
    """Yield the dotted names of imports at any depth, a relative one with its dots; expressions are not visited."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base, joint = "." * node.level + (node.module or ""), "." if node.module else ""
            yield from (base, *(f"{base}{joint}{alias.name}" for alias in node.names))
        elif not (isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"):
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
            yield from (file for file in beside if file.is_relative_to(folder) and is_file(file))


def package_modules_of(place: str | os.PathLike[str]) -> set[str]:
    """Return the modules of this package that a user's file and its imported files import."""
    written = {name for path in files_of(place) for name in _source(path).imports if name.split(".")[0] in PACKAGES}
    return {module for name in written for module in (name, _above(name)) if path_of(module, ROOT).is_file()}


def digest_of_file(place: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of the syntax trees of the files of :func:`files_of` without docstrings and comments."""
    first, *others = files_of(place)
    told = (f"{path.relative_to(first.parent).as_posix()} {_source(path).digest}\n" for path in others)
    return sha256("".join([_source(first).digest, *told]).encode()).hexdigest()


def _source(path: Path) -> Source:
    """Return digest and imports of a user's file in its present state."""
    if not is_file(path):
        raise SettingError(f"{path} is no file")
    try:
        return _running().parse(path.read_bytes())
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise SettingError(f"{path} cannot be read: {error}") from error


# --- Users' definitions of systems and integrators, passed from the planning process to the jobs.

#: Definitions by name, of "systems" and of "integrators".
Definitions = Mapping[str, Mapping[str, Any]]


def definitions_of(problems: Iterable[str], methods: Iterable[str]) -> Definitions:
    """Return the definitions of users' systems and integrators, by kind and name; {} if there are none."""
    defined = {"systems": (systems.definitions, problems), "integrators": (integrators.definitions, methods)}
    chosen = {kind: {n: every[n] for n in names if n in every} for kind, (every, names) in defined.items()}
    return {kind: members for kind, members in chosen.items() if members}


def files_in(definitions: Definitions) -> list[str]:
    """Return the paths of the users' files, sorted."""
    return sorted({own.file for members in definitions.values() for own in members.values() if own.file is not None})


@contextmanager
def defined(definitions: Definitions) -> Iterator[None]:
    """Add exactly these definitions to the registries inside the block."""
    with systems.defining(definitions.get("systems", {})), integrators.defining(definitions.get("integrators", {})):
        yield


def read_definitions(document: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Definitions:
    """Return definitions from their form in JSON."""
    from nearharmonic.integrators import TableauDefinition
    from nearharmonic.systems.user_file import SystemDefinition

    kinds: dict[str, Any] = {"systems": SystemDefinition, "integrators": TableauDefinition}

    def made(kind: str, told: Mapping[str, Any]) -> Any:
        return kinds[kind](**{key: _frozen(value) for key, value in told.items()})

    try:
        return {kind: {name: made(kind, told) for name, told in names.items()} for kind, names in document.items()}
    except (AttributeError, KeyError, TypeError) as error:
        raise NearharmonicError(f"no definition of a system or an integrator: {document!r}") from error


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


# --- Tasks of rules, and the provenance of their results: digests and versions, no timestamps.

#: Libraries whose version may change the last bit of a result or the bytes of its file.
LIBRARIES = ("numpy", "numba", "llvmlite", "h5py")
#: Libraries whose version may change the numbers of a result; a new version invalidates every result.
NUMERICAL_LIBRARIES = ("numpy", "numba", "llvmlite")
#: Fields of a tableau without effect on results, and one field that follows from the coefficients.
REMARKS = ("note", "source", "symmetric")
#: Fields that are included only if a method has them.
OPTIONAL = ("square", "processor")

Task = dict[str, Any]


def task(function: str, **settings: Any) -> Task:
    """Describe the task of a rule: a package function, its settings, and the digest of all dependencies of the result.

    Returns
    -------
    dict
        ``function``, ``settings``, ``modules`` (dotted names of its module and of all modules that this imports),
        ``code`` (SHA-256, hex), ``coefficients`` (SHA-256, hex), and the names of the ``systems`` and ``integrators``
        that the settings hold. ``code`` covers these modules, the systems' modules, and the versions of numpy, numba
        and llvmlite. ``coefficients`` covers these integrators. ``definitions`` has the users' systems and integrators
        among them, from which the job creates them; ``code`` covers their files.
    """
    named = named_in(settings)
    problems = [name for name in systems if name in named]
    methods = [name for name in integrators if name in named]
    return {
        "function": function,
        "settings": settings,
        "modules": closure(function.partition(":")[0]),
        **digests(function, problems, methods),
        "systems": problems,
        "integrators": methods,
        "definitions": definitions_of(problems, methods),
    }


def digests(function: str, problems: Iterable[str], methods: Iterable[str]) -> dict[str, str]:
    """Return ``code`` and ``coefficients`` of a task from its function and the names of its systems and integrators."""
    names = list(problems)
    coefficients = coefficients_digest(integrators[name] for name in methods)
    files = {name: own.file for name, own in systems.definitions.items() if name in names and own.file is not None}
    declared = [module for name in names if (module := systems.module_of(name)) is not None]
    imported = {module for place in files.values() for module in package_modules_of(place)}
    code = code_digest(function.partition(":")[0], *declared, *imported)
    if files:
        told = [code, *(f"{name} {digest_of_file(place)}" for name, place in sorted(files.items()))]
        code = sha256("\n".join(told).encode()).hexdigest()
    return {"code": code, "coefficients": coefficients}


def settings_text(task: Mapping[str, Any]) -> str:
    """Return the settings of ``task`` as JSON, with users' definitions of systems and integrators."""
    more = {"definitions": task["definitions"]} if task.get("definitions") else {}
    return json.dumps({**task["settings"], **more}, sort_keys=True, default=asdict)


def settings_digest(task: Mapping[str, Any]) -> str:
    """Return the SHA-256 of the settings of ``task``."""
    return sha256(settings_text(task).encode()).hexdigest()


def function_of(task: Mapping[str, Any]) -> Any:
    """Return the package function that ``task`` names."""
    module, _, name = task["function"].partition(":")
    return getattr(import_module(module), name)


def named_in(settings: Any) -> set[str]:
    """Return every string in ``settings``, at any depth; names of systems and methods are among them."""
    if isinstance(settings, str):
        return {settings}
    if is_dataclass(settings):
        members: Iterable[Any] = [getattr(settings, member.name) for member in fields(settings)]
    elif isinstance(settings, Mapping):
        members = [*settings, *settings.values()]
    else:
        members = settings if isinstance(settings, Iterable) else ()
    return {name for member in members for name in named_in(member)}


def code_digest(*modules: str, root: Path | None = None) -> str:
    """Return the SHA-256 of the code of ``modules`` (dotted names) and of all modules that they import.

    The code of a module is its syntax tree without docstrings. Imports inside functions count; imports under
    TYPE_CHECKING do not. The digest includes versions of the libraries that affect numbers.
    """
    versions = tuple(f"{library} {library_version(library)}" for library in NUMERICAL_LIBRARIES)
    return _modules(root).digest(versions, modules)


def command_digest(place: str | os.PathLike[str]) -> str:
    """Return the digests of a Python file that is run as a command, and of all modules of the packages it imports."""
    return f"{digest_of_file(place)} {code_digest(*sorted(package_modules_of(place)))}"


def coefficients_digest(tableaus: Iterable[Tableau]) -> str:
    """Return the SHA-256 of the fields of ``tableaus`` except remarks: names, labels, orders and coefficients."""
    names = [field.name for field in fields(Tableau) if field.name not in REMARKS]
    entries = ({name: getattr(tableau, name) for name in names} for tableau in tableaus)
    told = ({name: value for name, value in entry.items() if name not in OPTIONAL or value} for entry in entries)
    return sha256("\n".join(map(repr, told)).encode()).hexdigest()


def provenance(task: Mapping[str, Any]) -> dict[str, str]:
    """Return the provenance attributes of the result of ``task``: versions, digests and settings as JSON."""
    return {
        "package_version": library_version(PACKAGE),
        "code_digest": task["code"],
        "settings": settings_text(task),
        "coefficients_digest": task["coefficients"],
        **{f"{library}_version": library_version(library) for library in LIBRARIES},
    }


@cache
def library_version(library: str) -> str:
    """Return the version of an installed library, from the module if it is loaded: its metadata take 25 ms."""
    if (loaded := sys.modules.get(library)) is not None:
        return str(loaded.__version__)
    from importlib.metadata import version

    return version(library)


# --- Receipts: lists of the files that each job of a workflow wrote, stored beside its log; the manifest combines them.
#
# A receipt holds size and SHA-256 of each file as the job left it, which tell a file that was edited later from one
# that was made again. It is no result, so it may contain timestamps. One whose seal does not match is not believed.

#: Environment variable with the id of the workflow run of a job.
RUN = "NEARHARMONIC_RUN"
#: Folders of files that are no results: logs, the marks of jobs among them, and copies of pages of the documentation.
BESIDE = ("logs", "docs")
#: Folder below ``logs`` with the markers of unfinished runs, which are no receipts.
MARKED = "running"
#: Marks a whole file as volatile, in place of columns.
WHOLE = "*"
#: Place and files by name of each receipt.
Receipts = Iterable[tuple[Path, Mapping[str, dict[str, Any]]]]


def measures_time(function: Measuring) -> Measuring:
    """Declare that all files from the results of ``function`` contain measured times, which differ from run to run."""
    function.measures_time = True  # type: ignore[attr-defined]
    return function


class Receipt:
    """Files that one job wrote."""

    def __init__(self, log: str | os.PathLike[str], inputs: Iterable[str] = ()) -> None:
        self._place, self._folder = Path(log).with_suffix(".json"), folder_of(log)
        self._files: dict[str, dict[str, Any]] = {}
        self._inputs = {name: identity(self._folder / name) for name in sorted(self._results(inputs))}

    def _results(self, places: Iterable[str]) -> dict[str, str]:
        """Return files by their names in the folder of results, without those outside and in :data:`BESIDE`."""
        names = {Path(os.path.relpath(place, self._folder)).as_posix(): place for place in places}
        return {name: place for name, place in names.items() if name.partition("/")[0] not in {*BESIDE, ".."}}

    def add(
        self, places: Sequence[str], task: Mapping[str, Any], *, volatile: Sequence[str] = (), evaluations: int = 0
    ) -> None:
        """Add results that a task has written."""
        for name, place in self._results(places).items():
            self._files[name] = {
                **measured(place),
                "modified": Path(place).stat().st_mtime_ns,
                "function": task["function"],
                "code": task["code"],
                "coefficients": task["coefficients"],
                "settings": settings_digest(task),
                "systems": list(task["systems"]),
                "integrators": list(task["integrators"]),
                "volatile": list(volatile),
                "evaluations": evaluations,
                "inputs": self._inputs,
                "run": os.environ.get(RUN),
                **({"definitions": json.loads(settings_text(task))["definitions"]} if task.get("definitions") else {}),
            }

    def write(self) -> None:
        """Write the receipt, with the CPU seconds of the job, beside the log; a failure is a warning in the log."""
        told = {"files": self._files, "cpu_seconds": round(sum(os.times()[:4]), 3)}
        try:
            write_text(self._place, json.dumps(sealed(told), indent=1) + "\n")
        except OSError as error:
            print(f"warning: no receipt: {error}")


def measured(place: str | os.PathLike[str]) -> dict[str, Any]:
    """Return ``size`` (bytes) and ``sha256`` (hex) of a regular file."""
    with reading.opened(place) as file:
        digest = file_digest(file, "sha256").hexdigest()  # type: ignore[arg-type]  # it has readinto
        return {"size": file.tell(), "sha256": digest}


def identity(place: Path) -> str:
    """Return a digest that identifies the content of a file: the one in its last line, or else of its bytes."""
    return sealed_digest(place) or str(measured(place)["sha256"])


def folder_of(log: str | os.PathLike[str]) -> Path:
    """Return the folder of results that a log file belongs to: ``results/<name>`` of ``results/<name>/logs/...``."""
    parts = Path(log).parts
    end = parts.index("results") + 2 if "results" in parts[:-3] else len(parts) - 1 - parts[::-1].index("logs")
    return Path(*parts[:end])


def receipts_in(folder: Path) -> Receipts:
    """Return the receipts in a folder of results; damaged ones are skipped."""
    return [(place, files) for place, files in _receipts(folder) if files is not None]


def damaged_receipts(folder: Path) -> list[Path]:
    """Return the receipts in a folder of results that cannot be read, or whose seal is missing or does not match."""
    return [place for place, files in _receipts(folder) if files is None]


def names_made_by(receipts: Receipts, run: str) -> list[str]:
    """Return the sorted names of the files that jobs of the workflow run with this id made."""
    return sorted(name for _, files in receipts for name, entry in files.items() if entry["run"] == run)


def _receipts(folder: Path) -> Iterator[tuple[Path, dict[str, dict[str, Any]] | None]]:
    from nearharmonic_paper.tasks.schema import complaint

    for place in sorted((folder / "logs").rglob("*.json")):
        if place.parent != folder / "logs" / MARKED:
            try:
                files = (unsealed(reading.read_bytes(place)) or {}).get("files")
            except FileNotFoundError:  # removed in between
                continue
            except OSError:
                files = None
            yield place, None if complaint("receipt", files) else files


def forget(folder: Path, entries: Mapping[str, Mapping[str, Any]]) -> None:
    """Delete the receipts of ``folder`` that say another digest of a file than ``entries`` do."""
    for place, receipt in receipts_in(folder):
        if any(name in entries and entry["sha256"] != entries[name]["sha256"] for name, entry in receipt.items()):
            place.unlink(missing_ok=True)
