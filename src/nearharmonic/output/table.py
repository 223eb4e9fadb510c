"""Tables as CSV, Markdown, LaTeX and text, answers of commands, and generated parts of Markdown pages."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import struct
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, isnan
from pathlib import Path
from typing import Any

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.atomic import write_text

# --- Text for a terminal: escape sequences in names from files never reach it.

#: Control characters except tab and line feed; marks of direction and of no width; separators; halves of surrogates.
_UNSAFE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u00ad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ud800-\udfff\U000e0000-\U000e007f]"
)


def progress(line: str) -> None:
    """Write a line on the progress of a long computation to the terminal, past the log of a job."""
    print(line, file=sys.__stderr__, flush=True)


def printable(text: str) -> str:
    r"""Return ``text`` with an escape such as ``\u001b`` in place of each character that controls a terminal.

    Inside a string of JSON the escape means the same character. Tabs and line feeds stay.
    """
    return _UNSAFE.sub(_escaped, text)


def in_one_line(text: str) -> str:
    """Return ``text`` as :func:`printable` does, with its tabs and line feeds escaped too."""
    return printable(text).replace("\n", "\\n").replace("\t", "\\t")


def _escaped(found: re.Match[str]) -> str:
    units = struct.iter_unpack(">H", found[0].encode("utf-16-be", "surrogatepass"))
    return "".join(f"\\u{unit:04x}" for (unit,) in units)


# --- Tables, written atomically, and tables read from CSV.

#: Endings of the files of a table.
SUFFIXES = ("csv", "md", "tex")
#: Digits of a float in Markdown and LaTeX; CSV has all digits.
SHOWN = 4

#: Text, integer, float, truth value, or None for an empty cell.
Cell = Any


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table: names of columns, rows of as many cells, and a sentence above it, which is a comment in LaTeX.

    ``volatile`` are the names of the columns of measured times, which differ from run to run. Rows of another length
    than the header raise a NearharmonicError.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    caption: str = ""
    volatile: Sequence[str] = ()

    def __post_init__(self) -> None:
        for i, row in enumerate(self.rows):
            if len(row) != len(self.header):
                raise NearharmonicError(f"row {i} has {len(row)} cells under {len(self.header)} names: {list(row)}")

    def records(self) -> list[dict[str, Cell]]:
        """Return each row as the cells by the names of their columns."""
        return [dict(zip(self.header, row, strict=True)) for row in self.rows]

    def csv(self) -> str:
        """Return the header and the rows as CSV, with every digit."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.header, *self.rows])
        return text.getvalue()

    def markdown(self) -> str:
        """Return the caption and the table in Markdown, floats to four digits."""
        cells = [[in_markdown(_shortened(cell)) for cell in row] for row in self.rows]
        table = _tabulate(list(map(in_markdown, self.header)), cells, "github")
        return f"{_one_line(self.caption)}\n\n{table}\n"

    def latex(self) -> str:
        """Return the caption and the table in LaTeX, floats to four digits, formulas and numbers in math mode."""
        header, *rows = ([in_latex(_shortened(cell)) for cell in row] for row in (self.header, *self.rows))
        head, *body = (" & ".join(row) + r" \\" for row in (header, *rows))
        frame = (rf"\begin{{tabular}}{{{'l' * len(header)}}}", r"\toprule", head, r"\midrule", *body, r"\bottomrule")
        return "\n".join((f"% {_one_line(self.caption)}", *frame, r"\end{tabular}", ""))

    def lines(self, digits: int | None = None) -> list[str]:
        """Return the caption and the rows as lines of aligned columns for a terminal, floats to ``digits``.

        There is no header above no rows.
        """
        caption = [in_one_line(self.caption)] if self.caption else []
        if not self.rows:
            return caption
        cells = [[_in_words(cell, digits) for cell in row] for row in self.rows]
        sides = ["right" if all(map(_is_number, column)) else "left" for column in zip(*self.rows, strict=True)]
        aligned = _tabulate(self.header, cells, "plain", colalign=sides)
        return [*caption, *(line.rstrip() for line in aligned.splitlines())]


def _tabulate(header: Sequence[str], cells: Sequence[Sequence[str]], form: str, **options: Any) -> str:
    import tabulate

    # Otherwise the widths, and with them the bytes of a file, depend on whether the package wcwidth is installed.
    before, tabulate.WIDE_CHARS_MODE = tabulate.WIDE_CHARS_MODE, False
    try:
        return str(tabulate.tabulate(cells, list(header), tablefmt=form, disable_numparse=True, **options))
    finally:
        tabulate.WIDE_CHARS_MODE = before


