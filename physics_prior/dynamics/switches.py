"""What acts at present: effects that come and go, the impulse with which attachments take hold, and where they did (eq. 9)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.anchor_motion import displaced_anchor
from physics_prior.dynamics.assembly import ASSEMBLED, assemble, turned_over
from physics_prior.dynamics.compose import set_acting
from physics_prior.dynamics.conditioning import unlike
from physics_prior.dynamics.records import pair_records
from physics_prior.dynamics.wrench import Wrench
from physics_prior.effects.holding import Holding
from physics_prior.errors import ModelError, SimulationError

if TYPE_CHECKING:
    from physics_prior.dynamics.simulator import Simulator

GAIN = 1e-6  # of the kinetic energy: what rounding may add as something takes hold
UNLIKE = "the masses or inertias that it joins are too unlike for its force to be told from rounding"
MOVED = 1e-12  # m or rad: below it, taking hold has not moved the body


@dataclass(frozen=True)
class Hold:
    """Whether an effect holds or pushes, and where it took hold if it does so wherever its part is.

    Attributes:
        active: whether it acts.
        caught: (7,) the point's position, m, and the part's axes, a quaternion, in the frame of what holds it; else empty.
    """

    active: bool
    caught: tuple[float, ...] = ()


@dataclass(frozen=True)
class Event:
    """An effect that begins to act or ends by itself.

    Attributes:
        time: ns since the scene's beginning.
        index: of the effect among those that can be switched.
        on: whether it begins.
    """

    time: int
    index: int
    on: bool


@dataclass(frozen=True)
class Stretch:
    """A time, begin to end in ns since the scene's beginning, in which nothing switches, and what does so at its end."""

    begin: int
    end: int
    events: tuple[Event, ...]


