"""Descriptions of an archive: RO-Crate metadata and their preview, a README, metadata for Zenodo; the software behind.

The metadata are RO-Crate 1.1 with the profile Workflow Run Crate 0.5, made with the library ``rocrate``. The library
uses today's date and random names by default. Here every date comes from the history and every name from the content,
so that equal results give equal bytes. Its preview inserts texts without escaping, and lacks the copy of the metadata
that RO-Crate 1.1 demands; that is why an archive has another one.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO
from urllib.parse import unquote

import nearharmonic
from nearharmonic.errors import ResultFileError, SettingError
from nearharmonic.output import atomic as reading
from nearharmonic.output.table import pipes
from nearharmonic_paper.record.history import Run

#: An entity of the metadata.
Entity = Mapping[str, Any]

#: Names of the descriptions in the archive.
METADATA, PREVIEW, ZENODO = "ro-crate-metadata.json", "ro-crate-preview.html", ".zenodo.json"
#: File of the main workflow; the other files are below ``workflow/``.
WORKFLOW = "Snakefile"
#: Documents of the software in an archive.
DOCUMENTS = ("CITATION.cff", "LICENSE")
KEYWORDS = ("symplectic integrators", "Hamiltonian systems", "splitting methods", "energy error")

#: Media type and description of a file by its ending.
FORMATS = {
    ".cff": ("application/yaml", "Citation File Format"),
    ".csv": ("text/csv", "CSV with every digit"),
    ".h5": ("application/vnd.hdfgroup.hdf5", "HDF5, netCDF-4 conventions"),
    ".html": ("text/html", "HTML"),
    ".json": ("application/json", "JSON"),
    ".jsonl": ("application/jsonl", "JSON, one object a line"),
    ".md": ("text/markdown", "Markdown"),
    ".pdf": ("application/pdf", "PDF"),
    ".png": ("image/png", "PNG"),
    ".py": ("text/x-python", "Python"),
    ".rst": ("text/x-rst", "reStructuredText"),
    ".smk": ("text/x-snakemake", "Snakemake"),
    ".svg": ("image/svg+xml", "SVG"),
    ".tex": ("application/x-tex", "LaTeX"),
    ".toml": ("application/toml", "TOML"),
    ".yaml": ("application/yaml", "YAML"),
    "": ("text/plain", "plain text"),
}
#: Profiles of the archive, by address: name and version.
PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5": ("Process Run Crate", "0.5"),
    "https://w3id.org/ro/wfrun/workflow/0.5": ("Workflow Run Crate", "0.5"),
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0": ("Workflow RO-Crate", "1.0"),
}
#: The language of the workflow, as the profile names it.
LANGUAGE = {
    "@id": "https://w3id.org/workflowhub/workflow-ro-crate#snakemake",
    "@type": "ComputerLanguage",
    "name": "Snakemake",
    "identifier": {"@id": "https://doi.org/10.1093/bioinformatics/bts480"},
    "url": {"@id": "https://snakemake.readthedocs.io"},
}
#: Home pages of the libraries whose versions are in the history.
HOMES = {
    "bokeh": "https://bokeh.org",
    "gmpy2": "https://github.com/gmpy2/gmpy2",
    "h5netcdf": "https://h5netcdf.org",
    "h5py": "https://www.h5py.org",
    "llvmlite": "https://llvmlite.readthedocs.io",
    "matplotlib": "https://matplotlib.org",
    "mpmath": "https://mpmath.org",
    "numba": "https://numba.pydata.org",
    "numpy": "https://numpy.org",
    "python": "https://www.python.org",
    "snakemake": "https://snakemake.github.io",
    "xarray": "https://xarray.dev",
}
#: Words on files and folders; README mentions those that are in the archive before the last three.
PLACES = {
    "report.html": "the page: claims, figures, tables; opens in a browser without a network",
    "cubes": "HDF5 cubes of errors and derived quantities; xarray opens them with the engine h5netcdf",
    "tables": "tables as CSV (every digit), Markdown and LaTeX; `tables/claims.json` holds the claims",
    "figures": "figures as PDF, SVG and PNG",
    "derived": "coefficients that the workflow derived",
    "runs": "trajectories",
    "user_files": "Python files of systems and integrators that the config names",
    WORKFLOW: "the workflow, as it was installed when this archive was written",
    "workflow": "rules, scripts and schema of the workflow",
    "config.json": "the settings of the newest run that ended well, as resolved",
    "history.jsonl": "every run of the workflow, one JSON object a line: times, command, commit, settings, versions",
    "manifest.json": "size and digest of every result file, with the code that made it",
    "CITATION.cff": "how to cite the software and the paper",
    "LICENSE": "text of the licence",
    ZENODO: "title, creators, licence and keywords for a deposit at Zenodo",
    "README.md": "what this archive holds and how to read it",
    METADATA: "RO-Crate metadata",
    PREVIEW: "preview of the metadata",
}
#: Properties of the archive in the preview, and headings of its files by their folder; the last one has all others.
FACTS = {
    "datePublished": "Date", "license": "Licence", "keywords": "Keywords", "author": "Runs started by",
    "mainEntity": "Workflow", "conformsTo": "Profiles",
}  # fmt: skip
GROUPS = {"figures": "Figures", "tables": "Tables", "cubes": "Cubes", "runs": "Trajectories", "workflow": "Workflow"}
_OTHERS = "Other files"

_OPENED, _CLOSED = b'<script type="application/ld+json">', b"</script>"
_ARXIV = "https://arxiv.org/abs/"
_SOURCE_TREE = Path(nearharmonic.__file__).parents[2]


@dataclass(frozen=True, kw_only=True)
class Member:
    """A file of the archive: its path there, the source of its bytes with size and SHA-256, and one sentence.

    ``run`` is the id of the run that made it, None for files that the archive adds.
    """

    path: str
    source: Path | bytes
    size: int
    sha256: str
    description: str
    run: str | None = None

    @classmethod
    def of_bytes(cls, path: str, content: bytes, description: str) -> Member:
        """Return the member whose bytes are ``content``."""
        digest = hashlib.sha256(content).hexdigest()
        return cls(path=path, source=content, size=len(content), sha256=digest, description=description)

    @classmethod
    def of_file(cls, path: str, place: Path, description: str) -> Member:
        """Return the member with the present bytes of a file that has no digest on record."""
        with opened(place) as file:
            return cls.of_bytes(path, file.read(), description)


def opened(source: Path | bytes) -> BinaryIO:
    """Open the source of a member for reading; a file that cannot be read is a ResultFileError."""
    if isinstance(source, bytes):
        return io.BytesIO(source)
    try:
        return reading.opened(source)
    except OSError as error:
        raise ResultFileError(f"{source} cannot be read: {error.strerror}") from error


def format_of(path: str) -> tuple[str, str]:
    """Return the media type of a file and its format in words, by the ending of ``path``."""
    return FORMATS.get(PurePosixPath(path).suffix, ("application/octet-stream", "binary"))


def document(name: str) -> bytes:
    """Return the file ``name``, one of :data:`DOCUMENTS`, from the source tree or else from the installed package.

    It is a ResultFileError if it is in neither of them.
    """
    places = [_SOURCE_TREE / name] if (_SOURCE_TREE / "pyproject.toml").is_file() else []
    places += [file for file in _installed(name) if ".dist-info/" in str(file)]
    for place in places:
        if place.is_file():
            return place.read_bytes()
    message = f"{name} is missing from this installation of nearharmonic: install it from its source tree or its wheel"
    raise ResultFileError(message)


def workflow_root() -> Path:
    """Return the folder with the files of the workflow: in the sources, or ``share/nearharmonic`` of a wheel.

    It is a SettingError if there is none.
    """
    if (_SOURCE_TREE / WORKFLOW).is_file() and (_SOURCE_TREE / "workflow").is_dir():
        return _SOURCE_TREE
    for place in _installed(f"share/nearharmonic/{WORKFLOW}"):
        return place.resolve().parent
    raise SettingError("the package has come without the workflow: pip install 'nearharmonic[workflow]' has it")


def _installed(ending: str) -> list[Path]:
    """Return the files of the installed package whose path has this ending."""
    try:
        package = distribution("nearharmonic")
    except PackageNotFoundError:
        return []
    return [Path(str(package.locate_file(file))) for file in package.files or [] if f"/{file}".endswith(f"/{ending}")]


def citation() -> dict[str, Any]:
    """Return the content of ``CITATION.cff``: ``title``, ``version``, ``license``, ``references`` and the rest."""
    import yaml

    return dict(yaml.safe_load(document("CITATION.cff")))


def workflow_files() -> list[Member]:
    """Return the files of the workflow of this installation; each run's software has its own version and commit."""
    root = workflow_root()
    paths = [root / WORKFLOW, *sorted(root.glob("workflow/**/*"))]
    names = [path.relative_to(root).as_posix() for path in paths if path.is_file() and "__pycache__" not in path.parts]
    says = "File of the workflow of nearharmonic"
    return [Member.of_bytes(name, (root / name).read_bytes(), f"{says}, {format_of(name)[1]}.") for name in names]


