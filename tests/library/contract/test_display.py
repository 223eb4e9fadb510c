"""Systems, tableaus and registries as a notebook and an interpreter show them."""

from __future__ import annotations

from html.parser import HTMLParser

import pytest

import nearharmonic as nh


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
