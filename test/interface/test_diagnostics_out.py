"""Diagnostics out: health, its cause, and the numbers that tell why."""

import pytest

from physics_prior.estimation.estimate import Counts, Health, Level
from physics_prior.interface import Output
from physics_prior.recording.messages import DiagnosticStatus


@pytest.fixture
def output(every_joint, every_joint_simulator):
    return Output(every_joint, every_joint_simulator)


def status_of(publications):
    ((topic, message),) = publications
    (status,) = message.status
    assert topic == "/diagnostics"
    return status, {value.key: value.value for value in status.values}


def test_numbers_of_an_estimate(output, every_joint_simulator, estimate_of):
    estimate = estimate_of(every_joint_simulator)
    status, values = status_of(output.diagnostics(5, estimate.health, estimate.counts, estimate, {"lost": 3}))
    assert (status.level, status.message, status.name) == (DiagnosticStatus.OK, "OK", "physics_prior: every_joint")
    assert values == {
        "measurements read": "10",
        "measurements used": "8",
        "measurements gated": "1",
        "measurements late": "2",
        "measurements rejected": "1",
        "active effects": "gravity, strap",
        "constraint rows": "3",
        "constraint rank": "3",
        "constraint error m": "1e-12",
        "nis": "5",
        "nis expected": "6",
        "lost": "3",
    }


def test_a_split_that_is_not_unique_is_said(output, every_joint_simulator, estimate_of):
    estimate = estimate_of(every_joint_simulator, rank=2)
    _, values = status_of(output.diagnostics(5, estimate.health, estimate.counts, estimate))
    assert "not" in values["forces"]


@pytest.mark.parametrize(
    ("level", "expected"),
    [(Level.OK, DiagnosticStatus.OK), (Level.DEGRADED, DiagnosticStatus.WARN), (Level.LOST, DiagnosticStatus.ERROR)],
)
def test_levels_and_causes_before_there_is_an_estimate(output, level, expected):
    status, values = status_of(output.diagnostics(5, Health(level, "a cause"), Counts()))
    assert (status.level, status.message) == (expected, "a cause")
    assert "nis" not in values
    assert values["active effects"] == "gravity, strap"
