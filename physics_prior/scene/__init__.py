"""Model, effects, measurements, noise and readouts of one scene, read from one file."""

from physics_prior.scene.loader import build_scene, load_scene
from physics_prior.scene.marker_sets import MarkerSet, NominalMarker, load_marker_set
from physics_prior.scene.measurements import (
    JointSource,
    Marker,
    MeasurementSource,
    OrientationSource,
    PointsSource,
    PoseSource,
    SwitchSource,
)
from physics_prior.scene.readouts import (
    AngleReadout,
    EnergyReadout,
    ForceReadout,
    JointReadout,
    PointReadout,
    Readout,
)
from physics_prior.scene.scene import Initial, Noise, Scene
from physics_prior.scene.schema import Accuracy, Gate, Health, Pose, Simulation, Step

__all__ = [
    "Accuracy",
    "AngleReadout",
    "EnergyReadout",
    "ForceReadout",
    "Gate",
    "Health",
    "Initial",
    "JointReadout",
    "JointSource",
    "Marker",
    "MarkerSet",
    "MeasurementSource",
    "Noise",
    "NominalMarker",
    "OrientationSource",
    "PointReadout",
    "PointsSource",
    "Pose",
    "PoseSource",
    "Readout",
    "Scene",
    "Simulation",
    "Step",
    "SwitchSource",
    "build_scene",
    "load_marker_set",
    "load_scene",
]
