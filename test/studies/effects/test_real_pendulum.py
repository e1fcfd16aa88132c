"""What the recordings of a real double pendulum say of a drag that its authors did not model."""

import pytest

from physics_prior.studies.effects.ablation import ablate
from physics_prior.studies.effects.likelihood import read_measurements
from physics_prior.studies.effects.variant import SceneText

DRAG = {"drag": {"part": "link2", "point": [0, 0, 0.117], "linear": "1e-4 N s/m"}}


def verdicts(shared, name):
    bag = shared / "bags" / name
    if not bag.exists():
        pytest.skip(f"missing {bag}")
    text = SceneText.read("uw_double_pendulum")
    return {each.name: each for each in ablate(text, [read_measurements(bag, text.build())], [DRAG]).verdicts}


@pytest.mark.slow
def test_a_slow_swing_calls_for_gravity_and_damping_and_for_no_drag(shared):
    found = verdicts(shared, "uw_double_pendulum_b_noisy")
    assert found["gravity"].delta_log_likelihood > 1000.0  # 6625
    assert found["joint_damping"].keep  # 17.9 of 9.5
    assert not found["drag"].keep  # 4.5 of 4.7


@pytest.mark.slow
def test_a_wide_swing_calls_for_the_drag_that_its_encoders_show(shared):
    """The clean encoders alone, by least squares of short stretches, say 5.0e-3 N s/m, without which twice the error is left."""
    found = verdicts(shared, "uw_double_pendulum_a_noisy")
    assert found["gravity"].delta_log_likelihood > 1000.0
    assert found["joint_damping"].keep
    assert found["drag"].keep
    assert found["drag"].fitted["effects.drag.linear"] == pytest.approx(5.0e-3, rel=0.3)
    assert found["drag"].nis_with == pytest.approx(1.0, abs=0.05)  # so the likelihood is not too sure of itself
