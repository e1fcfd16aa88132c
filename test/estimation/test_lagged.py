"""Estimates told by what comes within a lag: causal without one, smoothed with all of it, and better the longer it is."""

from dataclasses import replace

import numpy as np
import pytest

from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.lagged import WHOLE, Lagged
from physics_prior.estimation.smoother import smooth
from physics_prior.recording.cdr import decode
from physics_prior.recording.reader import open_bag
from physics_prior.recording.replay import replay
from physics_prior.recording.simulate import motion, simulate
from physics_prior.scene import load_scene

PERIOD = 1.0 / 30.0


@pytest.fixture(scope="module")
def scene():
    return load_scene("double_pendulum")


@pytest.fixture(scope="module")
def bag(scene, tmp_path_factory):
    path = tmp_path_factory.mktemp("bags") / "bag"
    simulate(scene, path, seed=3, duration=1.0)
    return path


def run(scene, lag, drop=lambda k: False, order=lambda moments: moments):
    """Everything that is given out, and the estimator; measurements come in an order, some not at all."""
    estimator = Estimator(scene, history_length=100.0)
    lagged = Lagged(estimator, lag, PERIOD)
    estimator.on_settled = lagged.settle
    out = []
    moments = [moment for k, moment in enumerate(motion(scene, scene.simulator(), 1, 0.6)) if not drop(k)]
    for moment in order(moments):
        for measurement in moment.measurements:
            estimator.add(measurement)
            out.extend(lagged.due(estimator.stamp))
    nodes = list(estimator.history.nodes)
    estimator.reset()
    out.extend(lagged.rest())
    return out, nodes, estimator


def same(one, other):
    assert [each.stamp for each in one] == [each.stamp for each in other]
    for a, b in zip(one, other, strict=True):
        assert np.array_equal(a.state.q, b.state.q)
        assert np.array_equal(a.state.v, b.state.v)
        assert np.array_equal(a.factor, b.factor)


def test_without_a_lag_it_is_the_filter(scene):
    given, nodes, _ = run(scene, 0)
    last = {node.measurement.stamp: node.posterior for node in nodes}
    same(given, list(last.values())[1:])  # the first tells where the start is


@pytest.mark.parametrize("gap", [(), range(20, 32)])
def test_with_all_of_the_recording_it_is_the_smoother(scene, gap):
    for lag in (WHOLE, 700_000_000):
        given, nodes, estimator = run(scene, lag, lambda k: k in gap)
        same(given, smooth(estimator.filter, nodes, PERIOD))


@pytest.mark.parametrize("lag", [50_000_000, 73_000_000])
def test_in_between_it_is_the_smoother_of_each_window(scene, lag):
    given, nodes, estimator = run(scene, lag)
    stamps = sorted({node.measurement.stamp for node in nodes})
    assert [each.stamp for each in given] == stamps
    for each in given[:: len(given) // 7]:
        window = [node for node in nodes if each.stamp <= node.measurement.stamp <= each.stamp + lag]
        same([each], smooth(estimator.filter, window, PERIOD)[:1])


def test_a_late_measurement_counts_while_its_window_is_open(scene):
    def swapped(moments):
        for k in range(5, len(moments) - 1, 9):
            moments[k], moments[k + 1] = moments[k + 1], moments[k]
        return moments

    late, orderly = run(scene, 50_000_000, order=swapped)[0], run(scene, 50_000_000)[0]
    for k, pair in enumerate(zip(late, orderly, strict=True)):
        if k % 9 or k > 54:  # the others were closed by what came before the last one of their windows
            same(*([each] for each in pair))
        else:
            assert not np.array_equal(*(each.state.q for each in pair))


def test_time_that_jumps_back_begins_anew_and_nothing_is_owed(scene):
    def twice(moments):
        return [*moments, *moments]

    once, again = run(scene, 50_000_000)[0], run(replace(scene), 50_000_000, order=twice)[0]
    for lap in (again[: len(once)], again[len(once) :]):
        same(lap[:-5], once[:-5])
        assert len(lap) == len(once)


@pytest.mark.parametrize("lag", [0.0, 0.05, 10.0])
def test_a_replay_says_the_same(scene, bag, lag):
    result = replay(bag, scene, lag=lag, references=["/truth/joint_states"])
    whole = replay(bag, scene, smooth=lag == 10.0, references=["/truth/joint_states"])
    if lag == 0.05:
        assert result.kind == "smoothed by 50 ms more"
        assert result.score["position_rmse_deg"] < 0.95 * whole.score["position_rmse_deg"]  # 0.80
        assert result.summary()["lag_s"] == 0.05
        return
    assert result.score == whole.score
    for name, values in result.readouts.items():
        np.testing.assert_array_equal(values, whole.readouts[name])
        np.testing.assert_array_equal(result.deviations[name], whole.deviations[name])


def test_a_lagged_bag_tells_its_lag_and_comes_as_much_later(scene, bag, tmp_path):
    replay(bag, scene, tmp_path / "out", lag=0.1)
    reader = open_bag(tmp_path / "out")
    (status,) = decode(*next(iter(reader.read(["/diagnostics"])))[2:]).status
    assert {value.key: value.value for value in status.values}["lag s"] == "0.1"
    for record in reader.read(["/joint_states"]):
        stamp = decode(record.message_type, record.data).header.stamp
        assert record.log_time_ns - (stamp.sec * 10**9 + stamp.nanosec) == 100_000_000


@pytest.mark.parametrize("lag", ["-1", "nan", "inf", "x"])
def test_what_is_no_lag_is_refused(bag, lag, capsys):
    from physics_prior import cli

    with pytest.raises(SystemExit) as leave:
        cli.main(["replay", str(bag), "--scene", "double_pendulum", "--lag", lag])
    assert leave.value.code == 2
    assert f"{lag} is not a lag: give 0 to 3600 s, or --smooth" in capsys.readouterr().err
