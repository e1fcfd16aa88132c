"""Unknown forces as states: their noise, what they do to a state, consistency, feet that stand and lift, and standing still."""

import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import chi2

from physics_prior import rotations
from physics_prior.dynamics.wrench_deviations import wrench_deviations
from physics_prior.errors import SceneError
from physics_prior.estimation import bearing, ground, stance
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.filter import ITERATIONS, SMALL_CORRECTION, Filter, Posterior
from physics_prior.estimation.gain import gain_of
from physics_prior.estimation.measurement import JointsMeasurement, PointsMeasurement, PoseMeasurement
from physics_prior.estimation.processes import PROCESSES
from physics_prior.estimation.square_root import normalised_error
from physics_prior.scene import build_scene
from physics_prior.scene.yaml_file import parse_yaml

H = 0.005
MARKERS = [
    (part, place)
    for part in (
        ["pelvis", "thorax", "head"]
        + [
            f"{side}_{segment}"
            for side in ("left", "right")
            for segment in ("thigh", "shank", "foot", "upper_arm", "ulna")
        ]
    )
    for place in ((0.1, 0.05, 0.0), (-0.05, 0.1, 0.05), (0.0, -0.08, 0.1))
]
TEXT = """
description: A person who stands on both feet.
model: {human: {mass: 60 kg, height: 170 cm, sex: female, rigid: [RIGID]}}
effects:
  - gravity
  - muscle:
      strength: MUSCLES
  - ground_reaction: {name: left_sole, part: left_sole, vertical: 100 N, horizontal: 30 N, moment: 5 N m}
  - ground_reaction: {name: right_sole, part: right_sole, vertical: 100 N, horizontal: 30 N, moment: 5 N m}
measurements:
  - points: {topic: /markers, noise: 1 mm, markers: [MARKERS]}
noise:
  force: 0
  velocity: 0.01
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    joints = ["neck"] + [
        f"{side}_{j}" for side in ("left", "right") for j in ("hip", "knee", "ankle", "shoulder", "elbow")
    ]
    rigid = [f"{side}_{j}" for side in ("left", "right") for j in ("radioulnar", "wrist_flexion", "wrist_deviation")]
    strength = {"hip": 40.0, "knee": 40.0, "ankle": 2.0, "shoulder": 10.0, "neck": 10.0, "elbow": 4.0}
    muscles = ", ".join(f"{joint}: {strength[joint.rpartition('_')[2]]}" for joint in joints)
    markers = ", ".join(
        f"{{name: m{k}, part: {part}, point: [{x}, {y}, {z}]}}" for k, (part, (x, y, z)) in enumerate(MARKERS)
    )
    text = TEXT.replace("MUSCLES", f"{{{muscles}}}").replace("MARKERS", markers)
    text = text.replace("RIGID", ", ".join(["lumbar", "thoracic", *rigid]))
    path = tmp_path_factory.mktemp("scenes") / "standing.yaml"
    path.write_text(text)
    return build_scene(parse_yaml(path, text))


@pytest.fixture(scope="module")
def process(scene):
    return PROCESSES["physics"](scene, scene.simulator())


@pytest.fixture
def standing(process):
    """A person with the soles on the ground, at rest."""
    tree = process.simulator.tree
    q = tree.neutral()
    process.simulator.move(q, np.zeros(process.nv))
    q[2] -= process.simulator.pose("left_sole")[0][2]
    return process.start(q, np.zeros(process.nv))


def moved(process, state, seed, size=0.05):
    error = size * np.random.default_rng(seed).normal(size=process.n)
    error[2 * process.nv :] *= process.unknown.deviation / size
    return process.displace(state, error)


def test_a_person_who_stands_starts_with_shared_weight(process, standing):
    assert standing.grounded.tolist() == [True, True]
    weight = 60.0 * 9.80665
    for foot in process.unknown.feet:
        np.testing.assert_allclose(standing.force[foot.span], [0.0, 0.0, 0.5 * weight, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(process.start_factor(standing), process.unknown.deviation)
    up = standing.copy()
    up.q[2] += 0.1
    up = process.start(up.q, up.v)
    assert up.grounded.tolist() == [False, False]
    assert process.start_factor(up)[process.unknown.feet[0].span].tolist() == [0.0] * 6


def test_forces_are_ornstein_uhlenbeck_processes(process, standing):
    """Mean and covariance of a step are those that a matrix exponential gives (Van Loan 1978)."""
    state = moved(process, standing, 1)
    own, before = process.unknown, state.force.copy()
    F, G = process.advance(state, H)
    feet = np.concatenate([np.arange(own.count)[foot.span] for foot in own.feet])
    rate = 1.0 / own.time_constant[feet[0]]
    for k in feet:
        block = expm(H * np.array([[rate, 2.0 * rate * own.deviation[k] ** 2], [0.0, -rate]]))
        row = 2 * process.nv + k
        assert F[row, row] == pytest.approx(block[1, 1], rel=1e-12)
        assert np.sum(G[row] ** 2) == pytest.approx(block[1, 1] * block[0, 1], rel=1e-9)
    mean = process.start(standing.q, standing.v).force
    np.testing.assert_allclose(state.force - mean, np.exp(-H * rate) * (before - mean), rtol=1e-12, atol=1e-12)


def test_the_derivative_of_a_step_is_that_of_differences(process, standing):
    """That by forces is of second order in the step. Measured: 2e-3 of the largest in a column."""
    start, h = moved(process, standing, 2), 0.2 * H
    end = start.copy()
    F, _ = process.advance(end, h)
    differences = np.zeros_like(F)
    for k, one in enumerate(np.eye(process.n)):
        ends = []
        for sign in (1e-5, -1e-5):
            state = process.displace(start, sign * one).copy()
            process.advance(state, h)
            ends.append(process.difference(end, state))
        differences[:, k] = (ends[0] - ends[1]) / 2e-5
    nv = process.nv
    np.testing.assert_allclose(F[:, : 2 * nv], differences[:, : 2 * nv], atol=1e-5 * np.max(np.abs(differences)))
    by_force, ours = differences[nv : 2 * nv, 2 * nv :], F[nv : 2 * nv, 2 * nv :]
    scale = np.max(np.abs(by_force), axis=0)
    assert np.max(np.abs(ours - by_force) / scale) < 0.01
    np.testing.assert_allclose(F[2 * nv :], differences[2 * nv :], atol=1e-8)


def test_a_surprise_under_a_foot_moves_no_joint(process, standing):
    """The noise of a foot's wrench accelerates the root alone; that of muscles is theirs."""
    state = moved(process, standing, 3)
    M = process.simulator.mass_matrix(state.q)
    D = process.unknown.columns(process.simulator)
    _, G = process.advance(state.copy(), H)
    noise = G[2 * process.nv :]
    for foot in process.unknown.feet:
        accelerations = np.linalg.solve(M, D @ noise[:, foot.span])
        assert np.max(np.abs(accelerations[6:])) < 1e-9 * np.max(np.abs(accelerations[:6]))
    torques = noise[np.ix_(process.unknown.torques, process.unknown.torques)]
    assert np.count_nonzero(torques - np.diag(np.diag(torques))) == 0


