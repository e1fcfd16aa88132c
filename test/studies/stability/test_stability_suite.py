"""How hard cases are run and told: margins, figures, errors, the command and its pictures."""

import json
import math

import numpy as np
import pytest

from physics_prior import cli
from physics_prior.errors import PhysicsPriorError, SimulationError
from physics_prior.studies.stability import registry
from physics_prior.studies.stability.case import Check, Curve, Picture, case
from physics_prior.studies.stability.suite import figures, run_case


@case(1, "a case that passes", "others fail")
def passing(thorough):
    yield Check("half its bound", 0.5, 1.0, "m")
    yield Check("a tenth of its bound", 0.1 if thorough else 0.2, 1.0)
    yield Check("nothing", 0.0, 0.0)
    yield Picture("line", "a line", "x", "y", [Curve("a", np.arange(3), np.ones(3))], "y", (("bound", 2.0),))
    many = [Curve(str(k), np.arange(3), np.full(3, 1.0 + k), dots=k % 2 == 0) for k in range(12)]
    yield Picture("lines", "lines", "x", "y", many)


@case(2, "a case that fails", "others do not")
def failing(thorough):
    yield Check("well within", 1e-9, 1.0)
    yield Check("not a number", math.nan, 1.0)


@case(3, "a case that is refused", "others, too")
def refusing(thorough):
    yield Check("before", 0.0, 1.0)
    raise SimulationError("the motion is not finite")


@pytest.fixture
def three(monkeypatch):
    monkeypatch.setattr(registry, "CASES", (passing, failing, refusing))


@pytest.mark.parametrize(
    ("measured", "bound", "passed", "margin"),
    [
        (0.5, 1.0, True, 2.0),
        (1.0, 1.0, True, 1.0),
        (2.0, 1.0, False, 0.5),
        (0.0, 0.0, True, math.inf),
        (1.0, 0.0, False, 0.0),
        (-1.0, 0.2, True, math.inf),
        (math.nan, 1.0, False, 0.0),
        (math.inf, 1.0, False, 0.0),
    ],
)
def test_margins(measured, bound, passed, margin):
    check = Check("", measured, bound)
    assert check.passed is passed
    assert check.margin == margin


def test_outcomes():
    good, bad, refused = (run_case(each) for each in (passing, failing, refusing))
    assert good.passed
    assert good.tightest.what == "half its bound"
    assert [picture.name for picture in good.pictures] == ["line", "lines"]
    assert not bad.passed
    assert bad.tightest.what == "not a number"
    assert not refused.passed
    assert refused.tightest.what == "the motion is not finite"
    assert run_case(passing, thorough=False).checks[1].measured == 0.2


def test_figures_are_json_as_the_issue_asks_for_it():
    data = json.loads(json.dumps(figures([run_case(each) for each in (passing, failing, refusing)]), allow_nan=False))
    assert set(data) == {"cases", "passed", "failed"}
    assert (data["passed"], data["failed"]) == (1, 2)
    good, bad, refused = data["cases"]
    assert {"id", "name", "measured", "bound", "passed"} <= set(good)
    assert (good["id"], good["name"], good["measured"], good["bound"], good["passed"]) == (
        1,
        "a case that passes",
        0.5,
        1.0,
        True,
    )
    assert len(good["checks"]) == 3
    assert (bad["measured"], bad["passed"]) == (None, False)
    assert (refused["error"], refused["measured"]) == ("the motion is not finite", None)


def test_command(three, tmp_path, capsys):
    path, pictures = tmp_path / "out.json", tmp_path / "new" / "pictures"
    assert cli.main(["stability", "passing", "--json", str(path), "--plot", str(pictures)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "1 of 1 hard cases passed" in lines[0]
    (line,) = [line for line in lines if "half its bound" in line]
    assert all(word in line for word in ("a case that passes", "0.5 m", "1 m", "2", "others fail"))
    assert json.loads(path.read_text())["passed"] == 1
    assert {each.name for each in pictures.iterdir()} == {"margins.png", "01_line.png", "01_lines.png"}
    assert all(each.read_bytes().startswith(b"\x89PNG") for each in pictures.iterdir())


def test_command_exits_with_one_where_a_case_fails(three, tmp_path, capsys):
    assert cli.main(["stability", "1", "2", "--plot", str(tmp_path)]) == 1
    assert "FAILED" in capsys.readouterr().out
    assert cli.main(["stability", "--json", "-"]) == 1
    out = capsys.readouterr().out
    assert [each["id"] for each in json.loads(out)["cases"]] == [1, 2, 3]


def test_command_refuses_what_it_does_not_know(three, tmp_path, capsys):
    assert cli.main(["stability", "nonsense"]) == 2
    assert "case 'nonsense' is unknown; known are 1 passing" in capsys.readouterr().err
    assert cli.main(["stability", "1", "--json", str(tmp_path / "no" / "out.json")]) == 2
    assert "does not exist" in capsys.readouterr().err
    file = tmp_path / "file"
    file.touch()
    assert cli.main(["stability", "1", "--plot", str(file)]) == 2
    assert "give a folder" in capsys.readouterr().err
    with pytest.raises(PhysicsPriorError):
        registry.chosen(["31"])


def test_cases_by_number_and_by_key_each_once():
    picked = registry.chosen(["dzhanibekov", "3", "11"])
    assert [case.id for case in picked] == [3, 11]
    assert len(registry.chosen([])) == len(registry.CASES)
