"""Markers out: shapes where the parts are, arrows of forces where they act, ellipsoids that hold the uncertainty."""

import numpy as np
import pytest

from physics_prior import rotations
from physics_prior.interface import Output
from physics_prior.interface.geometry import array_of, wxyz_of
from physics_prior.recording.messages import Marker


@pytest.fixture
def draw(every_joint, every_joint_simulator):
    output = Output(every_joint, every_joint_simulator)

    def drawn(estimate):
        ((topic, message),) = output.markers(estimate)
        assert topic == "estimated_markers"  # the scene measures /markers
        return {(marker.ns, marker.id): marker for marker in message.markers}

    return drawn


def test_ids_are_unique_and_stay(draw, every_joint_simulator, estimate_of):
    first, second = (draw(estimate_of(every_joint_simulator, seed)) for seed in (0, 1))
    assert list(first) == list(second)
    assert [marker.type for marker in first.values()] == [marker.type for marker in second.values()]
    assert {marker.header.frame_id for marker in first.values()} == {"lab"}


def test_shapes_stand_where_their_parts_are(draw, every_joint_simulator, estimate_of):
    estimate, simulator = estimate_of(every_joint_simulator), every_joint_simulator
    markers = draw(estimate)
    simulator.move(estimate.q, estimate.v)
    expected = {"base": Marker.CUBE, "arm": Marker.CYLINDER, "forearm": Marker.CYLINDER, "slider": Marker.SPHERE}
    for index, part in enumerate(simulator.tree.parts):
        if part.name not in expected:
            assert ("parts", 3 * index) not in markers
            continue
        marker = markers["parts", 3 * index]
        origin, R = simulator.pose(part.name)
        assert marker.type == expected[part.name]
        np.testing.assert_allclose(array_of(marker.pose.position), origin + R @ part.shape.position, atol=1e-14)
        turned = R @ rotations.matrix_from_quaternion(part.shape.orientation)
        np.testing.assert_allclose(
            rotations.matrix_from_quaternion(wxyz_of(marker.pose.orientation)), turned, atol=1e-14
        )
        assert array_of(marker.scale).tolist() == part.shape.size.tolist()


def test_a_capsule_has_round_ends(draw, every_joint_simulator, estimate_of):
    # 0.4 m long without its caps, about (0, 0, 0.2) of the arm: its ends are the joints' places
    estimate, simulator = estimate_of(every_joint_simulator), every_joint_simulator
    markers = draw(estimate)
    simulator.move(estimate.q, estimate.v)
    origin, R = simulator.pose("arm")
    ends = [array_of(markers["parts", 3 * 1 + number].pose.position) for number in (1, 2)]
    np.testing.assert_allclose(ends, [origin + R @ [0, 0, 0.4], origin], atol=1e-14)
    assert markers["parts", 4].scale.x == pytest.approx(0.1)


def test_arrows_begin_where_forces_act_and_show_them_in_weights(draw, every_joint_simulator, estimate_of):
    estimate = estimate_of(every_joint_simulator)
    markers = draw(estimate)
    start, end = map(array_of, markers["forces", 3].points)
    wrench = estimate.wrenches["strap"]
    assert start.tolist() == wrench.point.tolist()
    weight = every_joint_simulator.tree.mass * 9.80665
    np.testing.assert_allclose(end - start, 0.4 * wrench.force / weight, rtol=1e-12)  # 0.4 m: the longest part
    for each in estimate.wrenches.values():
        each.force[:] = 0.0
    assert {marker.action for (ns, _), marker in draw(estimate).items() if ns == "forces"} == {Marker.DELETE}


def test_ellipsoids_hold_95_percent_of_centres_of_mass(draw, every_joint_simulator, estimate_of):
    simulator, rng = every_joint_simulator, np.random.default_rng(3)
    estimate = estimate_of(simulator)
    estimate = estimate_of(simulator, covariance=1e-2 * estimate.covariance)  # small: the ellipsoid is of first order
    markers, nv = draw(estimate), simulator.nv
    errors = rng.multivariate_normal(np.zeros(nv), estimate.covariance[:nv, :nv], size=2000)
    inside = np.zeros(len(simulator.tree.links))
    for error in errors:
        simulator.move(simulator.tree.integrate(estimate.q, error), estimate.v)
        for index, link in enumerate(simulator.tree.links):
            origin, R = simulator.pose(link.part)
            pose, scale = markers["uncertainty", index].pose, array_of(markers["uncertainty", index].scale)
            away = origin + R @ link.mass_properties.center_of_mass - array_of(pose.position)
            along = rotations.rotate(rotations.conjugate(wxyz_of(pose.orientation)), away)
            inside[index] += np.sum((2 * along / scale) ** 2) < 1.0
    np.testing.assert_allclose(inside / len(errors), 0.95, atol=0.02)  # 0.004


def test_what_is_certain_is_not_drawn(draw, every_joint_simulator, estimate_of):
    n = 2 * every_joint_simulator.nv
    markers = draw(estimate_of(every_joint_simulator, covariance=np.zeros((n, n))))
    assert {marker.action for (ns, _), marker in markers.items() if ns == "uncertainty"} == {Marker.DELETE}
