"""Public names: docstrings with examples and references, and how a notebook shows entries and registries."""

import doctest
import inspect
import re
from html.parser import HTMLParser
from importlib import import_module
from pkgutil import walk_packages

import pytest

import nearharmonic as nh
from nearharmonic import math

# --- docstrings of public names: each has an example that runs, names the arguments, and refers to names that exist ---


#: Public objects by name; the version is a string.
PUBLIC = (
    {"nearharmonic": nh}
    | {f"nh.{name}": getattr(nh, name) for name in nh.__all__ if name != "__version__"}
    | {f"math.{name}": getattr(math, name) for name in math.__all__ if name != "pi"}
)
CALLED = {name: one for name, one in PUBLIC.items() if inspect.isroutine(one) or isinstance(one, type)}
#: Examples that take seconds: they compile a function, draw a figure, or search.
LONGER = {"nh.plot", "nh.recommend", "nh.section", "nh.stepper", "nh.tailor"}
ROLE = re.compile(r":(?:func|class|meth|mod|data|attr|exc|obj):`~?([\w.]+)`")


def sections(docstring):
    """The underlined sections of a docstring by their titles, in order."""
    parts = re.split(r"^(\w[\w ]*)\n-{3,}\n", docstring, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LONGER)) for name in PUBLIC])
def test_example_of_public_name_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = sections(inspect.getdoc(PUBLIC[name]))["Examples"]
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    assert example.examples
    report = []
    failed, _ = doctest.DocTestRunner().run(example, out=report.append)
    assert not failed, "".join(report)


@pytest.mark.parametrize("name", [name for name in CALLED if "." in name])
def test_numpydoc_finds_no_fault_in_docstring(name):
    validate = pytest.importorskip("numpydoc.validate").validate
    # No need: extended summaries, "See Also", types of arguments that another function describes; for functions of
    # mathematics, the sections of an argument and of a value that are numbers.
    allowed = {"ES01", "SA01", "PR04", *(["PR01", "RT01"] if name.startswith("math.") else [])}
    place = f"nearharmonic.{name.removeprefix('nh.')}"
    assert [fault for fault in validate(place)["errors"] if fault[0] not in allowed] == []


def owners(module):
    """(object, class that it stands in or None) of the definitions of a module, and the module."""
    yield module, None
    for one in vars(module).values():
        if getattr(one, "__module__", None) == module.__name__ and (inspect.isroutine(one) or isinstance(one, type)):
            yield one, one if isinstance(one, type) else None
            if isinstance(one, type):
                yield from ((inspect.unwrap(member), one) for member in vars(one).values() if member.__doc__)


def resolves(target, module, owner):
    """Return True if a reference in a docstring names an object: absolute, of the class, of the module, or of nh."""
    first, *rest = target.split(".")
    for place in (owner, module, nh):
        if hasattr(place, first):
            found = getattr(place, first)
            return all((found := getattr(found, part, None)) is not None for part in rest)
    for count in range(len(rest) + 1, 0, -1):
        try:
            found = import_module(".".join([first, *rest][:count]))
        except (ImportError, TypeError, ValueError):  # no such module, or a name that begins with a dot
            continue
        return all((found := getattr(found, part, None)) is not None for part in [first, *rest][count:])
    return False


def references(text):
    """Names that a docstring refers to by roles, and as ``nh.x``."""
    return ROLE.findall(text) + re.findall(r"``nh\.(\w+)", text)


def modules_of(names):
    """Modules, without adapters whose library is not installed."""
    for name in names:
        try:
            yield import_module(name)
        except ModuleNotFoundError as error:
            if ".adapters." not in name or (error.name or "").startswith("nearharmonic"):
                raise


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.* is deprecated:DeprecationWarning")  # of a library below jax_md
def test_references_in_docstrings_resolve():
    names = [info.name for info in walk_packages(nh.__path__, "nearharmonic.") if ".templates" not in info.name]
    found, missing = 0, []
    for module in modules_of(["nearharmonic", *names]):
        for one, owner in owners(module):
            for target in references(one.__doc__ or ""):
                found += 1
                if not resolves(target, module, owner):
                    missing.append((module.__name__, getattr(one, "__qualname__", ""), target))
    assert found > 300
    assert missing == []


# --- systems, tableaus and registries as a notebook and an interpreter show them --------------------------------------


class Cells(HTMLParser):
    """The texts of a table's cells; every element that is opened must be closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.cells = [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        assert self.open[-1] in ("td", "th", "caption")
        self.cells.append(data)


@pytest.mark.parametrize("entry", [*nh.systems.values(), *nh.integrators.values()], ids=lambda entry: entry.name)
def test_entry_is_line_with_name_and_table_of_facts(entry):
    line = repr(entry)
    assert line.startswith(f"<{type(entry).__name__} {entry.name}: label {entry.label}, ")
    assert "\n" not in line
    assert len(line) < 200
    cells = Cells(entry._repr_html_()).cells
    assert {entry.name, entry.label} <= set(cells)


def test_a_tableau_shows_each_coefficient():
    (row,) = [cell for cell in Cells(nh.integrators["leapfrog"]._repr_html_()).cells if cell == "0.5, 0.5"]
    assert row


@pytest.mark.parametrize("registry", [nh.systems, nh.integrators], ids=["systems", "integrators"])
def test_registry_is_table_with_row_for_each_entry(registry):
    html = registry._repr_html_()
    assert html.count("<tr>") == len(registry) + 1
    assert set(registry) <= set(Cells(html).cells)
    assert "\n" not in repr(registry)


def test_what_a_user_writes_is_no_markup():
    from support.methods.own_systems import spring

    shown = spring(label="<b>spring</b> & more")._repr_html_()
    assert "<b>" not in shown
    assert "&lt;b&gt;spring&lt;/b&gt; &amp; more" in shown
