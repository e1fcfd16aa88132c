"""Tolerances asked of problems whose motion is known: what is chosen keeps them, and how it is judged."""

import json
from dataclasses import replace

import pytest

from physics_prior import cli
from physics_prior.errors import SceneError
from physics_prior.studies.accuracy import knob
from physics_prior.studies.accuracy.knob import Turn, knob_table, turns
from physics_prior.studies.accuracy.problem import PROBLEMS
from physics_prior.studies.accuracy.schemes import own_schemes


def brief(key):
    """A problem over its first second, at two of the study's steps."""
    problem = PROBLEMS[key]

    def make():
        whole = problem.make()
        kept = whole.times <= 1.0
        return replace(whole, times=whole.times[kept], values=whole.values[kept])

    return replace(problem, make=make, steps=problem.steps[:2])


def explicit(problem):
    return [scheme for scheme in own_schemes(problem) if scheme.name in ("rk4", "dop853")]


@pytest.mark.parametrize("key", ["pendulum", "double_pendulum"])
def test_what_is_asked_is_kept_against_a_reference_of_other_origin(key, monkeypatch):
    """Worst of both and of three tolerances: 0.93 times what is asked."""
    monkeypatch.setattr(knob, "TOLERANCES", (1e-3, 1e-5, 1e-7))
    monkeypatch.setattr(knob, "own_schemes", explicit)
    for turn in turns(brief(key)):
        assert turn.scheme is not None
        assert 0.0 < turn.error <= 1.01


def test_a_refusal_is_a_turn_too(monkeypatch):
    def refused(course, tolerance):
        raise SceneError(f"{tolerance:g} cannot be told")

    monkeypatch.setattr(knob, "TOLERANCES", (1e-9,))
    monkeypatch.setattr(knob, "Trials", refused)
    monkeypatch.setattr(knob, "own_schemes", explicit)
    (turn,) = turns(brief("pendulum"))
    assert (turn.scheme, turn.kept, turn.why) == (None, False, "1e-09 cannot be told")


def test_what_is_kept_is_both_exact_and_cheap():
    good, coarse, dear = (
        Turn("p", 1e-3, "rk4", 1e-3, None, error, cost) for error, cost in ((2.9, 1.9), (3.1, 1.0), (1.0, 2.1))
    )
    assert (good.kept, coarse.kept, dear.kept) == (True, False, False)
    assert Turn("p", 1e-9, "rk4", 1e-3, 0.3, 0.5, None).kept  # the study has nothing so exact
    assert [*knob_table([good, coarse, dear]).columns[-1].cells] == ["", "*", "*"]


def test_the_command_tells_and_writes(monkeypatch, tmp_path, capsys):
    told = [Turn("pendulum", 1e-2, "rk4", 0.05, None, 0.5, 1.0), Turn("pendulum", 1e-9, why="it cannot be told")]
    monkeypatch.setattr(knob, "run_knob", lambda problems, progress: told)
    path = tmp_path / "knob.json"
    assert cli.main(["accuracy", "pendulum", "--knob", "--json", str(path)]) == 0
    assert [turn["kept"] for turn in json.loads(path.read_text())["turns"]] == [True, False]
    assert "refused: it cannot be told" in capsys.readouterr().out
    assert cli.main(["accuracy", "pendulum", "--knob", "--peers"]) == 2
