"""The study of accuracy: its contestants against each other, its front, its card and its command. Nothing here asks how fast."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from physics_prior import cli
from physics_prior.errors import PhysicsPriorError
from physics_prior.studies.accuracy import measure as measuring
from physics_prior.studies.accuracy import problem as problems
from physics_prior.studies.accuracy import study, trajectory
from physics_prior.studies.accuracy.card import unmeasured_table
from physics_prior.studies.accuracy.compiled import Compiled
from physics_prior.studies.accuracy.drawing import _absent
from physics_prior.studies.accuracy.front import front, seconds_to_reach
from physics_prior.studies.accuracy.measure import Point, measure
from physics_prior.studies.accuracy.problem import PROBLEMS
from physics_prior.studies.accuracy.schemes import own_schemes
from physics_prior.studies.accuracy.textbook import FORMULATIONS, Textbook
from physics_prior.studies.accuracy.trajectory import Setting

COARSE = [Setting(0.05), Setting(0.025)]


@pytest.fixture(autouse=True)
def nothing_is_too_slow(monkeypatch):
    """A busy machine gives up no run."""
    for module in (measuring, trajectory):
        monkeypatch.setattr(module, "LONGEST", math.inf)


def point(error, seconds, scheme="rk4", engine="compiled"):
    return Point(engine, scheme, 0.01, None, error, 0.0, 0.0, seconds)


def short(key):
    """A problem over its first second."""
    problem = PROBLEMS[key]

    def make():
        whole = problem.make()
        kept = whole.times <= 1.0
        return replace(whole, times=whole.times[kept], values=whole.values[kept])

    return replace(problem, make=make)


def two_schemes(_):
    return [Compiled("rk4", COARSE, "rk4"), Textbook("generalized", "rk4", COARSE[:1])]


def test_the_front_holds_what_nothing_beats():
    coarse, fine, beaten, lost = point(1e-2, 1.0), point(1e-4, 10.0), point(1e-3, 20.0), point(math.inf, math.inf)
    assert front([beaten, fine, lost, coarse]) == [coarse, fine]


def test_time_to_reach_an_error_is_straight_in_logarithms():
    points = [point(1e-2, 1.0), point(1e-4, 10.0), point(1e-8, 40.0, "dop853")]
    assert seconds_to_reach(points, 1e-3) == pytest.approx(10**0.5)
    assert seconds_to_reach(points, 1e-1) == 1.0
    assert seconds_to_reach(points, 1e-6) == 40.0  # no way between two schemes
    assert seconds_to_reach(points, 1e-9) is None


@pytest.mark.parametrize("key", ["pendulum", "double_pendulum"])
def test_kernels_and_textbook_make_the_same_error(key):
    """RK4 in joint coordinates, compiled and in NumPy, over 1 s."""
    compiled, finer, textbook = measure(short(key), two_schemes(None), rounds=1)
    assert compiled.error == pytest.approx(textbook.error, rel=1e-8)
    assert 8.0 < compiled.error / finer.error < 40.0  # order 4: 16
    assert compiled.energy == pytest.approx(textbook.energy, rel=1e-6)


def test_formulations_differ_by_their_drift():
    """One second of the double pendulum at 20 ms: all follow it, those with explicit joints let them open."""
    schemes = [Textbook(name, "rk4", [Setting(0.02)]) for name in FORMULATIONS]
    found = {point.scheme.split(",")[0]: point for point in measure(short("double_pendulum"), schemes, rounds=1)}
    assert found["generalized"].residual == 0.0
    for name in ("quaternion", "maximal"):
        assert 1e-10 < found[name].residual < 1e-3
    assert max(point.error for point in found.values()) < 1e-3


def test_springs_in_the_textbook_are_those_of_the_kernels():
    """The governor, whose springs also damp, over 200 steps of 10 us: the same RK4 in NumPy. Measured 2.3e-16."""
    benchmark = PROBLEMS["governor"].make()
    run = benchmark.run()
    run.to(2e-3, 1e-5)
    short = replace(benchmark, times=np.array([2e-3]), values=benchmark.values[:1])
    textbook = Textbook("generalized", "rk4", ()).trajectory(short, Setting(1e-5))
    assert np.max(np.abs(run.q - benchmark.q)) > 1e-3
    assert np.max(np.abs(textbook.q[0] - run.q)) < 1e-13
    assert np.max(np.abs(textbook.v[0] - run.v)) < 1e-13


def test_a_motion_that_is_lost_is_told():
    (lost,) = measure(PROBLEMS["governor"], [Compiled("rk4", [Setting(0.01)], "rk4")], rounds=1)
    assert lost.outcome == "lost"
    assert lost.figures()["error"] is None


def test_what_is_finer_than_what_is_too_slow_is_not_begun(monkeypatch):
    monkeypatch.setattr(measuring, "LONGEST", 1e-9)
    first, second = measure(PROBLEMS["pendulum"], [Compiled("rk4", COARSE, "rk4")], rounds=1)
    assert (first.outcome, second.outcome) == ("measured", "too slow")
    assert second.figures()["seconds"] is None
    assert _absent([first, second]) == []
    assert _absent([second]) == ["rk4"]
    told = unmeasured_table({"problems": {"pendulum": {"title": "P", "points": [first.figures(), second.figures()]}}})
    assert [*told.columns[-1].cells] == ["too slow at 25 ms"]


def test_a_run_that_is_too_slow_ends_within_the_first_second(monkeypatch):
    """Steps of 1 us of a motion first looked at after 1 s, by a clock that takes 1 ms a step: given up at 4 s."""
    clock, asked = [0.0], []

    def advance(h, count):
        asked.append(count)
        clock[0] += 1e-3 * count

    monkeypatch.setattr(trajectory, "process_time", lambda: clock[0])
    monkeypatch.setattr(trajectory, "LONGEST", 4.0)
    benchmark = PROBLEMS["governor"].make()
    assert benchmark.times[0] == 1.0
    found = trajectory.run_timed(benchmark, Setting(1e-6), advance, lambda: (benchmark.q, benchmark.v))
    assert found.q is None
    assert 4.0 < found.seconds < 4.05  # it is looked at every 20 ms or so
    assert asked[:4] == [1, 2, 4, 8]


def test_parts_of_a_run_make_the_same_bits():
    """A run that is watched, against one call from time to time."""
    benchmark = short("double_pendulum").make()
    found = Compiled("rk4", (), "rk4").trajectory(benchmark, Setting(1e-3))
    simulator = benchmark.run().simulator
    q, v, now = benchmark.q.copy(), benchmark.v.copy(), 0.0
    simulator.begin(q, v)
    for k, time in enumerate(benchmark.times):
        count = round((time - now) / 1e-3)
        simulator.advance(q, v, (time - now) / count, count)
        now = time
        assert np.array_equal(found.q[k], q)
        assert np.array_equal(found.v[k], v)


@pytest.mark.parametrize("module", ["mujoco", "pinocchio", "exudyn"])
def test_peers_follow_the_same_motion(module):
    """Errors at 10 ms on the double pendulum: MuJoCo and Pinocchio's RK4 8.4e-7 m, as ours; Exudyn 5.1e-3 m."""
    pytest.importorskip(module)
    from physics_prior.studies.accuracy import exudyn_peer, mujoco_peer, pinocchio_peer

    setting = [Setting(0.01)]
    scheme, bound = {
        "mujoco": (mujoco_peer.MuJoCo("RK4", setting), 1e-6),
        "pinocchio": (pinocchio_peer.Pinocchio(setting), 1e-6),
        "exudyn": (exudyn_peer.Exudyn(setting), 1e-2),
    }[module]
    (found,) = measure(PROBLEMS["double_pendulum"], [scheme], rounds=1)
    assert found.error < bound


