"""When feet met the ground: found in what is smoothed, and the recording rolled again with it."""

import numpy as np
import pytest

from physics_prior.errors import SimulationError
from physics_prior.estimation import landings
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.landings import Landing, stopped, timed
from physics_prior.estimation.smoother import smooth
from physics_prior.scene import load_scene
from physics_prior.studies.simulated_walk import Walk, moments

MS = 1_000_000


def fall(met: float, stop: float, blur: float) -> tuple[np.ndarray, np.ndarray]:
    """Stamps, ns, and speeds of a fall by 4 m/s^2 that is stopped at a time by so many m/s^2 for 15 ms, blurred by so many ms."""
    fine = np.arange(-200.0, 200.0, 0.1)
    acceleration = np.where((fine >= met) & (fine < met + 15.0), stop, -4.0 * (fine < met))
    kernel = np.exp(-0.5 * (np.arange(-60.0, 60.05, 0.1) / blur) ** 2)
    seen = np.convolve(np.cumsum(acceleration) * 1e-4, kernel / kernel.sum(), mode="same")
    at = np.arange(-60.0, 80.0, 5.0)
    return (at * MS).astype(np.int64), np.interp(at, fine, seen)


@pytest.mark.parametrize("met", [-20.0, 1.3, 24.0])
@pytest.mark.parametrize("blur", [2.0, 5.0])
def test_a_fall_is_stopped_where_the_slope_is_half_as_high_as_it_gets(met, blur):
    found = stopped(*fall(met, 30.0, blur))
    assert found is not None
    assert abs(found / MS - met) < 1.0  # 0.7, and the stamps are 5 ms apart


def test_who_steps_softly_tells_no_landing():
    assert stopped(*fall(0.0, 9.0, 5.0)) is None
    assert stopped(np.zeros(1, dtype=np.int64), np.zeros(1)) is None
    stamps, rates = fall(-70.0, 30.0, 5.0)
    assert stopped(stamps, rates) is None  # it began before


@pytest.fixture(scope="module")
def walked():
    """An estimator's filter, and the nodes of a made-up walk of 0.8 s, in which the right foot comes to stand."""
    scene = load_scene("simulated_walk")
    estimator, nodes = Estimator(scene), []
    estimator.on_settled = nodes.append
    for _, _, measurements in moments(scene, Walk(scene, scene.simulator()), 0, 0.8):
        for each in measurements:
            estimator.add(each)
    estimator.reset()
    return estimator.filter, nodes


def test_the_made_up_walk_steps_softly(walked):
    filter, nodes = walked
    smoothed = smooth(filter, nodes, 1.0)
    stands = np.array([each.state.grounded for each in smoothed])
    assert (stands[1:] & ~stands[:-1]).any()
    assert timed(filter, nodes, smoothed) is nodes


@pytest.mark.parametrize("later", [-2, 3])
def test_a_recording_is_rolled_again_with_its_landings(walked, monkeypatch, later):
    filter, nodes = walked
    stamps = [node.measurement.stamp for node in nodes]
    stands = np.array([node.posterior.state.grounded[1] for node in nodes])
    decided = int(np.flatnonzero(stands[1:] & ~stands[:-1])[0]) + 1
    met = decided + later
    monkeypatch.setattr(landings, "landings", lambda *_: [Landing(1, stamps[decided], stamps[met])])
    again = timed(filter, nodes, [])
    first = min(decided, met)
    assert all(one is other for one, other in zip(again[:first], nodes, strict=False))
    assert [node.measurement for node in again] == [node.measurement for node in nodes]
    assert [bool(node.posterior.state.grounded[1]) for node in again[first - 1 : met + 5]] == [
        index >= met for index in range(first - 1, met + 5)
    ]
    assert not filter.process.told
    loads = [node.posterior.state.force[filter.process.unknown.feet[1].span][2] for node in again]
    assert loads[met - 1] == 0.0
    assert loads[met + 2] > 0.0


def test_landings_that_cannot_be_followed_stay_as_decided(walked, monkeypatch):
    filter, nodes = walked
    stamp = nodes[-2].measurement.stamp
    monkeypatch.setattr(landings, "landings", lambda *_: [Landing(1, stamp, stamp + 1)])
    monkeypatch.setattr(filter, "update", lambda *_: (_ for _ in ()).throw(SimulationError("too fast")))
    assert timed(filter, nodes, []) is nodes
    assert not filter.process.told
