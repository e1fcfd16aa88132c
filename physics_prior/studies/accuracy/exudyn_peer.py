"""Exudyn on planar benchmarks: bodies in redundant coordinates, hinges as constraints, generalized-alpha at rho 0.9."""

from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from physics_prior.dynamics.compose import GRAVITY, pack_parameters
from physics_prior.dynamics.formulations.kinematics import kinematics
from physics_prior.effects.attachment import Attachment
from physics_prior.effects.effect import Anchor
from physics_prior.errors import SimulationError
from physics_prior.studies.accuracy.trajectory import LONGEST, Setting, Trajectory
from physics_prior.studies.problems.mechanism import Benchmark

MOST_BODIES = 10  # more take it minutes
RHO = 0.9


@dataclass
class Exudyn:
    """Exudyn's generalized-alpha solver."""

    settings: Sequence[Setting]
    engine: str = "exudyn"
    name: str = "Exudyn generalized-alpha"

    def trajectory(self, benchmark: Benchmark, setting: Setting) -> Trajectory:
        """As ``Scheme`` says; solved in one go, the states told by sensors."""
        import exudyn

        container = exudyn.SystemContainer()
        system = container.AddSystem()
        sensors = _build(system, benchmark)
        system.Assemble()
        end, every = float(benchmark.times[-1]), float(benchmark.times[0])
        settings = exudyn.SimulationSettings()
        own = settings.timeIntegration
        own.startTime, own.endTime, own.numberOfSteps = 0.0, end, round(end / setting.h)
        own.generalizedAlpha.spectralRadius = RHO
        own.newton.useModifiedNewton = True
        own.verboseMode = 0
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = every
        begin = process_time()
        if not _solve(system, settings):
            raise SimulationError(f"{self.name} lost the motion at steps of {setting.h:g} s")
        seconds = process_time() - begin
        stored = [np.asarray(system.GetSensorStoredData(sensor)) for sensor in sensors]
        return Trajectory(seconds, _angles(benchmark, stored) if seconds <= LONGEST else None, None)


def _solve(system: Any, settings: Any) -> bool:
    """Whether Exudyn's solver came to the end."""
    import exudyn

    try:
        return bool(system.SolveDynamic(settings, solverType=exudyn.DynamicSolverType.GeneralizedAlpha))
    except ValueError:  # what it raises where Newton's method fails
        return False


def _build(system: Any, benchmark: Benchmark) -> list[Any]:
    """Bodies, hinges and held points of the benchmark; sensors of angles and of rates of all bodies."""
    import exudyn.itemInterface

    items: Any = exudyn.itemInterface
    tree = benchmark.tree
    gravity = pack_parameters(tree, benchmark.effects)[:GRAVITY]
    where = kinematics(tree, benchmark.q, benchmark.v)
    ground = system.AddObject(items.ObjectGround())
    bodies, sensors = [], []
    for i, link in enumerate(tree.links):
        body, angle = link.mass_properties, _angle(where.orientation[i])
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        lever, spin = turn @ body.center_of_mass[:2], where.angular_velocity[i, 2]
        center = where.position[i, :2] + lever
        speed = where.velocity[i, :2] + spin * np.array([-lever[1], lever[0]])
        node = system.AddNode(
            items.NodeRigidBody2D(initialCoordinates=[*center, angle], initialVelocities=[*speed, spin])
        )
        bodies.append(
            system.AddObject(
                items.ObjectRigidBody2D(mass=body.mass, inertia=float(body.inertia[2, 2]), nodeNumber=node)
            )
        )
        marker = system.AddMarker(items.MarkerBodyMass(bodyNumber=bodies[-1]))
        system.AddLoad(items.LoadMassProportional(markerNumber=marker, loadVector=gravity.tolist()))
        sensors.append(
            system.AddSensor(
                items.SensorNode(
                    nodeNumber=node, storeInternal=True, outputVariableType=exudyn.OutputVariableType.Coordinates
                )
            )
        )

    def hinge(a: int, point_a: np.ndarray, b: int, point_b: np.ndarray) -> None:
        markers = []
        for link, point in ((a, point_a), (b, point_b)):
            local = point - (tree.links[link].mass_properties.center_of_mass if link >= 0 else 0.0)
            markers.append(
                system.AddMarker(
                    items.MarkerBodyPosition(
                        bodyNumber=bodies[link] if link >= 0 else ground, localPosition=local.tolist()
                    )
                )
            )
        system.AddObject(items.ObjectJointRevolute2D(markerNumbers=markers))

    for i, link in enumerate(tree.links):
        hinge(link.parent, link.joint.position, i, np.zeros(3))
    for effect in benchmark.effects:
        if isinstance(effect, Attachment):
            (a, at, _), (b, point, _) = (
                Anchor(effect.to, np.array(effect.at)).on_link(tree),
                Anchor(effect.part, np.array(effect.point)).on_link(tree),
            )
            hinge(a, at, b, point)
    return sensors


def _angles(benchmark: Benchmark, stored: Sequence[np.ndarray]) -> np.ndarray:
    """Joint angles (k, nq) at the benchmark's times, from the angles of the bodies."""
    links = benchmark.tree.links
    rows = [int(np.argmin(np.abs(stored[0][:, 0] - time))) for time in benchmark.times]
    absolute = np.stack([data[rows, 3] for data in stored], axis=1)
    carried = [absolute[:, i] - (absolute[:, link.parent] if link.parent >= 0 else 0.0) for i, link in enumerate(links)]
    return np.stack(carried, axis=1)


def _angle(quaternion: np.ndarray) -> float:
    """The turn about z, rad."""
    return float(2.0 * np.arctan2(quaternion[3], quaternion[0]))
