"""A person's segments: masses, places and inertias of both tables, mirrored sides, measured lengths; one sentence a fault."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from physics_prior.errors import ModelError
from physics_prior.inertia import combine
from physics_prior.model import JointKind, Tree
from physics_prior.model.human import LENGTHS, LIMBS, SIDES, TABLES, Human

CASES = [(table, sex) for table in TABLES for sex in ("female", "male")]


def standing(tree: Tree) -> dict[str, np.ndarray]:
    """Origin of each part in the pelvis, all joints at zero, where all frames are parallel."""
    origins = {"world": np.zeros(3)}
    for joint in tree.joints:
        origins[joint.child] = origins[joint.parent] + joint.position
    return origins


def whole(tree: Tree):
    origins = standing(tree)
    return combine(part.mass_properties.transformed(np.eye(3), origins[part.name]) for part in tree.parts)


@pytest.mark.parametrize(("table", "sex"), CASES)
def test_masses_sum_to_the_body_s(table, sex):
    tree = Human(61.3, 1.68, sex, table).tree()
    assert tree.mass == pytest.approx(61.3, rel=1e-14)  # measured: 2e-16
    assert sum(part.mass_properties.mass > 0.0 for part in tree.parts) == 16
    assert tree.nv == 43


@pytest.mark.parametrize(("table", "sex"), CASES)
def test_segments_stack_up_to_stature_and_balance_as_people_do(table, sex):
    """Soles to vertex is stature; the centre of mass is at 55 to 58 % of it (reaction boards: Virmavirta and Isolehto 2014)."""
    human = Human(70.0, 1.75, sex, table)
    tree, origins = human.tree(), standing(human.tree())
    sole = origins["left_sole"][2]
    stature = origins["head"][2] + human.length("head") - sole
    assert stature / 1.75 == pytest.approx(1.0, abs=0.025)  # measured: 0.9992 to 1.0207
    share = (whole(tree).center_of_mass[2] - sole) / 1.75
    assert 0.55 < share < 0.58  # measured: 0.5539 to 0.5755


@pytest.mark.parametrize(("table", "sex"), CASES)
def test_both_sides_mirror_each_other(table, sex):
    tree = Human(70.0, 1.75, sex, table).tree()
    mirror = np.diag([1.0, -1.0, 1.0])
    for name in LIMBS:
        left, right = (tree.part(f"{side}_{name}").mass_properties for side in SIDES)
        assert left.center_of_mass == pytest.approx(mirror @ right.center_of_mass, abs=0.0)
        assert left.inertia == pytest.approx(mirror @ right.inertia @ mirror, abs=0.0)
    for name, ends in (("left_knee", (-5.0, 150.0)), ("right_radioulnar", (-90.0, 85.0))):
        assert np.degrees(tree.joint(name).range) == pytest.approx(ends)


def test_de_leva_s_male_thigh_and_dumas_s_female_one():
    """By hand from the tables: 14.16 % of 100.00 %, 40.95 % of 422.2 mm, 32.9 %; 14.6 % of 99.9 %, ISB axes turned."""
    thigh = Human(73.0, 1.741, "male").tree().part("right_thigh").mass_properties
    assert thigh.mass == pytest.approx(0.1416 * 73.0, rel=1e-12)
    assert thigh.center_of_mass == pytest.approx([0.0, 0.0, -0.4095 * 0.4222])
    moments = np.square(0.4222 * np.array([0.329, 0.329, 0.149]))
    assert thigh.inertia == pytest.approx(np.diag(0.1416 * 73.0 * moments))
    thigh = Human(60.0, 1.61, "female", "dumas").tree().part("right_thigh").mass_properties
    m, L = 0.146 / 0.999 * 60.0, 0.379
    assert thigh.mass == pytest.approx(m)
    assert thigh.center_of_mass == pytest.approx([-0.077 * L, -0.009 * L, -0.377 * L])
    # ISB x, y, z are x, z and -y: the product x y is x z here, x z is -x y, y z is -y z
    by_hand = np.array([[0.31**2, 0.02**2, 0.07**2], [0.02**2, 0.32**2, 0.07**2], [0.07**2, 0.07**2, 0.19**2]])
    assert thigh.inertia == pytest.approx(m * L**2 * by_hand)


def test_measured_lengths_count_for_both_sides_or_one():
    human = Human(70.0, 1.75, "male", lengths={"thigh": 0.40, "left_shank": 0.43, "ankle_height": 0.08})
    tree, plain = human.tree(), Human(70.0, 1.75, "male").tree()
    for side in SIDES:
        assert tree.joint(f"{side}_knee").position == pytest.approx([0.0, 0.0, -0.40])
    assert tree.joint("left_ankle").position[2] == -0.43
    assert tree.joint("right_ankle").position == pytest.approx(plain.joint("right_ankle").position)
    assert tree.joint("left_sole").position[2] == -0.08
    ratio = (
        tree.part("left_thigh").mass_properties.inertia[0, 0] / plain.part("left_thigh").mass_properties.inertia[0, 0]
    )
    assert ratio == pytest.approx((0.40 / human.length("thigh") * human.length("thigh") / (422.2 / 1741 * 1.75)) ** 2)


def test_rigid_joints_do_not_move():
    tree = Human(70.0, 1.75, "male", rigid=("lumbar", "thoracic")).tree()
    assert tree.nv == 37
    assert {tree.joint(name).kind for name in ("lumbar", "thoracic")} == {JointKind.FIXED}
    assert len([link for link in tree.links if link.mass_properties.mass > 0.0]) == 14


@given(
    mass=st.floats(1.0, 500.0),
    height=st.floats(0.4, 2.8),
    case=st.sampled_from(CASES),
    lengths=st.dictionaries(st.sampled_from(LENGTHS), st.floats(0.01, 3.0)),
)
def test_any_person_has_inertias_of_bodies(mass, height, case, lengths):
    """MassProperties refuses moments that no body has; the whole is right to rounding."""
    tree = Human(mass, height, case[1], case[0], lengths).tree()
    assert tree.mass == pytest.approx(mass, rel=1e-13)
    assert math.isfinite(float(np.sum(whole(tree).inertia)))


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"mass": 0.0}, ["mass 0.0", "1 to 500 kg"]),
        ({"height": float("nan")}, ["height nan", "0.4 to 2.8 m"]),
        ({"table": "zatsiorsky"}, ["'zatsiorsky'", "de_leva", "dumas"]),
        ({"lengths": {"thgh": 0.4}}, ["'thgh'", "thigh", "left_thigh"]),
        ({"lengths": {"thigh": 40.0}}, ["'thigh' 40.0", "0.01 to 3 m"]),
        ({"rigid": ("waist",)}, ["'waist'", "lumbar"]),
    ],
)
def test_faults_are_refused_by_name(fields, words):
    with pytest.raises(ModelError) as caught:
        Human(**{"mass": 70.0, "height": 1.75, "sex": "male", **fields}).tree()
    assert all(word in str(caught.value) for word in words)
