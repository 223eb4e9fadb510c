"""``nearharmonic verify-tableau``: words, JSON and exit status."""

from __future__ import annotations

import json

import pytest

from nearharmonic.cli import main
from support.methods.tableau_files import path


def test_failing_claim_gives_status_1_and_its_proof(capsys):
    assert main(["verify-tableau", path("libraries", "desolver_babs9o7h")]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "BABs9o7H of desolver: 1 of 2 claims does not hold"
    assert lines[1].split() == ["claim", "holds", "proof"]
    assert lines[2].startswith("rows sum to 1                    yes      kick 1+4.0e-17 (16 digits allow 6.0e-15)")
    start = "order = 7 for every separable H  no       order 4: the conditions up to degree 4 vanish"
    assert lines[3].startswith(start)
    assert "one of degree 5 is off by -2.6e-05 (16 digits allow 4.1e-17)" in lines[3]
    assert "nearest registered method: BAB's9o7H (babps9o7h): the same to all digits" in lines


def test_claims_that_hold_give_status_0(capsys):
    assert main(["verify-tableau", path("published", "mclachlan_atela_4")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "mclachlan_atela_4: all claims hold"
    assert "order: 3 for every separable H, 4 for quadratic T, 4 on the oscillator" in lines
    assert "symmetric: no" in lines


@pytest.mark.slow
def test_degree_of_the_potential_adds_its_order(capsys):
    assert main(["verify-tableau", path("published", "na7"), "--degree", "3"]) == 0
    assert "order: 6 for quadratic T and V of degree 3" in capsys.readouterr().out.splitlines()
    assert main(["verify-tableau", path("published", "na7"), "--degree", "2", "--format", "json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["polynomial_order"]["degree"], found["polynomial_order"]["order"]) == (2, found["oscillator_order"])
    assert main(["verify-tableau", path("published", "na7"), "--degree", "1"]) == 2
    assert "degree = '1' is not allowed: an integer from 2" in capsys.readouterr().err


@pytest.mark.parametrize(("kind", "name", "status"), [("published", "na7", 0), ("damaged", "sign", 1)])
def test_json_holds_every_claim_and_what_is_proved(kind, name, status, capsys):
    assert main(["verify-tableau", path(kind, name), "--format", "json"]) == status
    found = json.loads(capsys.readouterr().out)
    assert found["holds"] == (status == 0)
    assert {claim["says"].partition(" ")[0] for claim in found["claims"]} >= {"rows", "order"}
    assert (found["first"], found["kicks"], found["drifts"], found["symmetric"]) == ("drift", 7, 8, True)
    if status == 0:
        assert (found["order"]["order"], found["quadratic_order"]["order"], found["harmonic_order"]) == (4, 6, 6)
        assert found["quadratic_order"]["failing"]["degree"] == 7
        assert found["suspects"] == []
    else:
        (suspect,) = found["suspects"]
        assert suspect["kick"][2].startswith("-0.197")
        assert found["stability_limit"] is None


def test_a_file_as_export_writes_it_is_read(tmp_path, capsys):
    from nearharmonic.integrators import integrators

    t = integrators["aba864"]
    document = {
        "name": t.name, "label": t.label, "source": t.source, "order": t.order, "harmonic_order": t.harmonic_order,
        "requires": t.requires, "first": t.first, "digits": t.digits, "kick": list(t.kick), "drift": list(t.drift),
    }  # fmt: skip
    (tmp_path / "aba864.json").write_text(json.dumps(document))
    assert main(["verify-tableau", str(tmp_path / "aba864.json")]) == 0
    assert "nearest registered method: ABA864 (aba864): the same to all digits" in capsys.readouterr().out


def test_python_file_of_integrator_is_verified_like_its_export(capsys):
    from pathlib import Path

    example = Path(__file__).parents[3] / "examples/fourth_order.py"
    for place in (str(example), f"{example}:five_leapfrogs"):
        assert main(["verify-tableau", place]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == "five leapfrogs: all claims hold"
        assert any(line.startswith("order = 4 for every separable H") for line in lines)
    assert main(["verify-tableau", f"{example}:six"]) == 2
    assert "unknown integrator" in capsys.readouterr().err


def test_status_of_several_files_is_that_of_worst(capsys):
    good, bad = path("libraries", "suzuki_yoshida_7"), path("libraries", "desolver_babs9o7h")
    assert main(["verify-tableau", good, good]) == 0
    assert main(["verify-tableau", good, bad]) == 1
    assert main(["verify-tableau", good, bad, "none.toml"]) == 2
    assert capsys.readouterr().err == "nearharmonic: none.toml: there is no such file\n"


@pytest.mark.slow
@pytest.mark.parametrize("form", ["json", *(pytest.param(form, marks=pytest.mark.slow) for form in ("table", "csv"))])
def test_answer_for_several_files_holds_each_answer(form, capsys):
    files = [path("libraries", name) for name in ("suzuki_yoshida_7", "desolver_babs9o7h")]
    single = []
    for file in files:
        main(["verify-tableau", file, "--format", form])
        single.append(capsys.readouterr().out)
    main(["verify-tableau", *files, "--format", form])
    found = capsys.readouterr().out
    if form == "table":
        assert found == "\n".join(single)
    elif form == "json":
        assert json.loads(found) == list(map(json.loads, single))
    else:
        rows = [f"{file},{row}" for file, text in zip(files, single, strict=True) for row in text.splitlines()[1:]]
        assert found.splitlines() == ["file,claim,holds,proof", *rows]


def test_nothing_is_printed_if_one_of_several_is_unreadable(capsys):
    assert main(["verify-tableau", path("libraries", "suzuki_yoshida_7"), "none.toml"]) == 2
    assert capsys.readouterr().out == ""
