"""The likelihood of recordings, and what it says of effects that are there and of those that are not."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, t

from physics_prior.errors import RecordingError
from physics_prior.resources import share_directory
from physics_prior.studies.effects.ablation import ablate
from physics_prior.studies.effects.drawing import draw
from physics_prior.studies.effects.fit import fit
from physics_prior.studies.effects.likelihood import likelihood, read_measurements, simulated_measurements
from physics_prior.studies.effects.variant import SceneText

PATH = "effects.joint_damping.coefficients.pivot"
DAMPING_THERE = 0.3  # N m s/rad, of the damped rod
DAMPING = {"joint_damping": {"coefficients": {"pivot": "0.1 N m s/rad"}}}


def test_the_true_scene_is_the_likeliest(damped_rod, damped_measurements):
    found = [
        likelihood(damped_rod.changed({PATH: s * DAMPING_THERE}).build(), [damped_measurements])
        for s in (0.5, 1.0, 2.0)
    ]
    assert found[1].log > max(found[0].log, found[2].log)
    assert found[1].nis == pytest.approx(1.0, abs=0.1)  # 0.936 over 1200 rows, whose own deviation is 0.041
    assert found[1].rows == pytest.approx(6 * len(damped_measurements), rel=0.02)


def test_a_measurement_that_is_refused_costs_as_much_wherever_it_is(free_rod, free_measurements):
    scene = free_rod.build()
    totals = []
    for away in (1.0, 100.0):
        index = len(free_measurements) // 2
        outlier = replace(free_measurements[index], position=free_measurements[index].position + away)
        totals.append(likelihood(scene, [[*free_measurements[:index], outlier, *free_measurements[index + 1 :]]]))
    assert [each.refused for each in totals] == [1 + likelihood(scene, [free_measurements]).refused] * 2
    assert totals[0].log == totals[1].log


def test_no_likelihood_of_what_never_starts(free_rod, free_measurements):
    assert likelihood(free_rod.build(), [free_measurements[:1]]) is None


def test_what_is_there_is_kept(damped_rod, damped_measurements):
    gravity, damping = ablate(damped_rod, [damped_measurements]).verdicts
    assert gravity.keep
    assert damping.keep
    assert damping.delta_log_likelihood > 100.0 * damping.threshold  # 491 of 3.5
    assert damping.forecast_with < damping.forecast_without


def test_what_was_missing_is_found_and_what_is_not_there_is_not(
    free_rod, free_measurements, damped_measurements, tmp_path
):
    missing = ablate(free_rod, [damped_measurements], [DAMPING]).verdicts[-1]
    absent = ablate(free_rod, [free_measurements], [DAMPING]).verdicts[-1]
    assert missing.keep
    assert missing.proposed
    assert missing.fitted[PATH] == pytest.approx(0.3, rel=0.05)  # 0.308
    assert not absent.keep  # 2.2 of 3.5
    assert "drop, no evidence" in absent.evidence
    draw([missing, absent], [], tmp_path / "picture.png")
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")


def errors_of_fits(scene, seeds):
    """Errors of the fitted damping in standard deviations."""
    out = []
    for seed in seeds:
        measurements = simulated_measurements(scene.build(), seed=seed, duration=2.0)
        (found,) = fit(scene.changed({PATH: 0.7 * DAMPING_THERE}), [PATH], [measurements]).parameters()
        out.append((found.value - DAMPING_THERE) / ((found.high - found.low) / (2.0 * 1.96)))
    return np.array(out)


def test_a_fit_finds_the_truth(damped_rod):
    assert np.abs(errors_of_fits(damped_rod, [0])).max() < 1.96  # 0.59


@pytest.mark.slow
def test_intervals_of_fits_are_as_wide_as_errors_are_large(damped_rod):
    errors = errors_of_fits(damped_rod, range(16))
    low, high = chi2.interval(0.95, 16)
    assert low <= errors @ errors <= high  # 19.0 in [6.9, 28.8]


def test_what_a_recording_cannot_tell_has_no_narrow_interval(damped_rod, damped_measurements):
    found = fit(damped_rod, [PATH, "model.parts.rod.mass"], [damped_measurements])  # only their ratio moves the rod
    # damping 0.04 to 2.4, mass 0.13 to 7.6
    assert all(not each.high / each.low < 1.5 for each in found.parameters())


def test_a_start_far_off_is_found_by_widening_the_noise(free_rod, free_measurements):
    path = "effects.gravity.acceleration.2"
    text = free_rod.without("gravity").added({"gravity": {"acceleration": [0, 0, -6.0]}})
    found = fit(text, [path], [free_measurements])
    (gravity,) = found.parameters()
    assert gravity.low < -9.81 < gravity.high  # -9.92 to -9.73
    assert np.isfinite(found.found.log)


def test_a_bag_that_holds_nothing_usable_is_refused(free_rod):
    with pytest.raises(RecordingError, match="/rod/pose"):
        read_measurements(share_directory() / "bags" / "double_pendulum", free_rod.build())


FRICTION_NEEDS = {"gravity", "table", "table.friction"}


def test_a_cube_that_slides_calls_for_contact_and_friction(sliding_cube):
    measurements = simulated_measurements(sliding_cube.build(), seed=3, duration=0.3)
    verdicts = ablate(sliding_cube, [measurements], held=["effects.table.restitution"]).verdicts
    assert {each.name for each in verdicts if each.keep} == FRICTION_NEEDS  # nothing bounces


@pytest.mark.slow
def test_lengths_of_real_tosses_are_two_percent_short(shared):
    """As 570 tosses say, by rest heights and free fall (0.978): so do six before they touch, by free fall alone."""
    path, in_flight = "measurements.0.pose.scale", 18
    text = SceneText.read("thrown_cube_smoothed").changed({path: 1.0})
    bags = [shared / "bags" / f"cube_toss_{toss}" for toss in (120, 128, 172, 410, 438, 550)]
    missing = [str(bag) for bag in bags if not bag.exists()]
    if missing:
        pytest.skip(f"missing {', '.join(missing)}")
    recordings = [read_measurements(bag, text.build())[:in_flight] for bag in bags]
    pooled = fit(text, [path], recordings)
    (scale,) = pooled.parameters()
    assert 1.0 / scale.value == pytest.approx(0.978, rel=0.005)  # 0.9806
    assert 1.0 / scale.high == pytest.approx(0.978, abs=0.002)  # 0.9780 to 0.9833
    assert pooled.found.nis == pytest.approx(1.0, abs=0.15)  # 0.967 over 612 rows, whose own deviation is 0.06
    alone = np.array([fit(text, [path], [recording]).numbers[path] for recording in recordings])
    half = t.ppf(0.975, len(alone) - 1) * alone.std(ddof=1) / math.sqrt(len(alone))
    assert alone.mean() - half < 1.0 / 0.978 < alone.mean() + half  # 1.0146 to 1.0250
    assert half < 0.006


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["", "_noisy"])
def test_real_tosses_call_for_contact_and_friction(shared, ending):
    text = SceneText.read("cube_toss")
    bags = [shared / "bags" / f"cube_toss_{toss}{ending}" for toss in (172, 410)]
    missing = [str(bag) for bag in bags if not bag.exists()]
    if missing:
        pytest.skip(f"missing {', '.join(missing)}")
    recordings = [read_measurements(bag, text.build()) for bag in bags]
    verdicts = {each.name: each for each in ablate(text, recordings).verdicts}
    assert all(verdicts[name].keep for name in FRICTION_NEEDS)
    assert verdicts["table"].delta_log_likelihood > 300.0  # 896, noisy 747
    assert verdicts["table.friction"].delta_log_likelihood > 200.0  # 616, noisy 405
