"""docs/start/gallery.md: each example stands there, with its own lines."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/start/gallery.md").read_text(encoding="utf-8")


def test_each_example_stands_there_with_lines_of_its_file():
    found = dict(re.findall(r'<details id="(\w+)">.*?```python\n(.*?)```', PAGE, re.DOTALL))
    examples = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / "examples").glob("*.py")}
    assert found.keys() == examples.keys()
    assert len(found) >= 16
    for name, code in found.items():
        *lines, last = code.strip().splitlines()
        own = {line.strip() for line in examples[name].splitlines()}
        assert {line.strip() for line in lines} <= own, name
        assert last.endswith(f'.savefig("{name}.png")'), name
        assert len(lines) <= 25, name
