"""The ROS interface as data: messages to measurements and estimates to messages, the same for the node and the replay.

Nothing here needs ROS: messages are those of `recording.messages`.
"""

from physics_prior.interface.intake import measurement_of, take_in
from physics_prior.interface.output import Output
from physics_prior.interface.topics import topics_of

__all__ = ["Output", "measurement_of", "take_in", "topics_of"]
