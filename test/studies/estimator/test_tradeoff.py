"""The study of what accuracy costs the estimator: its figures on a short recording, its picture, its refusals."""

import json
from pathlib import Path

import pytest

from physics_prior import cli
from physics_prior.errors import PhysicsPriorError
from physics_prior.studies.estimator import study
from physics_prior.studies.estimator.study import Point, costs_of, enough, measure, run_study
from physics_prior.studies.estimator.variants import PROBLEMS, Variant
from physics_prior.studies.moving_human import moments

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def recording():
    scene = PROBLEMS["double_pendulum"]()
    return scene, moments(scene, 3.0, seed=1)


def test_smoothing_helps_and_no_physics_costs(recording):
    """RMSE 0.24 deg with the shipped noise, 0.17 smoothed by 0.4 s more, 1.2 without physics; NEES 0.7 to 0.9."""
    scene, moments_of = recording
    plain, late, none = (
        measure("double_pendulum", scene, variant, moments_of, 1.0)
        for variant in (Variant(), Variant(lag=0.4), Variant(process="kinematic"))
    )
    assert late.rmse_deg < 0.95 * plain.rmse_deg
    assert none.rmse_deg > 2.0 * plain.rmse_deg
    assert 0.3 < plain.consistency < 1.7
    assert plain.force_percent < 2.0
    assert none.force_percent != none.force_percent


def test_all_are_timed_at_the_stamps_that_they_read(recording):
    scene, moments_of = recording
    costs = costs_of(scene, (Variant(), Variant(every=4), Variant(lag=0.1)), [each.measurements for each in moments_of])
    assert len(costs) == 3
    assert min(costs) > 0.0


def test_enough_is_the_cheapest_that_noise_hides():
    """Not what is as near but says too little of its error, nor what tells forces worse."""

    def point(series, us, rmse, consistency=1.0, force=1.0):
        return Point("p", series, "", us, rmse, consistency, force)

    euler = [point("semi_implicit_euler", 2.0, 0.99, 5.0), point("semi_implicit_euler", 2.5, 0.99, 1.0, 1.1)]
    rk4 = [point("rk4", 3.0, 1.5), point("rk4", 5.0, 1.01), point("rk4", 9.0, 1.0)]
    assert enough([*euler, *rk4, point("no physics", 1.0, 0.9)], "p") is rk4[1]


def test_unknown_problem_is_named():
    with pytest.raises(PhysicsPriorError, match=r"problem 'x' is unknown: known are \['double_pendulum'"):
        run_study(["x"], 0, lambda share: None)


def test_command_draws_and_writes(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(study, "SECONDS", 1.5)
    monkeypatch.setattr(study, "VARIANTS", (Variant(), Variant(size=10e-3), Variant(every=2), Variant(lag=0.1)))
    card, picture = tmp_path / "card.json", tmp_path / "picture.png"
    assert cli.main(["tradeoff", "double_pendulum", "--json", str(card), "--plot", str(picture)]) == 0
    figures = json.loads(card.read_text())
    assert [point["label"] for point in figures["points"]] == ["20 ms", "10 ms", "1 in 2", "100 ms"]
    assert figures["enough"]["double_pendulum"]["series"] == "rk4"
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "RMSE, deg" in capsys.readouterr().out


def test_recording_is_replayed_by_each_step(monkeypatch, capsys):
    """The shipped bag: 0.219 deg, as ``replay`` says, 1.2 without physics."""
    monkeypatch.setattr(study, "STEPS", (Variant(size=5e-3),))
    words = ["--bag", str(ROOT / "bags/double_pendulum"), "--scene", "double_pendulum"]
    assert cli.main(["tradeoff", *words, "--reference", "/truth/joint_states", "--json", "-"]) == 0
    physics, none = json.loads(capsys.readouterr().out)["points"]
    assert physics["rmse_deg"] == pytest.approx(0.219, abs=2e-3)
    assert physics["consistency"] == pytest.approx(5.880 / 6.0, abs=1e-2)
    assert none["series"] == "no physics"
    assert none["rmse_deg"] > 2.0 * physics["rmse_deg"]
    assert cli.main(["tradeoff", *words]) == 2
    assert "give all three or none" in capsys.readouterr().err
