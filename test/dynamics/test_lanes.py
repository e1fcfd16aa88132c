"""What sweeps do with several links side by side: the same numbers, to the last bit, as link by link."""

import math

import numpy as np
import pytest

from physics_prior import inertia
from physics_prior.dynamics import articulated_body, kinematics, manifold
from physics_prior.dynamics.algebra import cross, dot, inverse9, times
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.lanes import add_numbers, elements, numbers, put_elements, put_numbers
from physics_prior.dynamics.records import ALL, LANES, WORK, link_records
from physics_prior.dynamics.rotation_vector import exponential
from physics_prior.dynamics.trigonometry import FARTHEST, sine_and_cosine
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.bench_models import humanlike

RECORD = np.dtype([("index", "i8"), ("m", "f8", 9), ("u", "f8", 3), ("out", "f8", 3)], align=True)


@kernel
def solve_each(records):
    for i in range(records.shape[0]):
        put_numbers(records, "out", i, answer(numbers(records, "m", 9, i), numbers(records, "u", 3, i)))


@kernel
def solve_four(records, where):
    put_numbers(records, "out", where, answer(numbers(records, "m", 9, where), numbers(records, "u", 3, where)))


@kernel
def answer(m, u):
    x = times(inverse9(m), u)
    y = cross(x, u)
    return y[0] / 3.0, -y[1] - 0.5, y[2] * dot(x, u) + 2.0


def test_the_algebra_of_numbers_is_that_of_blocks_to_the_last_bit():
    records = np.zeros(6, dtype=RECORD)
    rng = np.random.default_rng(0)
    records["m"], records["u"] = rng.normal(size=(6, 9)), rng.normal(size=(6, 3))
    solve_each(records)
    expected = records["out"].copy()
    records["out"] = 0.0
    solve_four(records, (5, 0, 3, 3))
    np.testing.assert_array_equal(records["out"][[0, 3, 5]], expected[[0, 3, 5]])
    assert not records["out"][[1, 2, 4]].any()


@kernel
def add_four(records, where, some):
    add_numbers(records, "out", where, some, numbers(records, "u", 3, where))


@pytest.mark.parametrize("some", [1, 3, 4])
def test_what_lanes_add_to_one_record_is_added_one_after_another(some):
    records = np.zeros(3, dtype=RECORD)
    records["u"] = np.arange(9.0).reshape(3, 3)
    add_four(records, (1, 1, 2, 2), some)
    expected = np.zeros((3, 3))
    for i in (1, 1, 2, 2)[:some]:
        expected[i] += records["u"][i]
    np.testing.assert_array_equal(records["out"], expected)


@kernel
def turn_four(angles, where, out):
    x, y, z = elements(angles, 3, where)
    sine, cosine = sine_and_cosine(x)
    a, b, c, d = exponential(x, y, z)
    put_elements(out, where, (sine, cosine, a, b, c, d))


@kernel
def turn_each(angles, out):
    for i in range(angles.shape[0] - 5):
        sine, cosine = sine_and_cosine(angles[i])
        out[i, 0], out[i, 1] = sine, cosine
        out[i, 2], out[i, 3], out[i, 4], out[i, 5] = exponential(angles[i], angles[i + 1], angles[i + 2])


@pytest.mark.parametrize("scale", [0.1, 10.0, 1e4, 10.0 * FARTHEST])
def test_sines_and_quaternions_side_by_side_are_those_one_by_one(scale):
    angles = scale * np.random.default_rng(1).normal(size=60)
    angles[[3, 4, 5, 24, 31]] = 0.0, 0.0, 0.0, 1e-200, 2.0 * FARTHEST
    single, four = np.zeros((55, 6)), np.zeros(60)
    turn_each(angles, single)
    for i in range(0, 12):
        where = (i, i + 13, i + 26, i + 40)
        turn_four(angles, where, four)
        for k in where:
            np.testing.assert_array_equal(four[k : k + 6], single[k])
    # 1.2e-16 was the largest
    np.testing.assert_allclose(single[:, 0], [math.sin(x) for x in angles[:55]], rtol=0.0, atol=2.3e-16)


def test_what_is_not_finite_stays_so():
    angles, out = np.full(60, np.nan), np.zeros(60)
    angles[13] = 1.0
    turn_four(angles, (0, 13, 26, 40), out)
    assert np.isnan(out[:2]).all()
    assert out[13] == math.sin(1.0)


def many_armed() -> Tree:
    """A hub with arms on every kind of joint, six of a kind, some with forearms: fours of links, and what is left of them."""
    rng = np.random.default_rng(2)
    parts, joints = (
        [Part("hub", inertia.box(3.0, (0.2, 0.3, 0.1)))],
        [Joint("hub_joint", JointKind.FREE, "world", "hub", np.zeros(3))],
    )
    for kind in (JointKind.REVOLUTE, JointKind.SPHERICAL, JointKind.PRISMATIC):
        for k in range(6):
            for name, parent in ((f"{kind.name}_{k}", "hub"), (f"{kind.name}_{k}_end", f"{kind.name}_{k}"))[
                : 1 + k % 2
            ]:
                axis, turn = rng.normal(size=(2, 3))
                orientation = rng.normal(size=4) if k == 5 else np.array([1.0, 0.0, 0.0, 0.0])
                joint = Joint(
                    f"{name}_joint",
                    kind,
                    parent,
                    name,
                    0.3 * turn,
                    orientation=orientation / np.linalg.norm(orientation),
                    axis=axis / np.linalg.norm(axis),
                )
                parts.append(Part(name, inertia.capsule(1.0 + k, 0.05, 0.3).transformed(np.eye(3), 0.1 * axis)))
                joints.append(joint)
    return Tree(parts, joints)


@pytest.mark.parametrize("tree", [humanlike(), many_armed()], ids=["humanlike", "many_armed"])
def test_sweeps_tell_of_links_side_by_side_what_they_tell_one_by_one(tree):
    together = link_records(tree)
    assert max(together["together"]) == LANES
    single = together.copy()
    single["together"] = 1
    rng = np.random.default_rng(3)
    start, v, tau = tree.neutral(), rng.normal(size=tree.nv), rng.normal(size=tree.nv)
    results = []
    for links in (together, single):
        work, q, vdot, pulled = np.zeros(len(links), WORK), np.zeros(tree.nq), np.zeros(tree.nv), np.zeros(tree.nv)
        manifold.displace(links, start, 0.7 * v, q)
        kinematics.move(links, work, q, v)
        articulated_body.factorize(links, work)
        articulated_body.accelerate(links, work, tau, np.array([0.0, 0.0, -9.81]), vdot)
        articulated_body.pull(links, work, tau, ALL, pulled)
        results.append((q, vdot, pulled, work))
    for one, other in zip(*results, strict=True):
        assert one.tobytes() == other.tobytes()