def test_pinocchio_and_mujoco_close_the_loop():
    """Four-bar at 5 ms, Pinocchio: 7.6e-8 m; at 0.5 ms, MuJoCo implicitfast."""
    pytest.importorskip("pinocchio")
    pytest.importorskip("mujoco")
    from physics_prior.studies.accuracy import mujoco_peer, pinocchio_peer

    schemes = [pinocchio_peer.Pinocchio([Setting(0.005)]), mujoco_peer.MuJoCo("implicitfast", [Setting(5e-4)])]
    pin, mujoco = measure(PROBLEMS["four_bar"], schemes, rounds=1)
    assert pin.error < 2e-7
    assert mujoco.error < 1e-2


def test_every_problem_has_its_schemes():
    for problem in PROBLEMS.values():
        names = [scheme.name for scheme in own_schemes(problem)]
        assert len(set(names)) == len(names) == 12
        assert list(problem.steps) == sorted(problem.steps, reverse=True)


def test_command(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(study, "own_schemes", two_schemes)
    monkeypatch.setitem(PROBLEMS, "pendulum", short("pendulum"))
    card, pictures = tmp_path / "card.json", tmp_path / "new" / "pictures"
    assert cli.main(["accuracy", "pendulum", "--json", str(card), "--plot", str(pictures)]) == 0
    assert "Simple pendulum" in capsys.readouterr().out
    data = json.loads(card.read_text())
    own = data["problems"]["pendulum"]
    assert [each["scheme"] for each in own["points"]] == ["rk4", "rk4", "generalized, rk4"]
    assert own["front"][-1]["error"] < 1e-4
    assert (pictures / "pendulum.png").read_bytes().startswith(b"\x89PNG")
    assert cli.main(["accuracy", "pendulum", "--compare", str(card)]) == 0
    assert f"Time over that of {data['version']}" in capsys.readouterr().out


def test_command_refuses_what_it_does_not_know(tmp_path, capsys):
    assert cli.main(["accuracy", "nonsense"]) == 2
    assert "problem 'nonsense' is unknown; known are pendulum" in capsys.readouterr().err
    other = tmp_path / "other.json"
    other.write_text("[1]")
    assert cli.main(["accuracy", "pendulum", "--compare", str(other)]) == 2
    assert "not a card of this study" in capsys.readouterr().err
    assert cli.main(["accuracy", "pendulum", "--compare", str(Path("nowhere.json"))]) == 2
    with pytest.raises(PhysicsPriorError):
        problems.chosen(["x"])