@dataclass(frozen=True)
class Archive:
    """Content that all descriptions of an archive share: the history, oldest first, has at least one run."""

    result: str
    runs: Sequence[Run]
    left_out: int  # trajectory files that are not in the archive
    cited: Mapping[str, Any] = field(default_factory=citation)

    @property
    def title(self) -> str:
        """Title of the archive."""
        return f"nearharmonic results: {self.result}"

    @property
    def abstract(self) -> str:
        """Abstract of the archive."""
        without = f" Trajectories are left out (files: {self.left_out})." if self.left_out else ""
        return (
            f"Energy errors, cubes, tables and figures of near-harmonic symplectic integrators, with the settings and "
            f"the history of the workflow that made them (runs: {len(self.runs)}).{without}"
        )

    @property
    def homepage(self) -> str:
        """Address of the software, or of the reproduced paper if the citation file has no other address."""
        cited = self.cited
        return str(cited.get("repository-code") or cited.get("url") or cited["references"][0]["url"])


def metadata(about: Archive, members: Sequence[Member], configs: Mapping[str, str]) -> bytes:
    """Describe the files and the runs of an archive: RO-Crate JSON-LD in UTF-8, with sorted keys and entities.

    ``members`` are all files except the metadata and their preview. ``configs`` are the paths in the archive of the
    configs of the runs, by the id of the run.
    """
    from rocrate.rocrate import ROCrate

    crate = ROCrate(version="1.1")
    crate.metadata.extra_terms["sha256"] = "http://schema.org/sha256"  # younger than the context of RO-Crate 1.1
    crate.metadata.append_to("conformsTo", {"@id": next(reversed(PROFILES))})
    _describe_root(crate, about)
    files = {member.path: _add_file(crate, member, about) for member in members}
    files[WORKFLOW]["hasPart"] = [file for path, file in files.items() if path.startswith("workflow/")]
    crate.root_dataset["mainEntity"] = files[WORKFLOW]
    for run in about.runs:
        made = [files[member.path] for member in members if member.run == run["id"]]
        _add_action(crate, run, about, files[configs[run["id"]]], made)
    return _sorted_json(crate.metadata.generate())