def test_deviations_of_forces_are_those_of_differences(process, standing):
    """Against differences in Python, a column at a time; those of feet are of states: exact."""
    state, factor, simulator = moved(process, standing, 4), 1e-2 * _noisy(process, 4), process.simulator
    process.enter(state)
    ours, squares = wrench_deviations(simulator, state.q, state.v, factor, 1e-3), 0.0
    np.testing.assert_array_equal(process.unknown.force, state.force)
    for column in factor.T:
        pair = []
        for sign in (1e-3, -1e-3):
            near = process.displace(state, sign * column)
            process.enter(near)
            pair.append(simulator.wrench_array(near.q, near.v))
        squares = squares + ((pair[0] - pair[1]) / 2e-3) ** 2
    np.testing.assert_allclose(ours, np.sqrt(squares), rtol=1e-8, atol=1e-9 * np.max(ours))  # 2e-11
    for row, foot in enumerate(process.unknown.feet, start=len(ours) - 2):
        np.testing.assert_allclose(ours[row], np.linalg.norm(factor[2 * process.nv :][foot.span], axis=1), rtol=1e-14)


def _noisy(process, seed):
    """A state's factor: any, with the deviations of the forces."""
    scale = np.concatenate([np.full(2 * process.nv, 1e-3), process.unknown.deviation])
    return np.tril(np.random.default_rng(seed).normal(size=(process.n, process.n))) * 0.1 * scale[:, None]