def _shortened(cell: Cell) -> str:
    return f"{cell:.{SHOWN}g}" if isinstance(cell, float) else str(cell)


def _is_number(cell: Cell) -> bool:
    return cell is None or (isinstance(cell, int | float) and not isinstance(cell, bool))


def _in_words(cell: Cell, digits: int | None) -> str:
    """Return the text of a cell: floats are shortened, truth values are words, None and NaN are a dash."""
    if cell is None or cell == "" or (isinstance(cell, float) and isnan(cell)):
        return "-"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    return f"{cell:.{digits}g}" if isinstance(cell, float) and digits else in_one_line(str(cell))


def in_markdown(text: str) -> str:
    """Return ``text`` for a cell in Markdown: bars, tags and links of labels are escaped, line feeds are spaces."""
    text = re.sub(r"(?<!\\)\|", r"\|", _one_line(text))
    return re.sub(r"<(?=[A-Za-z/!?])", "&lt;", text).replace("](", "]\\(")


#: Symbol of a formula with its indices, such as Qbar[0,0], Cbar_2, d(1) or tau^2; a number; a whole formula.
_SYMBOL = re.compile(r"\b(tau|[A-Za-z])(bar)?(_[A-Za-z0-9]|\[[0-9,]+\]|\^[0-9]+|\([0-9]\))(?![\w(])")
_NUMBER = re.compile(r"[-+]?[0-9]+(?:\.[0-9]+)?(?:e[-+]?[0-9]+)?")
_FORMULA = re.compile(rf"(?:{_SYMBOL.pattern}|[A-Za-z](?![A-Za-z])|[0-9]+|[-+=/() ])+")
_LATEX = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\^{}", "<": "$<$", ">": "$>$", "|": "$|$"}
_LATEX |= {sign: f"\\{sign}" for sign in "#$%&_{}"}


def in_latex(text: str) -> str:
    """Return ``text`` for a cell in LaTeX: formulas and numbers in math mode, with digits in groups, the rest escaped.

    Powers of ten are written as such. Decimals have groups of five digits, integers above 9999 groups of three.
    """
    text = _one_line(text)
    if _NUMBER.fullmatch(text):
        mantissa, _, exponent = text.partition("e")
        whole, point, decimals = mantissa.partition(".")
        whole = re.sub(r"(?<=[0-9])(?=(?:[0-9]{3})+$)", r"\\,", whole) if len(whole.lstrip("+-")) > 4 else whole
        digits = whole + point + re.sub(r"([0-9]{5})(?=[0-9])", r"\1\\,", decimals)
        power = rf"10^{{{int(exponent)}}}" if exponent else ""
        return f"${digits}" + (rf" \times {power}$" if power else "$")
    if _FORMULA.fullmatch(text) and _SYMBOL.search(text):
        return f"${_SYMBOL.sub(_symbol, text)}$"
    parts = _SYMBOL.sub(lambda found: f"\0{_symbol(found)}\0", text).split("\0")
    return "".join(f"${part}$" if i % 2 else "".join(_LATEX.get(c, c) for c in part) for i, part in enumerate(parts))


def _symbol(found: re.Match[str]) -> str:
    letter, bar, index = found.groups()
    letter = (r"\bar " if bar else "") + letter.replace("tau", r"\tau")
    return letter + re.sub(r"\[(.*)\]", r"_{\1}", re.sub(r"\^(.*)", r"^{\1}", index))


def _one_line(text: str) -> str:
    return re.sub(r"\s*[\n\r]\s*", " ", text)


def from_csv(text: str) -> Table:
    """Return the table whose CSV is ``text``, every cell a text; a NearharmonicError says that it is no table."""
    try:
        header, *rows = csv.reader(io.StringIO(text))
    except (ValueError, csv.Error) as error:
        raise NearharmonicError("there is no table") from error
    return Table(header=header, rows=rows)


