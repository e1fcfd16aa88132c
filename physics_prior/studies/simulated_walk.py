"""A person who walks, with the truth: a made-up gait of the scene ``simulated_walk``, its forces, and what markers see of it.

The feet stand flat and still, or swing by polynomials; the pelvis is carried so that the centre of pressure goes from heel to toe
of the foot that stands, and smoothly from foot to foot while both do: of a body whose mass were in one point at a constant
height z, x - z/g x'' = p (the linear inverted pendulum: Kajita 2001), solved harmonic by harmonic, and again for what the whole
body's centre of pressure is off. Legs follow by inverse kinematics, arms and trunk swing by one harmonic. So the motion is
periodic, and the ground can bear it. What the ground does is then what inverse dynamics ask of the root: nothing is left there.

    python -m physics_prior.studies.simulated_walk bags/simulated_walk
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.simulator import Simulator
from physics_prior.estimation.measurement import Measurement
from physics_prior.interface.geometry import header_of, wrench_of
from physics_prior.interface.topics import JOINT_STATES, MULTI_DOF_JOINT_STATES
from physics_prior.recording.messages import JointState, MultiDOFJointState, PoseArray, WrenchStamped
from physics_prior.recording.simulate import EPOCH, measure, message_of
from physics_prior.recording.truth import PREFIX, Truth
from physics_prior.recording.writer import BagWriter
from physics_prior.scene import Scene, load_scene

SCENE = "simulated_walk"
CYCLE = 1.3  # s, two steps
STEP = 0.45  # m
STANCE = 0.62  # of the cycle that a foot stands: both do for twice 0.12 of it
WIDTH = 0.16  # m, between the middles of the feet
LIFT = 0.06  # m, of a swinging foot
CROUCH = 0.88  # hips above ankles, of the leg's length
BOB = 0.012  # m, of the pelvis, up and down twice a cycle
PRESSED = (0.2, 0.75)  # of the sole's length: where its centre of pressure begins and ends
HARMONICS = 12  # of the pelvis's way
SAMPLES = 120  # of a cycle
ROUNDS = 8  # of the correction
DIFFERENCE = 1e-4  # s, of derivatives
SIDES = {"left": 1.0, "right": -1.0}
SWINGS = {  # joint -> axis, mean and amplitude [rad], phase in cycles
    "lumbar": ("z", 0.0, 0.10, 0.25),
    "left_shoulder": ("y", 0.0, 0.35, 0.25),
    "right_shoulder": ("y", 0.0, 0.35, 0.75),
    "left_elbow": ("", 0.5, 0.12, 0.3),
    "right_elbow": ("", 0.5, 0.12, 0.8),
}


@dataclass(frozen=True, eq=False)
class Instant:
    """The truth at a time.

    Attributes:
        q, v, vdot: (nq,), (nv,), (nv,).
        wrenches: side -> (6,) force ON the foot and moment about the world's origin, world axes, N and N m.
        torques: (nv,) N m that muscles do, zero at the root.
    """

    q: np.ndarray
    v: np.ndarray
    vdot: np.ndarray
    wrenches: dict[str, np.ndarray]
    torques: np.ndarray


class Walk:
    """The gait of a scene's person, along x from the origin, at time zero the left foot's landing."""

    def __init__(self, scene: Scene, simulator: Simulator) -> None:
        self.scene, self.simulator, self.tree = scene, simulator, scene.tree
        self._gravity = float(np.linalg.norm(np.sum([effect.field() for effect in scene.effects], axis=0)))
        self._way = np.zeros((2, HARMONICS + 1), dtype=complex)
        self._carry()

    def at(self, time: float) -> Instant:
        """The truth at a time, s."""
        q, v, vdot = self._state(time)
        needed = self.simulator.inverse_dynamics(q, v, vdot)
        force, moment = self._whole(q, needed)
        pressed = self._pressures(time)
        off = _pressure(force, moment) - sum(share * place for share, place in pressed.values())
        wrenches, twist = {}, moment[2]
        for side, (share, place) in pressed.items():
            at = np.append(place + off, 0.0)
            wrenches[side] = share * np.concatenate([force, np.cross(at, force)])
            twist -= wrenches[side][5]
        self.simulator.move(q, v)
        torques = needed
        for side, (share, _) in pressed.items():
            wrenches[side][5] += share * twist
            J = self.simulator.jacobian(f"{side}_sole", np.zeros(3))
            origin, _ = self.simulator.pose(f"{side}_sole")
            own = wrenches[side]
            torques = torques - J[3:].T @ own[:3] - J[:3].T @ (own[3:] - np.cross(origin, own[:3]))
        return Instant(q, v, vdot, wrenches, torques)

    def configuration(self, time: float) -> np.ndarray:
        """(nq,) at a time, s."""
        tree, q = self.tree, self.tree.neutral()
        phase = 2.0 * np.pi * time / CYCLE
        turns = np.exp(1j * phase * np.arange(HARMONICS + 1))
        speed = 2.0 * STEP / CYCLE
        height = self._standing + BOB * np.cos(2.0 * phase)
        pelvis = np.array([*(self._way @ turns).real, height]) + [speed * time, 0.0, 0.0]
        q[tree.link("pelvis").q] = [*pelvis, 1.0, 0.0, 0.0, 0.0]
        for joint, (letter, mean, amplitude, shift) in SWINGS.items():
            angle = mean + amplitude * np.sin(phase - 2.0 * np.pi * shift)
            axis = np.eye(3)["xyz".find(letter)]
            q[tree.link(joint).q] = rotations.exp(angle * axis) if letter else angle
        for side in SIDES:
            self._reach(q, side, pelvis, self._heel(side, time))
        return q

    @cached_property
    def _legs(self) -> dict[str, tuple[np.ndarray, float, float, np.ndarray]]:
        """Side -> hip in the pelvis (3,), thigh and shank, and the heel's place in the foot (3,), m."""
        joint = self.tree.joint
        return {
            side: (
                joint(f"{side}_hip").position,
                float(np.linalg.norm(joint(f"{side}_knee").position)),
                float(np.linalg.norm(joint(f"{side}_ankle").position)),
                joint(f"{side}_sole").position,
            )
            for side in SIDES
        }

    @property
    def _standing(self) -> float:
        """Height of the hips, m."""
        _, thigh, shank, heel = self._legs["left"]
        return CROUCH * (thigh + shank) - float(heel[2])

    def _heel(self, side: str, time: float) -> np.ndarray:
        """(3,) m, where the heel is."""
        landed, through = self._phase(side, time)
        gone = landed * 2.0 * STEP + (0.5 * 2.0 * STEP if side == "right" else 0.0)
        swing = max(0.0, (through - STANCE) / (1.0 - STANCE))
        lift = LIFT * 64.0 * (swing * (1.0 - swing)) ** 3
        return np.array([gone + 2.0 * STEP * _smooth(swing), SIDES[side] * 0.5 * WIDTH, lift])

    @staticmethod
    def _phase(side: str, time: float) -> tuple[int, float]:
        """How often a foot has landed, and the share of a cycle since then."""
        cycles = time / CYCLE - (0.5 if side == "right" else 0.0)
        landed = int(np.floor(cycles))
        return landed, cycles - landed

    def _pressures(self, time: float) -> dict[str, tuple[float, np.ndarray]]:
        """Side -> share of the load, and where its centre of pressure is meant to be, (2,) m."""
        out, both = {}, STANCE - 0.5
        for side in SIDES:
            _, through = self._phase(side, time)
            share = _smooth(min(1.0, through / both)) * (1.0 - _smooth(min(1.0, max(0.0, through - 0.5) / both)))
            length = float(self.tree.part(f"{side}_sole").shape.size[0])  # type: ignore[union-attr]
            along = PRESSED[0] + (PRESSED[1] - PRESSED[0]) * _smooth(min(1.0, through / STANCE))
            heel = self._heel(side, time)
            out[side] = (share, np.array([heel[0] + along * length, heel[1]]))
        return out

    def _reach(self, q: np.ndarray, side: str, pelvis: np.ndarray, heel: np.ndarray) -> None:
        """Write the leg's joints that put a level foot there. The thigh turns about x and y, never about its own axis."""
        hip, thigh, shank, below = self._legs[side]
        d = heel - below - (pelvis + hip)
        bend = np.arccos(np.clip((d @ d - thigh**2 - shank**2) / (2.0 * thigh * shank), -1.0, 1.0))
        sideways = np.arctan2(d[1], -d[2])
        forward = np.arctan2(d[0], -np.hypot(d[1], d[2])) - np.arctan2(
            -shank * np.sin(bend), -thigh - shank * np.cos(bend)
        )
        x, y, _ = np.eye(3)
        turn = rotations.multiply(rotations.exp(sideways * x), rotations.exp(forward * y))
        q[self.tree.link(f"{side}_hip").q] = turn
        q[self.tree.link(f"{side}_knee").q] = bend
        q[self.tree.link(f"{side}_ankle").q] = rotations.conjugate(rotations.multiply(turn, rotations.exp(bend * y)))

    def _state(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, v and vdot at a time, by differences."""
        before, here, after = (self.configuration(time + k * DIFFERENCE) for k in (-1, 0, 1))
        into, out = self.tree.difference(before, here) / DIFFERENCE, self.tree.difference(here, after) / DIFFERENCE
        return here, 0.5 * (into + out), (out - into) / DIFFERENCE

    def _whole(self, q: np.ndarray, needed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(3,) N and (3,) N m about the world's origin, which all ground must do to the root."""
        pelvis = self.tree.link("pelvis")
        position, wxyz = q[pelvis.q][:3], q[pelvis.q][3:]
        force = needed[pelvis.v][:3]
        return force, rotations.rotate(wxyz, needed[pelvis.v][3:]) + np.cross(position, force)

    def _carry(self) -> None:
        """Find the pelvis's way."""
        times = CYCLE * np.arange(SAMPLES) / SAMPLES
        omega = 2.0 * np.pi / CYCLE * np.arange(HARMONICS + 1)
        for _ in range(ROUNDS):
            off = []
            for time in times:
                q, v, vdot = self._state(time)
                meant = sum(share * place for share, place in self._pressures(time).values())
                off.append(meant - _pressure(*self._whole(q, self.simulator.inverse_dynamics(q, v, vdot))))
            spectrum = np.fft.rfft(np.array(off), axis=0).T[:, : HARMONICS + 1] / SAMPLES
            spectrum[:, 1:] *= 2.0
            self._way += spectrum / (1.0 + omega**2 * self._standing / self._gravity)


def moments(scene: Scene, walk: Walk, seed: int, duration: float) -> Iterator[tuple[int, Instant, list[Measurement]]]:
    """Stamp, ns, truth, and what the scene's sources measure of it, at the scene's rate.

    Noise is drawn as ``recording.simulate`` does, from a PCG64 stream for each source.
    """
    streams = np.random.SeedSequence(seed).spawn(len(scene.measurements))
    noises = [np.random.Generator(np.random.PCG64(stream)) for stream in streams]
    for k in range(round(duration * scene.simulation.rate) + 1):
        time = k / scene.simulation.rate
        stamp, instant = EPOCH + round(time * 1e9), walk.at(time)
        walk.simulator.move(instant.q, instant.v)
        measured = [
            measure(source, walk.simulator, instant.q, instant.v, stamp, noise)
            for source, noise in zip(scene.measurements, noises, strict=True)
        ]
        yield stamp, instant, measured


def record(scene: Scene, out: Path, seed: int, duration: float) -> None:
    """Write a bag: markers, the true joints (effort: what muscles do), and a force plate under each foot.

    Raises:
        RecordingError: the bag exists or cannot be written.
    """
    simulator = scene.simulator()
    walk, truth = Walk(scene, simulator), Truth(scene, simulator)
    with BagWriter(out) as writer:
        for source in scene.measurements:
            writer.add_topic(source.topic, PoseArray)
        writer.add_topic(PREFIX + JOINT_STATES, JointState)
        writer.add_topic(PREFIX + MULTI_DOF_JOINT_STATES, MultiDOFJointState)
        for side in SIDES:
            writer.add_topic(f"/force_plate/{side}", WrenchStamped)
        for stamp, instant, measured in moments(scene, walk, seed, duration):
            header = header_of(stamp, scene.frame_id)
            for each in measured:
                writer.write(each.topic, message_of(each, scene.frame_id), stamp)
            for topic, message in truth.messages(stamp, instant.q, instant.v):
                if isinstance(message, JointState):
                    efforts = [instant.torques[scene.tree.link(name).v][0] for name in message.name]
                    writer.write(topic, replace(message, effort=np.array(efforts)), stamp)
                elif isinstance(message, MultiDOFJointState):
                    writer.write(topic, replace(message, wrench=()), stamp)
            for side, wrench in instant.wrenches.items():
                writer.write(f"/force_plate/{side}", WrenchStamped(header, wrench_of(wrench[:3], wrench[3:])), stamp)


def _pressure(force: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """(2,) m, where the ground, z = 0, presses."""
    return np.array([-moment[1] / force[2], moment[0] / force[2]])


def _smooth(share: float) -> float:
    """From 0 to 1 with neither speed nor acceleration at the ends: the least jerk (Flash and Hogan 1985)."""
    return float(share**3 * (10.0 - 15.0 * share + 6.0 * share**2))


def main(words: Sequence[str]) -> int:
    """Write the shipped bag; 0."""
    scene = load_scene(SCENE)
    record(scene, Path(words[0]), scene.simulation.seed, scene.simulation.duration)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