def test_a_lifted_foot_is_told_that_it_carries_nothing(process, standing):
    """The posterior is that of dense Gaussian conditioning; the foot has no uncertainty left."""
    factor, state = _noisy(process, 5), standing.copy()
    state.v[:] = 0.0
    foot = process.unknown.feet[0]
    own = np.arange(process.n)[2 * process.nv :][foot.span]
    P = factor @ factor.T
    gain = P[:, own] @ np.linalg.inv(P[np.ix_(own, own)])
    told, after = ground._unload(process, state, factor.copy(), foot)
    np.testing.assert_allclose(process.difference(state, told), -gain @ state.force[foot.span], atol=1e-7)
    expected = P - gain @ P[own]
    np.testing.assert_allclose(after @ after.T, expected, atol=1e-9 * np.max(P))
    assert not after[own].any()
    assert not told.force[foot.span].any()


@pytest.mark.parametrize(
    ("height", "speed", "load", "deviation", "stood", "stands"),
    [
        (0.0, 0.0, 0.0, 0.0, False, True),
        (0.05, 0.0, 0.0, 0.0, False, False),  # too high to come down
        (0.0, 0.6, 0.0, 0.0, False, False),  # too fast
        (0.0, 0.6, 300.0, 50.0, True, True),  # but one that stood goes on standing
        (0.05, 0.0, 300.0, 50.0, True, True),
        (0.05, 0.0, 5.0, 1.0, True, False),  # unless it surely carries nothing
        (0.05, 0.0, 5.0, 200.0, True, True),
        (0.0, 0.0, 0.0, 1.0, True, True),  # one that is still stands without a load
        (0.0, 1.5, 300.0, 200.0, True, False),  # fast, and perhaps without a load
        (0.0, 1.5, 600.0, 50.0, True, True),  # fast, but surely loaded: it is the velocity that is wrong
        (0.0, 3.0, 600.0, 50.0, True, False),
        (0.13, 0.0, 600.0, 50.0, True, False),
    ],
)
def test_contact_is_told_by_height_speed_and_load(process, standing, height, speed, load, deviation, stood, stands):
    state, foot = standing.copy(), process.unknown.feet[0]
    state.q[2] += height
    state.v[0] = speed
    state.force[foot.span.start + 2] = load
    process.simulator.move(state.q, state.v)
    assert ground.stands(process, 0, state, stood, True, np.zeros((process.n, 1)), deviation) is stands


def test_feet_lift_and_land_in_the_filter(process, standing):
    """Flags, forces and their factors follow; the covariance stays one."""
    state, factor = standing.copy(), _noisy(process, 6)
    state.v[2] = 3.0
    for foot in process.unknown.feet:
        state.force[foot.span.start + 2] = 10.0
    up, lifted = process.settle(state, factor)
    assert up.grounded.tolist() == [False, False]
    assert not up.force[process.unknown.feet[0].span].any()
    assert standing.grounded.all()  # states are not shared
    later = process.predict(up.copy(), lifted, H, 1)
    assert not later[2 * process.nv :][process.unknown.feet[1].span].any()
    down = up.copy()
    down.q[:], down.v[:] = standing.q, 0.0
    landed, again = process.settle(down, later)
    assert landed.grounded.tolist() == [True, True]
    grown = process.predict(landed.copy(), again, H, 1)
    assert (np.sum(grown[2 * process.nv :][process.unknown.feet[1].span] ** 2, axis=1) > 0.0).all()
    assert np.linalg.eigvalsh(grown @ grown.T)[0] > -1e-9


def test_a_foot_that_stands_goes_with_the_ground(process, standing):
    """The posterior is that of dense Gaussian conditioning on the velocities of the corners, each by itself."""
    state, factor = moved(process, standing, 7, 0.01), _noisy(process, 7)
    feet, simulator = process.unknown.feet, process.simulator
    state.force[[foot.span.start + 2 for foot in feet]] = 0.25 * process.scale, 0.75 * process.scale
    simulator.move(state.q, state.v)
    rows, deviations = [], []
    for foot, share in zip(feet, (0.25, 0.75), strict=True):
        for corner in foot.sole.corners:
            place, R = simulator.pose(foot.sole.part)
            rows.append(simulator.jacobian(foot.sole.part, corner)[3:])
            further = 1.0 + abs((place + R @ corner)[2] - foot.sole.height) / stance.ROLLING
            deviations += [stance.STILL / np.sqrt(H) * further / share] * 3
    J, noise = np.concatenate(rows), np.diag(np.square(deviations))
    H_v = np.hstack([np.zeros_like(J), J, np.zeros((len(J), process.unknown.count))])
    P = factor @ factor.T
    gain = P @ H_v.T @ np.linalg.inv(H_v @ P @ H_v.T + noise)
    told = state.copy()
    after = stance.keep_still(process, told, factor, H)
    np.testing.assert_allclose(process.difference(state, told), -gain @ (J @ state.v), atol=1e-8)
    np.testing.assert_allclose(after @ after.T, P - gain @ H_v @ P, atol=1e-10 * np.max(P))


