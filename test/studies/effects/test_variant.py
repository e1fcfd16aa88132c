"""Variants of scenes as plain data: numbers found and scaled, effects added and left out."""

import pytest

from physics_prior.errors import SceneError
from physics_prior.studies.effects.variant import SceneText, kind_of, label_of

PATH = "effects.joint_damping.coefficients.pivot"


def test_a_scene_survives_the_way_through_plain_data():
    for name in ("pendulum", "uw_double_pendulum", "four_bar", "cube_toss"):
        text = SceneText.read(name)
        assert text.build().effects == text.changed({}).build().effects


def test_numbers_keep_their_units(damped_rod):
    changed = damped_rod.changed({PATH: 0.6})
    assert changed.number(PATH) == 0.6
    assert changed.data["effects"][1]["joint_damping"]["coefficients"]["pivot"] == "0.6 N m s/rad"
    assert damped_rod.number(PATH) == 0.3  # the original stays


def test_paths_call_an_effect_by_place_kind_or_name(damped_rod):
    assert damped_rod.number("effects.1.coefficients.pivot") == damped_rod.number(PATH)
    assert damped_rod.proper("effects.1.coefficients.pivot") == damped_rod.proper(PATH) == PATH
    assert damped_rod.proper("model.parts.rod.mass") == "model.parts.rod.mass"
    assert label_of({"drag": {"name": "air", "part": "rod"}}) == "air"
    assert kind_of({"drag": {"name": "air"}}) == "drag"
    assert label_of("gravity") == kind_of("gravity") == "gravity"


def test_leaving_out_and_adding(damped_rod, free_rod):
    assert [effect.kind for effect in damped_rod.without("joint_damping").build().effects] == ["gravity"]
    assert damped_rod.without("joint_damping").entries == free_rod.entries


def test_noises_widen_together(damped_rod):
    before, after = damped_rod.build(), damped_rod.noisier(4.0).build()
    assert after.measurements[0].position_noise == pytest.approx(4.0 * before.measurements[0].position_noise)
    assert after.noise.force == pytest.approx(4.0 * before.noise.force)


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("effects.drag.linear", r"at 'drag', known are \['0', '1', 'gravity', 'joint_damping'\]"),
        ("model.parts.rod.colour", "at 'colour', known are"),
        ("model.parts.rod.joint.axis", "'y' is no number and cannot be fitted"),
    ],
)
def test_a_path_that_leads_to_no_number_is_refused(damped_rod, path, said):
    with pytest.raises(SceneError, match=said):
        damped_rod.number(path)
