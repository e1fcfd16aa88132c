"""Every hard case, quick here and thorough in the slow suite: the same figures and bounds. Measured: docs/stability.md."""

import pytest

from physics_prior.studies.stability.registry import CASES
from physics_prior.studies.stability.suite import run_case

NAMED = pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.id}-{case.key}")


def failures(outcome):
    """What failed, for the report: all figures that are out of their bounds."""
    return [check for check in outcome.checks if not check.passed] + [outcome.error] * bool(outcome.error)


@NAMED
def test_hard_case(case):
    outcome = run_case(case, thorough=False)
    assert outcome.checks
    assert failures(outcome) == []


@pytest.mark.slow
@NAMED
def test_hard_case_thoroughly(case):
    """All 50 random step sizes, 1e6 steps, all integrators."""
    assert failures(run_case(case, thorough=True)) == []


def test_the_list_is_whole():
    """Numbers 1 to 30, each once; keys that a command line can tell apart."""
    assert [case.id for case in CASES] == list(range(1, len(CASES) + 1))
    assert len(CASES) >= 30
    assert len({case.key for case in CASES}) == len(CASES)
    assert all(case.peers and case.name for case in CASES)
