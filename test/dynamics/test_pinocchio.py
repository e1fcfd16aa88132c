"""Kernels against Pinocchio, an engine that shares no line with ours: the same numbers in its own conventions.

Pinocchio has both velocities of a free joint in the BODY's axes; ours has the linear one in the WORLD's.
"""

import numpy as np
import pytest

from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.attachment import Attachment
from physics_prior.effects.gravity import Gravity
from physics_prior.model import JointKind
from physics_prior.studies.bench_models import HELD_FEET, PinocchioModel, humanlike

pinocchio = pytest.importorskip("pinocchio", reason="Pinocchio (extra 'bench') is not installed")

GRAVITY = Gravity()
FIELD = np.array(GRAVITY.acceleration)
TREES = ["humanlike", *range(8)]


def off(actual, expected):
    """Largest deviation, relative to the largest entry (or one)."""
    return float(np.max(np.abs(actual - expected)) / max(1.0, np.max(np.abs(expected))))


@pytest.fixture(params=TREES)
def case(request, random_tree, random_state):
    rng = np.random.default_rng(17)
    if request.param == "humanlike":
        tree = humanlike()
    else:
        rng = np.random.default_rng(request.param)
        tree = random_tree(rng, size=8, root=JointKind.FREE if request.param % 2 else None)
    q, v = random_state(rng, tree)
    return tree, PinocchioModel(tree, FIELD), q, v, rng.normal(size=tree.nv)


def test_conventions_map_poses_and_velocities(case):
    """Our parts stand and move where Pinocchio's do."""
    tree, peer, q, v, tau = case
    theirs = peer.posture(q, v, tau)
    pinocchio.forwardKinematics(peer.model, peer.data, theirs.q, theirs.v)
    simulator = Simulator(tree)
    simulator.move(q, v)
    for link in tree.links:
        joint = peer.model.getJointId(link.joint.name)
        position, R = simulator.pose(link.part)
        linear, angular = simulator.velocity(link.part)
        place = peer.data.oMi[joint]
        motion = pinocchio.getVelocity(peer.model, peer.data, joint, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        assert off(position, place.translation) < 1e-13  # measured 3e-15
        assert off(R, place.rotation) < 1e-13
        assert off(linear, motion.linear) < 1e-13
        assert off(angular, motion.angular) < 1e-13


def test_conventions_map_tangents(case):
    """Our q [+] d is Pinocchio's integrate, but for the arc along which it moves a free joint that turns."""
    tree, peer, q, _, d = case
    for link in tree.links:
        if link.joint.kind is JointKind.FREE:
            d[link.v.start : link.v.start + 3] = 0.0
    moved = peer.configuration(tree.integrate(q, d))
    theirs = pinocchio.integrate(peer.model, peer.configuration(q), peer.velocity_map(q) @ d)
    for link in tree.links:
        if link.joint.kind in (JointKind.SPHERICAL, JointKind.FREE):
            last = slice(link.q.stop - 4, link.q.stop)
            theirs[last] *= np.sign(theirs[last] @ moved[last])
    assert off(moved, theirs) < 1e-13  # measured 1e-16


def test_forward_dynamics(case):
    tree, peer, q, v, tau = case
    theirs = peer.posture(q, v, tau)
    vdot = Simulator(tree, [GRAVITY]).acceleration(q, v, tau)
    expected = pinocchio.aba(peer.model, peer.data, theirs.q, theirs.v, theirs.tau)
    assert off(peer.acceleration(q, v, vdot), expected) < 1e-10  # measured 8e-15


def test_inverse_dynamics(case):
    tree, peer, q, v, vdot = case
    theirs = peer.posture(q, v, vdot)
    tau = Simulator(tree, [GRAVITY]).inverse_dynamics(q, v, vdot)
    expected = pinocchio.rnea(peer.model, peer.data, theirs.q, theirs.v, peer.acceleration(q, v, vdot))
    assert off(peer.velocity_map(q) @ tau, expected) < 1e-12  # measured 1e-15


def test_mass_matrix(case):
    tree, peer, q, _, _ = case
    turn = peer.velocity_map(q)
    M = pinocchio.crba(peer.model, peer.data, peer.configuration(q))
    expected = np.triu(M) + np.triu(M, 1).T
    assert off(turn @ Simulator(tree).mass_matrix(q) @ turn.T, expected) < 1e-12  # measured 2e-15


def test_derivatives_of_forward_dynamics(case):
    tree, peer, q, v, tau = case
    theirs, simulator = peer.posture(q, v, tau), Simulator(tree, [GRAVITY])
    vdot = simulator.acceleration(q, v, tau)
    derivatives = simulator.acceleration_derivatives(q, v, tau)
    by_q, by_v = peer.acceleration_derivatives(q, v, tau, vdot, *derivatives)
    pinocchio.computeABADerivatives(peer.model, peer.data, theirs.q, theirs.v, theirs.tau)
    assert off(by_q, peer.data.ddq_dq) < 1e-10  # measured 6e-13
    assert off(by_v, peer.data.ddq_dv) < 1e-10


def test_held_forward_dynamics():
    """Both feet held: accelerations, and the forces that hold them."""
    rng = np.random.default_rng(5)
    tree = humanlike()
    peer, free = PinocchioModel(tree, FIELD), Simulator(tree)
    q = tree.integrate(tree.neutral(), rng.normal(scale=0.4, size=tree.nv))
    v, tau = rng.normal(size=tree.nv), rng.normal(size=tree.nv)
    free.move(q, v)
    points = [position + R @ foot.point for foot, (position, R) in ((f, free.pose(f.part)) for f in HELD_FEET)]
    holds = [
        Attachment(name=foot.part, part=foot.part, point=tuple(foot.point), at=tuple(point))
        for foot, point in zip(HELD_FEET, points, strict=True)
    ]
    held = Simulator(tree, [GRAVITY, *holds])
    held.project(q, v)
    contacts, data = peer.hold(HELD_FEET, points)
    settings = pinocchio.ProximalSettings(1e-14, 1e-14, 50)
    theirs = peer.posture(q, v, tau)
    expected = pinocchio.constraintDynamics(
        peer.model, peer.data, theirs.q, theirs.v, theirs.tau, contacts, data, settings
    )
    assert off(peer.acceleration(q, v, held.acceleration(q, v, tau)), expected) < 1e-10  # measured 1e-15
    assert held.rank == 6

    theirs = peer.posture(q, v, 0.0 * tau)
    pinocchio.constraintDynamics(peer.model, peer.data, theirs.q, theirs.v, theirs.tau, contacts, data, settings)
    wrenches = held.wrenches(q, v)
    for foot, contact in zip(HELD_FEET, data, strict=True):
        assert off(wrenches[foot.part].force, contact.contact_force.linear) < 1e-10  # measured 1e-12