def test_feet_off_the_ground_and_feet_without_a_load_are_told_nothing(process, standing):
    state, factor = moved(process, standing, 8), _noisy(process, 8)
    state.force[:] = 0.0
    for grounded in (False, True):
        state.grounded = np.array([grounded, grounded])
        told = state.copy()
        after = stance.keep_still(process, told, factor, H)
        np.testing.assert_allclose(after @ after.T, factor @ factor.T, atol=1e-12)
        np.testing.assert_array_equal(told.v, state.v)


def test_the_load_does_not_tip_a_foot_that_nothing_tells(process, standing):
    """Predicted for 0.1 s with what muscles may do, ankles are known to 0.76 rad; without the ground's hold to 2.86 rad."""
    factor = np.zeros((process.n, process.n))
    rows = [row for row, name in enumerate(process.simulator.tree.freedom_names) if "ankle" in name]
    factor[rows, rows] = 1e-4
    held, free, one = standing.copy(), standing.copy(), factor
    held_factor = process.predict(held, factor, H, 1)
    for _ in range(19):
        held_factor = process.predict(held, held_factor, H, 1)
    for _ in range(20):
        one = np.linalg.qr(process.carry(free, one, H).T, mode="r").T
    known, lost = (np.max(np.linalg.norm(each[rows], axis=1)) for each in (held_factor, one))
    assert known < 0.5 * lost  # 0.27


@pytest.mark.parametrize("seed", range(8))
def test_forces_are_such_as_the_ground_can_exert(process, standing, seed):
    """Never a pull, within friction, the pressure in the sole, whatever the state says; a possible state stays."""
    rng = np.random.default_rng(seed)
    state = moved(process, standing, seed, 0.02).copy()
    for foot in process.unknown.feet:
        state.force[foot.span] = rng.normal(size=6) * [300.0, 300.0, 300.0, 60.0, 60.0, 20.0]
    wanted, factor = state.copy(), _noisy(process, seed)
    process.admit(state, factor)
    assert (state.force != wanted.force).any()
    process.simulator.move(state.q, state.v)
    for foot in process.unknown.feet:
        wrench = state.force[foot.span]
        assert wrench[2] >= 0.0
        assert np.hypot(*wrench[:2]) <= wrench[2] * (1.0 + 1e-9)
        position, R = process.simulator.pose(foot.sole.part)
        if wrench[2] > 1.0:
            middle = position + R @ foot.sole.center
            # where the wrench has no horizontal moment on the ground, from under the middle
            pressure = (np.array([-wrench[4], wrench[3]]) - middle[2] * wrench[:2]) / wrench[2]
            own = np.linalg.solve(R[:2, :2] * foot.sole.half, pressure)
            assert np.max(np.abs(own)) <= 1.0 + 1e-6
    same = state.copy()
    assert not process.admit(same, factor)
    np.testing.assert_allclose(same.force, state.force, atol=1e-9)


@pytest.mark.parametrize("yaw", [0.0, 0.7, 0.5 * np.pi])
def test_a_sole_that_stands_on_edge_has_bounds(process, standing, yaw):
    """Seen from above it is a line: bounds were 1e16 times too steep, or the matrix of its sides singular."""
    state, upright = standing.copy(), rotations.exp(np.array([0.5 * np.pi, 0.0, 0.0]))
    state.q[3:7] = rotations.multiply(upright, rotations.exp(np.array([0.0, 0.0, yaw])))
    process.simulator.move(state.q, state.v)
    foot, wrench, rows = process.unknown.feet[0], np.array([0.0, 0.0, 300.0, 0.0, 0.0, 0.0]), np.empty((6, 6))
    work, sole = process.simulator.memory.work, process.unknown.soles[0]
    bearing.fill_bounds(work, sole, wrench, rows)
    assert np.max(np.abs(rows)) < 1e4  # 1 / m: over a tenth of the shorter side, by the height
    assert (rows[0] @ wrench, rows[1] @ wrench) == (300.0, 300.0 * foot.sole.friction)
    beyond = 10.0 + wrench
    bearing.cut(work, sole, beyond, rows)
    assert np.isfinite(beyond).all()


