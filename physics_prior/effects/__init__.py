"""What acts on the body. One effect a file; a scene pays only for the effects it names."""

from physics_prior.effects.attachment import Attachment, Hinge, Rod, Weld
from physics_prior.effects.contact import Contact
from physics_prior.effects.drag import Drag
from physics_prior.effects.effect import Anchor, CompiledForce, Effect, PointNoise, PointPair
from physics_prior.effects.gravity import Gravity
from physics_prior.effects.ground_reaction import GroundReaction
from physics_prior.effects.joint_damping import JointDamping
from physics_prior.effects.joint_limit import JointLimit
from physics_prior.effects.joint_spring import JointSpring
from physics_prior.effects.muscle import Muscle
from physics_prior.effects.soft_limit import SoftLimit
from physics_prior.effects.spring import Spring

_EFFECTS = (
    Gravity,
    JointDamping,
    JointSpring,
    Spring,
    Drag,
    SoftLimit,
    JointLimit,
    Contact,
    Attachment,
    Rod,
    Hinge,
    Weld,
    Muscle,
    GroundReaction,
)
REGISTRY: dict[str, type[Effect]] = {effect.kind: effect for effect in _EFFECTS}
"""Every built-in effect, by its key in the scene file; users' packages add their own (plug_ins.py)."""

__all__ = ["REGISTRY", "Anchor", "CompiledForce", "Effect", "PointNoise", "PointPair"]
