"""Results by folder or by name, and errors for unknown names."""

from __future__ import annotations

from pathlib import Path

import pytest

from nearharmonic.errors import UnknownNameError
from nearharmonic_paper.record.manifest import folder_of, result_names


def test_result_is_named_by_its_folder_or_below_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UnknownNameError, match=r"no folder below results/ holds a result\. Make the first: snakemake"):
        folder_of("paper")
    for place in ("results/paper/cubes", "results/smoke", "results/empty", "elsewhere/mine", "paper"):
        Path(place).mkdir(parents=True)
    Path("results/smoke/history.jsonl").touch()
    Path("elsewhere/mine/manifest.json").touch()
    assert [folder_of(name) for name in ("paper", "smoke")] == [Path("results/paper"), Path("results/smoke")]
    for name in ("results/paper", "elsewhere/mine", tmp_path / "elsewhere/mine"):
        assert folder_of(str(name)) == Path(name)
    assert result_names() == ["paper", "smoke"]
    with pytest.raises(UnknownNameError, match=r"^unknown result 'papr'\. Did you mean 'paper'\? Known: paper, smoke$"):
        folder_of("papr")
    with pytest.raises(UnknownNameError, match="unknown result 'empty'"):
        folder_of("empty")
