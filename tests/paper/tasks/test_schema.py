"""Records with odd types: each is refused with the name of its key, whatever its seal says."""

import json

import pytest

from nearharmonic.errors import ResultFileError
from nearharmonic.output.atomic import sealed
from nearharmonic_paper.record import history, manifest
from nearharmonic_paper.tasks.provenance import damaged_receipts, receipts_in
from support.results import finished_results
from support.results.finished_results import HISTORY

ODD = (None, True, -1, 0.5, 10**400, "", "x", [], [[]], {}, {"x": {}}, "a\x00b", "..", 1e400, [1], {"": None})
#: What each key may be besides its own type; the history of an older version lacks keys, which are then null.
ALLOWED = {
    "systems": ([],), "integrators": ([],), "volatile": ([],), "settings": (None, "", "x", "a\x00b", ".."),
    "code": ("", "x", "a\x00b", ".."), "coefficients": ("", "x", "a\x00b", ".."), "evaluations": (None,),
    "inputs": ({},), "definitions": ({},), "run": (None, "", "x", "a\x00b", ".."), "modified": (-1,),
}  # fmt: skip


@pytest.fixture
def result(tmp_path):
    return finished_results.write_result(tmp_path / "results/little")


def is_among(value, allowed):
    return any(type(value) is type(one) and value == one for one in allowed)


def entry():
    """An entry of a receipt with all keys."""
    more = {"modified": 1, "settings": "67" * 32, "evaluations": 5, "inputs": {"runs/kepler/ruth/0.h5": "x"}}
    return finished_results.entry(b"", "an id") | more | {"definitions": {}}


def receipt_of(result, files):
    place = result / "logs/reduce.json"
    place.write_text(json.dumps(sealed({"files": files})))
    return place


def test_entry_of_odd_type_is_refused_in_receipt_and_manifest(result, trials):
    campaign = trials("F. odd types in a sealed record")
    for key in entry():
        for odd in ODD:
            if is_among(odd, ALLOWED.get(key, ())):
                continue
            with campaign.case((key, odd)):
                files = {"cubes/kepler.h5": entry() | {key: odd}}
                place = receipt_of(result, files)
                assert damaged_receipts(result) == [place]
                assert list(receipts_in(result)) == []
                told = {"format": "nearharmonic manifest 1", "files": files, "changed": []}
                (result / "manifest.json").write_text(json.dumps(sealed(told)))
                if key in {"modified", "run"}:  # the manifest has no such keys
                    continue
                with pytest.raises(ResultFileError, match=rf"manifest\.json has files\.cubes/kepler\.h5\.{key}"):
                    manifest.read(result)


def test_entry_with_each_key_is_read(result):
    receipt_of(result, {"cubes/kepler.h5": entry()})
    assert damaged_receipts(result) == []


@pytest.mark.parametrize("key", ["format", "files", "changed", "former", "unrecorded", "configfiles"])
@pytest.mark.parametrize("odd", [None, 1, "x", {"../x": {}}, ["../x", 1], {"/x": 1}])
def test_manifest_of_odd_types_is_one_sentence(result, key, odd):
    told = {"format": "nearharmonic manifest 1", "files": {}, "changed": []} | {key: odd}
    (result / "manifest.json").write_text(json.dumps(sealed(told)))
    with pytest.raises(ResultFileError) as error:
        manifest.read(result)
    assert f"manifest.json has {key}" in str(error.value)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("key", "odd"),
    [
        *((key, odd) for key in ("start", "config", "status", "made") for odd in (1, ["x", 1], True)),
        *((key, "x") for key in ("duration", "cores", "command", "versions", "user_files")),
        *((key, "x") for key in ("cpu", "jobs_run", "process")),
        *((key, -1) for key in ("duration", "cpu_seconds", "cores", "evaluations")),
        *(("id", odd) for odd in (1, "", "../../x", "a b", "x" * 101, "\x1b[2J")),
        ("made", ["../../evil"]), ("duration", 1e400), ("config", {"a": None}), ("versions", {"numpy": 2}),
    ],
)  # fmt: skip
def test_history_line_of_odd_type_is_named(result, key, odd):
    line = HISTORY[-1] | {key: odd if odd != {"a": None} else nested(50)}
    text = json.dumps(sealed(line | {"before": None}))
    (result / "history.jsonl").write_text(f"{text}\n")
    (found,) = history.lines_of(result / "history.jsonl")
    assert found.fault.startswith("is no run: it has")
    assert found.run["status"] == "damaged"


def nested(levels):
    """A config of many levels, which functions that call themselves could not read."""
    found = {}
    for _ in range(levels):
        found = {"a": [found]}
    return found