def _add(crate: Any, identifier: str, kind: str, **properties: Any) -> Any:
    """Return the contextual entity ``identifier`` of ``crate``; add it if it is missing."""
    return crate.get(identifier) or crate.add_jsonld({"@id": identifier, "@type": kind, **properties})


def _describe_root(crate: Any, about: Archive) -> None:
    root, licence = crate.root_dataset, about.cited["license"]
    root["name"] = about.title
    root["description"] = about.abstract
    root["datePublished"] = _moment(about.runs[-1]["end"] or about.runs[-1]["start"])
    root["keywords"] = ", ".join(KEYWORDS)
    root["conformsTo"] = [
        _add(crate, address, "CreativeWork", name=name, version=version)
        for address, (name, version) in PROFILES.items()
    ]
    says = "Who started the runs; the history does not keep the name."
    root["author"] = _add(crate, "#operator", "Person", name="Operator of the workflow", description=says)
    place, says = f"https://spdx.org/licenses/{licence}", "The text of the licence is the file LICENSE of this archive."
    root["license"] = _add(crate, place, "CreativeWork", name=f"{licence} license", description=says)
    root["citation"] = [_publication(crate, reference) for reference in about.cited["references"]]
    _add(crate, PREVIEW, "CreativeWork", name="Preview of this archive", about=root, encodingFormat="text/html")


