"""What the body is: parts, joints and the tree they form."""

from physics_prior.model.joint import Joint, JointKind
from physics_prior.model.part import Part, Shape
from physics_prior.model.tree import Frame, Link, Tree

__all__ = ["Frame", "Joint", "JointKind", "Link", "Part", "Shape", "Tree"]
