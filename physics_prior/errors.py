"""Every error this program raises on purpose, under one root."""


class PhysicsPriorError(Exception):
    """Root of all errors raised by physics_prior: one sentence naming the culprit and what would be valid."""


class ModelError(PhysicsPriorError):
    """A part, joint or tree that cannot be a physical body: invalid inertia, wrong order, unknown name."""


class SceneError(PhysicsPriorError):
    """A scene file, effect, readout or parameter that is not valid; names file, line and field."""


class RecordingError(PhysicsPriorError):
    """A recording that cannot be read or written; names file, offset where known, and a hint."""


class MeasurementError(PhysicsPriorError):
    """A measurement that cannot be used: not finite, zero quaternion, wrong frame, wrong shape."""


class SimulationError(PhysicsPriorError):
    """The motion cannot be computed: constraints that cannot be met, a singular mass, a state not finite."""