def _publication(crate: Any, reference: Mapping[str, Any]) -> Any:
    names = [f"{author['given-names']} {author['family-names']}" for author in reference["authors"]]
    authors = [_add(crate, f"#{name.lower().replace(' ', '-')}", "Person", name=name) for name in names]
    told = {"name": reference["title"], "datePublished": str(reference["year"]), "author": authors}
    return _add(crate, reference["url"], "ScholarlyArticle", **told)


def _add_file(crate: Any, member: Member, about: Archive) -> Any:
    properties: dict[str, Any] = {
        "name": member.path,
        "description": member.description,
        "contentSize": str(member.size),
        "sha256": member.sha256,
        "encodingFormat": format_of(member.path)[0],
    }
    if member.path == WORKFLOW:
        properties |= {
            "@type": ["File", "SoftwareSourceCode", "ComputationalWorkflow"],
            "name": "Workflow of nearharmonic",
            "url": about.homepage,
            "version": nearharmonic.__version__,
            "programmingLanguage": crate.add_jsonld(dict(LANGUAGE)),
        }
    elif member.path == "README.md":
        properties["about"] = crate.root_dataset
    return crate.add_file(dest_path=member.path, properties=properties)


def _add_action(crate: Any, run: Run, about: Archive, config: Any, made: Sequence[Any]) -> None:
    done = run["status"] == "ok"
    told = {
        "name": f"Run {run['id']} of the workflow",
        "description": _run_in_words(run),
        "startTime": _moment(run["start"]),
        "actionStatus": {"@id": f"http://schema.org/{'Completed' if done else 'Failed'}ActionStatus"},
        "instrument": [crate.root_dataset["mainEntity"], _instrument(crate, run, about)],
        "object": config,
        "agent": crate.get("#operator"),
    }
    if run["end"]:
        told["endTime"] = _moment(run["end"])
    if not done:
        told["error"] = "killed before its end" if run["status"] == "killed" else f"exit status {run['exit_status']}"
    if made:
        told["result"] = list(made)
    crate.root_dataset.append_to("mentions", _add(crate, f"#run-{run['id']}", "CreateAction", **told))


def _moment(utc: str) -> str:
    """Return ``utc`` with a numeric offset, as validators of the profile require."""
    return utc.removesuffix("Z") + "+00:00"


def _run_in_words(run: Run) -> str:
    words = [f"{' '.join(run['command'])}: {run['status']}"]
    words += [f"targets {', '.join(run['targets'])}"] if run["targets"] else []
    words += [f"{run['duration']:.1f} s on {run['cores']} cores"] if run["duration"] is not None else []
    words += [f"{run['jobs_run']} jobs run, {run['jobs_reused']} reused"] if run["jobs_run"] is not None else []
    return "; ".join([*words, str(run["platform"])])