def save(table: Table, places: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """Write ``table`` to each of ``places``, in the format of its ending, one of :data:`SUFFIXES`; return the paths."""
    texts = {".csv": table.csv, ".md": table.markdown, ".tex": table.latex}
    paths = [Path(place) for place in places]
    for path in paths:
        if path.suffix not in texts:
            raise NearharmonicError(f"{path}: a table is written as {', '.join(SUFFIXES)}")
        write_text(path, texts[path.suffix]())
    return paths


def save_document(document: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Write nested numbers and strings to ``path`` as TOML."""
    import tomli_w

    write_text(path, tomli_w.dumps(document))


# --- Generated parts of Markdown pages: tables, numbers, and the marks between which a part stands.


def pipes(header: Sequence[str], rows: Iterable[Sequence[Cell]], align: str = "l") -> list[str]:
    """Return the lines of a table in Markdown without padding, with cells written by ``str``.

    ``align`` has a letter, ``l`` or ``r``, for each column; the last letter holds for all further columns.
    """
    marks = ["---:" if align[min(i, len(align) - 1)] == "r" else "---" for i in range(len(header))]
    body = (f"| {' | '.join(map(_cell, row))} |" for row in rows)
    return [f"| {' | '.join(header)} |", f"|{'|'.join(marks)}|", *body]


def _cell(cell: Cell) -> str:
    return re.sub(r"(?<!\\)\|", r"\|", str(cell))


def filled(page: str, parts: Mapping[str, str]) -> str:
    """Return a page with each text of ``parts`` between the lines ``<!-- name -->`` and ``<!-- end -->``.

    A NearharmonicError says that the page has not exactly one place for a name.
    """
    for name, text in parts.items():
        before, *rest = page.split(f"<!-- {name} -->\n")
        if len(rest) != 1 or "<!-- end -->" not in rest[0]:
            message = f"the page has {len(rest)} places for {name}, each from <!-- {name} --> to <!-- end -->"
            raise NearharmonicError(message)
        _, end, after = rest[0].partition("<!-- end -->")
        page = f"{before}<!-- {name} -->\n{text}\n{end}{after}"
    return page


def filled_page(place: str, parts: Mapping[str, str]) -> str:
    """Return the page of a file, filled as :func:`filled` does."""
    return filled(Path(place).read_text(encoding="utf-8"), parts)


_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def short(number: float, digits: int = 3) -> str:
    """Return the text of a number with ``digits`` significant digits, in words if it is not finite."""
    if not isfinite(number):
        return "beyond all bounds"
    mantissa, _, exponent = f"{number:.{digits}g}".partition("e")
    return f"{mantissa} × {power_of_ten(int(exponent))}" if exponent else mantissa


def power_of_ten(exponent: int) -> str:
    """Return the text of a power of ten, such as 10⁻³⁰."""
    return f"10{str(exponent).translate(_SUPERSCRIPTS)}"


# --- Answers of commands, and their output as a table, as JSON, or as CSV.

FORMATS = ("table", "json", "csv")
#: Significant digits of a float in a table: as many as the step sizes of a grid have.
SHOWN_IN_ANSWERS = 6


@dataclass(frozen=True, kw_only=True)
class Answer(Table):
    """Answer of a command: a table, with an exit status and notes."""

    #: Content of the JSON output: nested mappings, sequences and cells. If None, a list with an object for each row.
    document: Any = None
    #: Exit status: 0 for yes, which includes an empty answer; 1 for no.
    status: int = 0
    #: Lines below the table. JSON and CSV have no caption and notes.
    notes: Sequence[str] = ()
    #: Significant digits of the floats of the table, None for all digits, which JSON and CSV have.
    digits: int | None = SHOWN_IN_ANSWERS
    #: Text that is printed in place of a table.
    text: str | None = None


def printed(answer: Answer, form: str) -> str:
    """Return the text of ``answer`` in one of :data:`FORMATS`, with a final line feed unless it is empty."""
    if form == "csv":
        text = answer.csv()
    elif form == "json":
        document = answer.records() if answer.document is None else answer.document
        text = json.dumps(_without_infinities(document), indent=1, ensure_ascii=False, allow_nan=False)
    else:
        table = [*answer.lines(answer.digits), *map(in_one_line, answer.notes)]
        text = "\n".join(table) if answer.text is None else answer.text
    return text if text.endswith("\n") or not text else f"{text}\n"


def _without_infinities(value: Any) -> Any:
    """``value`` with null for every float that JSON cannot express."""
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _without_infinities(member) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [_without_infinities(member) for member in value]
    return value