class Switches:
    """The effects of a simulator that can be switched: with its point pairs [first, last) in the memory; none if it only pushes.

    Attributes:
        effects, labels, spans: they, their names, and their point pairs.
        acting: whether each of the simulator's effects acts, these or others.
        events: what switches by itself, in order.
    """

    def __init__(self, simulator: "Simulator", spans: Mapping[str, tuple[int, int]]) -> None:
        self._simulator = simulator
        self.effects = tuple(effect for effect in simulator.effects if effect.switchable(simulator.tree))
        self.labels = [effect.label for effect in self.effects]
        self.spans = tuple(spans.get(label, (0, 0)) for label in self.labels)
        self._holds, self.acting = tuple(Hold(True) for _ in self.effects), (True,) * len(simulator.effects)
        for index, (first, last) in enumerate(self.spans):
            simulator.memory.pairs["here"][first:last] = self._here(index)
        self.holds = self.told([effect.active_at(0.0) for effect in self.effects])
        events = [
            Event(round(time * 1e9), index, effect.active_at(time))
            for index, effect in enumerate(self.effects)
            for time in effect.switch_times()
        ]
        self.events = tuple(sorted(events, key=lambda event: (event.time, event.index)))

    @property
    def holds(self) -> tuple[Hold, ...]:
        """What holds or pushes, effect by effect; set, it is what the next step goes by."""
        return self._holds

    @holds.setter
    def holds(self, holds: tuple[Hold, ...]) -> None:
        if holds == self._holds:
            return
        for index, (old, new) in enumerate(zip(self._holds, holds, strict=True)):
            if new != old:
                self._write(index, new)
        self._holds = tuple(holds)
        on = dict(zip(self.labels, (hold.active for hold in holds), strict=True))
        simulator = self._simulator
        self.acting = tuple(on.get(effect.label, True) for effect in simulator.effects)
        set_acting(simulator.memory.parameters, simulator.effects, self.acting)

    @property
    def holding(self) -> tuple[str, ...]:
        """The names of the effects that hold, or push, now."""
        return tuple(label for label, hold in zip(self.labels, self._holds, strict=True) if hold.active)

    @property
    def rows(self) -> int:
        """The number of rows that act now."""
        pairs = self._simulator.memory.pairs
        return int(pairs["rows"] @ pairs["active"]) if len(pairs) else 0

    def switch(self, label: str, on: bool, q: np.ndarray, v: np.ndarray) -> dict[str, Wrench]:
        """Have an effect act or not at q and v, which are put in place onto all that holds if it takes hold; return the impulses.

        Raises:
            ModelError: no effect of that name can be switched; SimulationError: it cannot take hold there. Then nothing changes.
        """
        before, index = (self._holds, q.copy(), v.copy()), self.index(label)
        self.holds = self.switched(index, on, q)
        try:
            return self.take_hold(q, v) if on and self.grips(index) else {}
        except SimulationError:
            self.holds, q[:], v[:] = before
            raise

    def begin(self, q: np.ndarray, v: np.ndarray) -> None:
        """Have what acts at time zero do so; what holds takes hold at q and v, which are put in place onto all of it."""
        self._simulator.time = 0.0
        for index, effect in enumerate(self.effects):
            self.holds = self.switched(index, effect.active_at(0.0), q)
        self.take_hold(q, v)

    def grips(self, index: int) -> bool:
        """Whether an effect holds something, and does not only push."""
        first, last = self.spans[index]
        return first < last

    def row_span(self, index: int) -> slice:
        """The rows of an effect that holds something among those of the constraints."""
        first, last = self.spans[index]
        pairs = self._simulator.memory.pairs
        return slice(int(pairs["first"][first]), int(pairs["first"][last - 1] + pairs["rows"][last - 1]))

    def stretches(self, begin: int, end: int) -> Iterator[Stretch]:
        """The stretches of a time, in order; its own end is the last one's, and what switches then belongs to it."""
        for time in sorted({end, *(event.time for event in self.events if begin < event.time < end)}):
            yield Stretch(begin, time, tuple(event for event in self.events if event.time == time))
            begin = time

    def follow(self, events: Sequence[Event], q: np.ndarray, v: np.ndarray) -> dict[str, Wrench]:
        """Switch as scheduled at q and v, which are put in place onto all that holds then; return the impulses.

        Raises:
            SimulationError: something cannot take hold.
        """
        due = [event for event in events if self._holds[event.index].active != event.on]
        for event in due:
            self.holds = self.switched(event.index, event.on, q)
        return self.take_hold(q, v) if any(event.on and self.grips(event.index) for event in due) else {}

    def index(self, label: str) -> int:
        """Where an effect stands among those that can be switched.

        Raises:
            ModelError: none of this name can.
        """
        if label not in self.labels:
            raise ModelError(
                f"effect '{label}' cannot be switched: those that hold something, or say 'when' or 'initially',"
                f" are {self.labels}"
            )
        return self.labels.index(label)

    def switched(self, index: int, on: bool, q: np.ndarray) -> tuple[Hold, ...]:
        """What holds once an effect is switched at configuration q (nq,)."""
        holds = list(self._holds)
        holds[index] = Hold(on, self._place(index, q) if on and self._here(index) else ())
        return tuple(holds)

    def told(self, active: Sequence[bool]) -> tuple[Hold, ...]:
        """What holds if these do, but for those that hold wherever their part is: these have not taken hold yet."""
        return tuple(Hold(on and not self._here(index)) for index, on in enumerate(active))

    def recaught(self, q: np.ndarray) -> tuple[Hold, ...]:
        """What holds, with the anchors of those that hold wherever their parts were moved to where these are at q."""
        return tuple(
            Hold(True, self._place(index, q)) if hold.caught else hold for index, hold in enumerate(self._holds)
        )

    def take_hold(self, q: np.ndarray, v: np.ndarray) -> dict[str, Wrench]:
        """Put q and v in place onto all that holds, as something takes hold; return each effect's impulse.

        The position in the mass metric and without kinetic energy being added; the velocity by the impulse L of
        [M A^T; A 0] [v+; L] = [M v-; 0] (design eq. 9), with a moving anchor's velocity for the zero. Impulses, N s and N m s,
        are wrenches in all else: ON the held part, about its point, world axes.

        Raises:
            SimulationError: the position cannot be put there.
        """
        if not self._simulator.rows:
            return {}
        simulator, before, speed = self._simulator, q.copy(), v.copy()
        energy = _kinetic_energy(simulator, q, v)
        left = assemble(simulator, q, v)
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise SimulationError(f"{self.furthest()} cannot take hold: {UNLIKE}")
        if not left <= ASSEMBLED:
            self.require_alike(before)
            raise SimulationError(
                f"{self.furthest()} cannot take hold: {left:.3g} m stay between the points that it joins"
            )
        for index in turned_over(simulator):
            raise SimulationError(
                f"'{self.labels[index]}' cannot take hold: its part is held by others half a turn away"
            )
        impulses = self._impulses()
        self.require_alike(q)
        moved = float(np.max(np.abs(simulator.tree.difference(before, q)), initial=0.0))
        after = _kinetic_energy(simulator, q, v)
        if not np.any(simulator.memory.pairs["motion"]):
            # the impulse is a projection in the mass metric, so it takes energy
            if after > (1.0 + GAIN) * _kinetic_energy(simulator, q, speed):
                raise SimulationError(f"{self.furthest()} cannot take hold: {UNLIKE}")
            if moved > MOVED and after > energy:
                v *= np.sqrt(energy / after)
        return impulses

    def require_alike(self, q: np.ndarray) -> None:
        """Raise SimulationError if at q the masses lose a direction that what holds has as levers."""
        index = unlike(self._simulator, q) if self._simulator.rows else None
        if index is not None:
            raise SimulationError(f"'{self.labels[index]}' cannot take hold: {UNLIKE}")

    def _here(self, index: int) -> bool:
        effect = self.effects[index]
        return isinstance(effect, Holding) and effect.at is None

    def _place(self, index: int, q: np.ndarray) -> tuple[float, ...]:
        """Where an effect that holds wherever its part is takes hold at q, less its anchor's displacement then."""
        effect, simulator = self.effects[index], self._simulator
        assert isinstance(effect, Holding)
        simulator.move(q, np.zeros(simulator.nv))
        (x, R), (y, S) = simulator.pose(effect.part), simulator.pose(effect.to)
        point = x + R @ np.array(effect.point)
        begin = int(simulator.memory.pairs["motion"][self.spans[index][0]])
        if begin > 0:
            point = point - np.array(displaced_anchor(simulator.memory.parameters[begin:], simulator.time)[0])
        orientation = rotations.quaternion_from_matrix(S.T @ R)
        return (*(S.T @ (point - y)).tolist(), *orientation.tolist())

    def _write(self, index: int, hold: Hold) -> None:
        first, last = self.spans[index]
        memory = self._simulator.memory
        memory.pairs["active"][first:last] = hold.active
        memory.work["factored"][0] = 0
        if hold.caught:
            effect, tree = self.effects[index], self._simulator.tree
            assert isinstance(effect, Holding)
            caught = effect.caught(np.array(hold.caught[:3]), np.array(hold.caught[3:]))
            records = pair_records(tree, list(caught.point_pairs(tree)))
            for name in ("point_a", "base", "point_b", "directions"):
                memory.pairs[name][first:last] = records[name]

    def _impulses(self) -> dict[str, Wrench]:
        """Impulses of the velocity projection that ``project`` ended with, of what holds."""
        memory, out = self._simulator.memory, {}
        multipliers = memory.rows[-2]
        for label, (first, last), hold in zip(self.labels, self.spans, self._holds, strict=True):
            if hold.active and first < last:
                pairs = memory.pairs[first:last]
                forces = np.array(
                    [multipliers[p["first"] :][: p["rows"]] @ p["d"].reshape(3, 3)[: p["rows"]] for p in pairs]
                )
                moment = np.cross(pairs["b"] - pairs["b"][0], forces).sum(axis=0)
                out[label] = Wrench(forces.sum(axis=0), moment, np.array(pairs["b"][0]))
        return out

    def furthest(self) -> str:
        """The effect whose points are furthest apart."""
        pairs = self._simulator.memory.pairs
        gaps = np.linalg.norm(pairs["b"] - pairs["a"], axis=1)
        gaps = np.where(pairs["active"] > 0, np.abs(gaps - pairs["length"]), 0.0)
        far = int(np.argmax(gaps))
        return next(
            f"'{label}'" for label, (first, last) in zip(self.labels, self.spans, strict=True) if first <= far < last
        )


def _kinetic_energy(simulator: "Simulator", q: np.ndarray, v: np.ndarray) -> float:
    return float(0.5 * v @ simulator.mass_matrix(q) @ v)