def _instrument(crate: Any, run: Run, about: Archive) -> Any:
    """Return the software of ``run``: one entity for each combination of code and libraries."""
    versions, commit, dirty = run["versions"], run["commit"], run["dirty"]
    version = versions["nearharmonic"] + (f"+{commit}" + (".dirty" if dirty else "") if commit else "")
    same = json.dumps([version, run["code_digest"], versions], sort_keys=True)
    changed = ", with changes that are not committed" if dirty else ""
    told = {
        "name": "nearharmonic",
        "version": version,
        "url": about.homepage,
        "description": f"{about.cited['title']}; commit {commit or 'unknown'}{changed}, code {run['code_digest']}",
        "softwareRequirements": [
            _add(crate, f"#{name}-{number}", "SoftwareApplication", name=name, version=number, url=HOMES[name])
            for name, number in sorted(versions.items())
            if name in HOMES
        ],
    }
    digest = hashlib.sha256(same.encode()).hexdigest()[:12]
    return _add(crate, f"#nearharmonic-{digest}", "SoftwareApplication", **told)


def _sorted_json(generated: Mapping[str, Any]) -> bytes:
    """Return sorted JSON in which no list is empty or has one value."""
    first = {METADATA: 0, "./": 1}
    graph = [
        {
            key: value[0] if isinstance(value, list) and len(value) == 1 else value
            for key, value in entity.items()
            if value != []
        }
        for entity in sorted(generated["@graph"], key=lambda entity: (first.get(entity["@id"], 2), entity["@id"]))
    ]
    flat = {"@context": generated["@context"], "@graph": graph}
    return json.dumps(flat, indent=1, sort_keys=True, ensure_ascii=False).encode() + b"\n"


def readme(about: Archive, members: Sequence[Member]) -> bytes:
    """Return the README, Markdown in UTF-8."""
    counts = Counter(PurePosixPath(member.path).parts[0] for member in members)
    folders = {PurePosixPath(member.path).parts[0] for member in members if "/" in member.path}
    rows = [
        (f"`{name}/` (files: {counts[name]})" if name in folders else f"`{name}`", words)
        for name, words in PLACES.items()
        if name in counts
    ]
    newest, table = about.runs[-1], "\n".join(pipes(["file", "content"], rows))
    says = "Trajectories, below `runs/` in `manifest.json`, are not in this archive"
    left_out = f"{says} (files: {about.left_out}).\n\n" if about.left_out else ""
    return f"""# {about.title}

Results of the nearharmonic workflow (runs: {len(about.runs)}). The newest run started at {newest["start"]} \
(commit {newest["commit"] or "unknown"}).

{table}

The archive is an RO-Crate 1.1 with the profile Workflow Run Crate 0.5. `ro-crate-metadata.json` gives the \
size and the SHA-256 of each file, and for each run its settings, its software and its files. \
`ro-crate-preview.html` shows the same in a browser, without a network.

{left_out}- Check the archive: `nearharmonic verify FILE.zip`.
- Run again with the same settings: `snakemake -j2 --configfile config.json`.
""".encode()


def zenodo(about: Archive) -> bytes:
    """Return the metadata for a deposit, JSON in UTF-8 with the keys of Zenodo's REST API.

    There is no date: Zenodo adds the date of publication.
    """
    made_by = {"identifier": about.homepage, "relation": "isCompiledBy", "resource_type": "software", "scheme": "url"}
    deposit = {
        "title": about.title,
        "upload_type": "dataset",
        "description": f"<p>{escape(about.abstract)}</p>",
        "creators": [_creator(author) for author in about.cited["authors"]],
        "access_right": "open",
        "license": about.cited["license"],
        "keywords": list(KEYWORDS),
        "language": "eng",
        "related_identifiers": [*map(_related, about.cited["references"]), made_by],
    }
    return json.dumps(deposit, indent=1, ensure_ascii=False).encode() + b"\n"


