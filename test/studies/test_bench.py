"""The benchmark's machinery: its figures, its refusals, the tree it runs on. Nothing here asks how fast anything is."""

import json
from importlib.util import find_spec

import numpy as np
import pytest

from physics_prior import cli
from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import PhysicsPriorError, SimulationError
from physics_prior.estimation.estimator import Estimator
from physics_prior.studies import bench, bench_estimator, bench_person
from physics_prior.studies.bench_models import HELD_FEET, humanlike, mjcf
from physics_prior.studies.simulated_walk import Walk, moments

NAMES = {
    "forward_dynamics_vs_pin",
    "held_step_vs_mujoco",
    "held_forward_dynamics_vs_pin",
    "derivatives_vs_pin",
}


@pytest.fixture
def short(monkeypatch):
    """Two rounds of two calls, half a second of an estimator."""
    monkeypatch.setattr(bench, "ROUNDS", 2)
    monkeypatch.setattr(bench, "CALLS", 2)
    monkeypatch.setattr(bench_estimator, "SECONDS", 0.5)
    monkeypatch.setattr(bench_estimator, "PENDULUM_SECONDS", 0.5)
    monkeypatch.setattr(bench_estimator, "LAPS", 1)
    monkeypatch.setattr(bench_person, "SECONDS", 0.3)
    monkeypatch.setattr(bench_person, "LAPS", 1)


def test_tree_has_16_bodies_and_35_degrees_of_freedom():
    tree = humanlike()
    assert (len(tree.links), tree.nv) == (16, 35)
    assert 60.0 < tree.mass < 90.0


def test_figures_of_ours_alone(short):
    told = []
    figures = bench.run_bench(False, told.append)
    us = figures["us"]
    assert figures["ratios"] == {}
    assert {own for own, _ in bench.RATIOS.values()} < set(us)
    assert all(value > 0.0 for value in us.values())
    assert {f"estimator_poses_{name}" for name in bench_estimator.SPLIT} < set(us)
    assert figures["real_time"] == {"person_at_100_hz": pytest.approx(1e4 / us["person"])}
    assert us["person_worst"] >= us["person"] > max(us["person_filter"], us["person_outputs"])
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_command_writes_figures_and_a_table(short, tmp_path, capsys):
    path = tmp_path / "bench.json"
    assert cli.main(["bench", "--json", str(path)]) == 0
    figures = json.loads(path.read_text())
    assert set(figures) == {"ratios", "us", "real_time", "machine"}
    out = capsys.readouterr().out
    assert "forward dynamics" in out
    assert "48 markers" in out
    assert "45 markers at 100 Hz" in out


def test_the_person_who_is_timed_walks_and_is_followed():
    """Every frame is believed, and both feet lift and land."""
    scene = bench_person.walking(1.4)
    walk = Walk(scene, scene.simulator())
    estimator, stood = Estimator(scene), set()
    for _, instant, measured in moments(scene, walk, 0, 1.4):
        for each in measured:
            estimator.add(each)
        if estimator.ready:
            state = estimator.history.nodes[-1].posterior.state
            stood.add(tuple(state.grounded.tolist()))
            assert np.linalg.norm(state.q[:3] - instant.q[:3]) < 0.01  # m: 2 mm
    assert estimator.counts.gated == 0
    assert stood == {(True, True), (True, False), (False, True)}


def test_peers_agree_and_give_ratios(short):
    pytest.importorskip("pinocchio", reason="Pinocchio (extra 'bench') is not installed")
    pytest.importorskip("mujoco", reason="MuJoCo (extra 'bench') is not installed")
    figures = bench.run_bench(True)
    assert set(figures["ratios"]) == NAMES | (set(bench.ESTIMATOR_RATIOS) if find_spec("biorbd") else set())
    for name, (own, peer) in bench.RATIOS.items():
        assert figures["ratios"][name] == figures["us"][peer] / figures["us"][own]


def test_peers_that_are_missing_are_named(monkeypatch, capsys):
    monkeypatch.setattr(bench, "find_spec", lambda name: None)
    assert cli.main(["bench", "--peers"]) == 2
    assert "needs pinocchio and mujoco" in (message := capsys.readouterr().err)
    assert "pip install 'physics_prior[bench]'" in message
    with pytest.raises(PhysicsPriorError):
        bench.run_bench(True)


def test_peer_that_differs_is_refused():
    with pytest.raises(SimulationError, match=r"pin\.aba differs from ours by 1\.0e-06"):
        bench._require("pin.aba", np.array([1.0, 2.0]), np.array([1.0, 2.0 + 2e-6]))


def test_mujoco_is_held_where_we_are():
    """A held step of each from one posture: MuJoCo's constraints are springs, so 1 ms apart by little."""
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo (extra 'bench') is not installed")
    ours = bench.Ours()
    theirs = bench.Peers(ours)
    theirs.restart()
    q, v = ours.postures[0].q.copy(), ours.postures[0].v.copy()
    for _ in range(10):
        ours.held.advance(q, v, bench.STEP_SIZE)
        mujoco.mj_step(theirs._held, theirs._data)
    assert np.max(np.abs(ours.tree.difference(theirs._data.qpos, q))) < 1e-3  # measured 2e-5
    free = Simulator(ours.tree)
    for foot, point in zip(HELD_FEET, ours.points, strict=True):
        free.move(theirs._data.qpos, theirs._data.qvel)
        position, R = free.pose(foot.part)
        assert np.max(np.abs(position + R @ foot.point - point)) < 1e-3


def test_mjcf_is_read_as_the_same_tree():
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo (extra 'bench') is not installed")
    tree = humanlike()
    model = mujoco.MjModel.from_xml_string(mjcf(tree, np.array([0.0, 0.0, -9.81]), 1e-3, HELD_FEET))
    assert (model.nq, model.nv, model.neq) == (tree.nq, tree.nv, 2)
    assert np.sum(model.body_mass) == pytest.approx(tree.mass, rel=1e-12)