@pytest.mark.parametrize("seed", range(4))
def test_the_sole_seen_from_above_is_inverted_as_by_its_singular_values(seed):
    A = np.random.default_rng(seed).normal(size=(2, 2))
    if seed == 0:
        A = np.diag([0.1, 0.1])  # any directions are its singular vectors
    U, s, Vt = np.linalg.svd(A)
    for least in (0.0, 0.5 * (s[0] + s[1]), 2.0 * s[0]):
        expected = (Vt.T / np.maximum(s, least)) @ U.T
        np.testing.assert_allclose(bearing.edges_inverse(*A.reshape(-1), least), expected.reshape(-1), rtol=1e-10)


@pytest.mark.parametrize("name", ["kinematic", "frozen"])
def test_processes_that_find_no_unknown_forces_say_so(scene, name):
    """They left the feet empty, and published that as what the ground does."""
    with pytest.raises(
        SceneError, match=rf"process '{name}' finds no unknown forces.*'muscle', 'left_sole', 'right_sole'"
    ):
        PROCESSES[name](scene, scene.simulator())


BLOCK = """
description: A block on two soles, with an arm that a muscle moves.
model:
  parts:
    body: {mass: 40, inertia: {box: [0.4, 0.4, 0.3]}, joint: {kind: free, name: flight}}
    left: {joint: {kind: fixed, parent: body, position: [0, 0.15, -0.15]}}
    right: {joint: {kind: fixed, parent: body, position: [0, -0.15, -0.15]}}
    arm: {mass: 10, center_of_mass: [0, 0, -0.2], inertia: 0.3, joint: {kind: revolute, parent: body, axis: y, name: hinge}}
effects:
  - gravity
  - muscle: {strength: {hinge: 10 N m}}
  - ground_reaction: {name: l, part: left, size: [0.3, 0.1], vertical: 40 N, horizontal: 10 N, moment: 2 N m}
  - ground_reaction: {name: r, part: right, size: [0.3, 0.1], vertical: 40 N, horizontal: 10 N, moment: 2 N m}
measurements:
  - pose: {topic: /body, part: body, position_noise: 1 mm, orientation_noise: 2e-3}
  - joints: {topic: /hinge, joints: {hinge: hinge}, noise: 2e-3}
noise: {force: 0, velocity: 0.05}
initial: {positions: {flight: {position: [0, 0, 0.15]}}}
"""


def test_the_filter_is_consistent(tmp_path):
    """NEES of the configuration, of all errors and of the feet's forces over 30 runs of 0.1 s, of truth drawn from the prior."""
    path = tmp_path / "block.yaml"
    path.write_text(BLOCK)
    scene = build_scene(parse_yaml(path, BLOCK))
    process = PROCESSES["physics"](scene, scene.simulator())
    nv, nees = process.nv, []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        state = process.start(scene.initial.q.copy(), 0.05 * rng.normal(size=process.nv))
        state.force += process.unknown.deviation * rng.normal(size=process.unknown.count)
        estimator = Estimator(scene)
        for index in range(21):
            if index:
                _, G = process.advance(state, H)
                state = process.displace(state, G @ rng.normal(size=G.shape[1])).copy()
            stamp, turn = round(index * H * 1e9), rotations.exp(2e-3 * rng.normal(size=3))
            seen = rotations.multiply(state.q[3:7], turn)
            estimator.add(PoseMeasurement(stamp, "/body", state.q[:3] + 1e-3 * rng.normal(size=3), seen))
            estimator.add(JointsMeasurement(stamp, "/hinge", ("hinge",), state.q[7:] + 2e-3 * rng.normal(size=1)))
        posterior = estimator.history.nodes[-1].posterior
        assert posterior.state.grounded.all()
        error = process.difference(posterior.state, state)
        parts = (slice(0, nv), slice(0, process.n), slice(process.n - 12, process.n))
        nees.append([normalised_error(posterior.factor[part], error[part])[0] for part in parts])
    for mean, size in zip(np.mean(nees, axis=0), (nv, process.n, 12), strict=True):
        low, high = (float(bound) / 30 for bound in chi2.interval(0.95, 30 * size))
        assert low <= mean <= high  # measured: 6.8 of 7, 29.2 of 27, 13.1 of 12


