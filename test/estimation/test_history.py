"""The ordered history: what is known in the end does not depend on the order of arrival."""

import numpy as np
import pytest

from physics_prior.estimation.history import History
from physics_prior.estimation.start import start

SECOND = 10**9


@pytest.fixture
def begun(shipped, filter_of, moments_of):
    """A history that has just begun, and the moments after its start."""
    scene = shipped("double_pendulum")
    filter = filter_of(scene)
    first, *later = moments_of(scene)
    history = History(filter, SECOND)
    history.begin(reversed(first.measurements), start(filter, first.measurements, first.stamp))
    return history, later


def _factor(history):
    return history.nodes[-1].posterior.factor.tobytes()


def test_the_start_is_in_order(begun, shipped):
    history, later = begun
    assert [node.measurement.topic for node in history.nodes] == ["/upper/pose", "/lower/pose"]
    assert history.from_start
    assert history.begun == later[0].stamp - SECOND // 50


def test_it_holds_and_reaches(begun):
    history, later = begun
    first = history.nodes[0].measurement
    assert history.holds(first)
    assert not history.reaches(first)
    assert not history.holds(later[0].measurements[0])
    assert history.reaches(later[0].measurements[0])


def test_any_order_gives_the_same_bits(begun):
    history, later = begun
    measurements = [each for moment in later[:20] for each in moment.measurements]
    for measurement in measurements:
        history.insert(measurement)
    expected, stamps = _factor(history), [node.measurement.stamp for node in history.nodes]
    assert stamps == sorted(stamps)
    rng = np.random.default_rng(0)
    for _ in range(3):
        again = History(history.filter, SECOND)
        again.begin([node.measurement for node in history.nodes[:2]], history.nodes[0].posterior)
        for index in rng.permutation(len(measurements)):
            again.insert(measurements[index])
        assert _factor(again) == expected
        for own, other in zip(history.nodes, again.nodes, strict=True):
            assert own.posterior.state.q.tobytes() == other.posterior.state.q.tobytes()
            assert own.posterior.nis == other.posterior.nis


def test_trimming_keeps_one_to_roll_from(begun):
    history, later = begun
    history.length = SECOND // 10
    dropped = []
    for moment in later[:20]:
        for measurement in moment.measurements:
            history.insert(measurement)
            dropped += history.trim()
    assert not history.from_start
    newest = history.nodes[-1].measurement.stamp
    assert history.nodes[0].measurement.stamp < newest - history.length <= history.nodes[1].measurement.stamp
    stamps = [node.measurement.stamp for node in [*dropped, *history.nodes]]
    assert len(stamps) == 42
    assert stamps == sorted(stamps)


def test_after_a_gap_the_older_of_two_late_ones_still_finds_its_place(begun):
    history, later = begun
    history.length = SECOND // 10
    upper, lower = later[-1].measurements
    history.insert(lower)
    history.trim()
    assert history.reaches(upper)
    history.insert(upper)
    assert [node.measurement.topic for node in history.nodes[-2:]] == ["/upper/pose", "/lower/pose"]


def test_an_empty_history_trims_to_nothing(shipped, filter_of):
    history = History(filter_of(shipped("double_pendulum")), SECOND)
    assert history.trim() == []
    assert not history
    assert not history.from_start


def test_of_the_factors_of_a_stamp_only_the_last_is_kept_and_late_ones_change_no_bit(
    every_source, filter_of, moments_of
):
    filter = filter_of(every_source)
    first, *later = moments_of(every_source, duration=0.02)
    measurements = [each for moment in later for each in moment.measurements]
    assert len(first.measurements) == 4
    prior = start(filter, first.measurements, first.stamp)

    def rolled(order):
        history = History(filter, SECOND)
        history.begin(first.measurements, prior)
        for index in order:
            history.insert(measurements[index])
        return history

    expected = rolled(range(len(measurements)))
    for history in [
        expected,
        *(rolled(np.random.default_rng(seed).permutation(len(measurements))) for seed in range(4)),
    ]:
        assert _factor(history) == _factor(expected)
        for node, after in zip(history.nodes[4:], [*history.nodes[5:], None], strict=True):
            last = after is None or after.measurement.stamp > node.measurement.stamp
            assert len(node.posterior.factor) == (filter.process.n if last else 0)