def _creator(author: Mapping[str, Any]) -> dict[str, str]:
    """Return a person, or an entity with a name, of the citation file as a creator."""
    name = author.get("name") or f"{author['family-names']}, {author['given-names']}"
    orcid = str(author.get("orcid", "")).rpartition("/")[2]
    given = {"name": name, "affiliation": author.get("affiliation", ""), "orcid": orcid}
    return {key: value for key, value in given.items() if value}


def _related(reference: Mapping[str, Any]) -> dict[str, str]:
    """Return a reference of the citation file; a preprint has its identifier at arXiv."""
    url = str(reference["url"])
    at_arxiv = url.startswith(_ARXIV)
    return {
        "identifier": f"arXiv:{url.removeprefix(_ARXIV)}" if at_arxiv else url,
        "relation": "references",
        "resource_type": "publication-preprint" if at_arxiv else "publication-article",
        "scheme": "arxiv" if at_arxiv else "url",
    }


def preview(described: bytes) -> bytes:
    """Return the page, HTML 5 in UTF-8 that needs no other file, from the text of the metadata alone."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    crate = json.loads(described)
    entities = {entity["@id"]: _Lenient(entity) for entity in crate["@graph"]}
    files = [entity for entity in entities.values() if "File" in several(entity["@type"])]
    runs = [entity for entity in entities.values() if entity["@type"] == "CreateAction"]
    # No text in it can end the script: the characters of tags are escaped.
    copy = json.dumps(crate, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
    copy = copy.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.globals |= {"link": _link, "several": several, "ending": _ending, "content": _content, "facts": FACTS}
    page = environment.from_string(Path(__file__).with_name("preview.html").read_text(encoding="utf-8")).render(
        json=Markup(copy),
        entities=entities,
        root=entities["./"],
        begin=[file for name in ("report.html", "README.md") for file in files if file["@id"] == name],
        groups=_grouped(files),
        runs=sorted(runs, key=lambda run: str(run["startTime"])),
        software=[entity for entity in entities.values() if entity["@type"] == "SoftwareApplication"],
    )
    return page.encode() + b"\n"


def shown_in(page: bytes) -> Any:
    """Return the copy of the metadata in the page; None if there is none."""
    try:
        return json.loads(page.partition(_OPENED)[2].partition(_CLOSED)[0])
    except ValueError:
        return None


class _Lenient(dict[str, Any]):
    """An entity in which a missing property is None."""

    def __missing__(self, key: str) -> None:
        return None


def several(value: Any) -> list[Any]:
    """Return the values of a property of an entity."""
    return [] if value is None else value if isinstance(value, list) else [value]


def _link(identifier: str) -> str:
    """Return the target of a link: an address of the web, a place on this page, or a file of the archive."""
    return identifier if identifier.startswith(("https://", "http://", "#")) else f"./{identifier}"


def _path(file: Entity) -> PurePosixPath:
    return PurePosixPath(unquote(file["@id"]))


def _ending(file: Entity) -> str:
    return _path(file).suffix.removeprefix(".").upper() or "TEXT"


def _content(file: Entity) -> str:
    """Return the description of a file without its format, for files that differ in it stand in one row."""
    return str(file["description"]).replace(f", {format_of(str(_path(file)))[1]}", "")


def _grouped(files: Iterable[Entity]) -> dict[str, dict[str, list[Entity]]]:
    """Return the files below the headings of their groups, those that differ in their endings together."""
    groups: dict[str, dict[str, list[Entity]]] = {heading: {} for heading in (*GROUPS.values(), _OTHERS)}
    for file in files:
        path = _path(file)
        folder = "workflow" if str(path) == WORKFLOW else path.parts[0]
        if folder in GROUPS:
            name = path.relative_to(folder) if len(path.parts) > 1 else path
            groups[GROUPS[folder]].setdefault(str(name.with_suffix("")), []).append(file)
        else:
            groups[_OTHERS][str(path)] = [file]
    return {heading: rows for heading, rows in groups.items() if rows}