def test_who_stands_still_is_borne_by_the_ground(scene, process, standing):
    """Weight within 1 %, horizontal force below 1 % of it, pressure within the support."""
    rng = np.random.default_rng(0)
    simulator = process.simulator
    simulator.move(standing.q, standing.v)
    places = []
    for part, place in MARKERS:
        position, R = simulator.pose(part)
        places.append(position + R @ np.array(place))
    estimator = Estimator(scene)
    total, pressures = [], []
    for index in range(120):
        points = np.array(places) + 1e-3 * rng.normal(size=(len(places), 3))
        estimator.add(PointsMeasurement(round(index * H * 1e9), "/markers", points))
        if index >= 60:
            wrenches = estimator.estimate().wrenches
            feet = [wrenches["left_sole"], wrenches["right_sole"]]
            total.append(sum(foot.force for foot in feet))
            moment = sum(foot.moment + np.cross(foot.point, foot.force) for foot in feet)
            pressures.append(np.array([-moment[1], moment[0]]) / total[-1][2])
    weight = 60.0 * 9.80665
    mean = np.mean(total, axis=0)
    assert mean[2] == pytest.approx(weight, rel=0.01)
    assert np.max(np.abs(mean[:2])) < 0.01 * weight
    simulator.move(standing.q, standing.v)
    corners = []
    for foot in process.unknown.feet:
        position, R = simulator.pose(foot.sole.part)
        corners.append(position + foot.sole.corners @ R.T)
    low, high = np.min(np.concatenate(corners), axis=0), np.max(np.concatenate(corners), axis=0)
    assert (low[:2] < np.min(pressures, axis=0)).all()
    assert (np.max(pressures, axis=0) < high[:2]).all()


def test_an_update_is_repeated_until_what_is_seen_stays(scene, process, standing, monkeypatch):
    """Joints within 2e-5 rad, after 4 passes; forces, in N, go on in the sixth digit: with them it was always all 5."""
    simulator = process.simulator
    passes = []

    def counted(U, seen, about):
        passes.append(gain_of(U, seen, about))
        return passes[-1]

    monkeypatch.setattr("physics_prior.estimation.filter.gain_of", counted)
    there = moved(process, standing, 0, 0.03)
    simulator.move(there.q, there.v)
    poses = [simulator.pose(part) for part, _ in MARKERS]
    points = [position + R @ np.array(place) for (position, R), (_, place) in zip(poses, MARKERS, strict=True)]
    factor = np.diag(np.concatenate([np.full(2 * process.nv, 0.1), process.unknown.deviation]))
    factor[2 * process.nv :, : process.nv] = 100.0 * np.random.default_rng(1).normal(
        size=(process.n - 2 * process.nv, process.nv)
    )
    prior = Posterior(0, standing, factor, accepted=0, holds=simulator.switches.holds)
    seen = PointsMeasurement(0, "/markers", np.array(points))
    posterior = Filter(scene, simulator, process).update(prior, seen, gated=False)
    assert posterior.used
    assert passes[0].change > SMALL_CORRECTION
    assert 2 <= len(passes) < ITERATIONS


ONE_RUN = """
import hashlib
import numpy as np
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.measurement import PointsMeasurement
from physics_prior.scene import load_scene

scene = load_scene("walk_lemouel")
(source,), estimator, rng = scene.measurements, Estimator(scene), np.random.default_rng(0)
estimator.simulator.move(scene.initial.q, scene.initial.v)
poses = [estimator.simulator.pose(marker.part) for marker in source.markers]
places = [position + R @ marker.point for (position, R), marker in zip(poses, source.markers, strict=True)]
for stamp in range(0, 60_000_000, 5_000_000):
    points = np.array(places) + 1e-3 * rng.normal(size=(len(places), 3))
    estimator.add(PointsMeasurement(stamp, source.topic, points))
estimate = estimator.estimate()
numbers = [estimate.q, estimate.v, estimate.covariance, *estimate.wrench_deviations.values()]
print(hashlib.sha256(b"".join(array.tobytes() for array in numbers)).hexdigest())
"""


def test_the_same_numbers_on_any_number_of_cores():
    """Libraries of linear algebra share large products among cores, and round otherwise then: those of 126 errors were."""
    said = set()
    for count in ("1", "2"):
        environment = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), count)
        run = subprocess.run(
            [sys.executable, "-c", ONE_RUN], env=os.environ | environment, capture_output=True, text=True, check=True
        )
        said.add(run.stdout)
    assert len(said) == 1
