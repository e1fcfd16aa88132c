"""The node's subscriptions to a scene's measurement topics: raw bytes in, as their publishers offer them."""

import time
from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from physics_prior.scene import MeasurementSource

# A measurement that is lost is information lost for good, so messages are asked for again and may wait: at 1 kHz, for a
# tenth of a second of anything else that the machine does. What does not fit is counted.
QUEUE = 100

Receive = Callable[[MeasurementSource, str, bytes], None]


def ros_class(type_name: str) -> Any:
    """Return the rclpy class of a ROS type name, ``pkg/msg/Type``."""
    package, _, name = type_name.split("/")
    return getattr(import_module(f"{package}.msg"), name)


class Input:
    """One measurement topic.

    It is subscribed to with the type and the reliability that its publishers offer, because a DDS topic has one type in a
    process, and a reliable reader gets nothing from a best-effort writer.

    Attributes:
        source: the scene's measurement.
        lost: messages that a publisher sent and we never saw, by the gaps in its numbering.
        longest_wait: s between arrival and being taken in, since ``forget_wait``.
        problem: one sentence where nothing can be read because publishers are of no valid type, else empty.
    """

    def __init__(self, node: Node, source: MeasurementSource, receive: Receive) -> None:
        self.source = source
        self.lost, self.longest_wait, self.problem = 0, 0.0, ""
        self._node, self._receive = node, receive
        self._offer = (source.message_types[0], True)
        self._last_number = 0
        self._subscription = self._subscribe()

    @property
    def topic_name(self) -> str:
        """The topic's full name, remapped."""
        return str(self._subscription.topic_name)

    def follow(self) -> None:
        """Subscribe anew where publishers offer something else than what is subscribed to, and it is valid."""
        found = self._node.get_publishers_info_by_topic(self.topic_name)
        best_effort = ReliabilityPolicy.BEST_EFFORT
        offers = [(each.topic_type, each.qos_profile.reliability is not best_effort) for each in found]
        valid = [offer for offer in offers if offer[0] in self.source.message_types]
        self.problem = ""
        if offers and not valid:
            types = " or ".join(self.source.message_types)
            self.problem = f"topic '{self.topic_name}' holds {offers[0][0]}: valid is {types}"
        if valid and self._offer not in valid:
            self.close()
            self._offer = valid[0]
            self._subscription = self._subscribe()

    def forget_wait(self) -> None:
        """Begin to look for the longest wait anew."""
        self.longest_wait = 0.0

    def close(self) -> None:
        """End the subscription."""
        self._node.destroy_subscription(self._subscription)

    def _subscribe(self) -> Subscription:
        type_name, reliable = self._offer
        reliability = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
        self._last_number = 0
        return self._node.create_subscription(
            ros_class(type_name),
            self.source.topic,
            partial(self._take, type_name),
            QoSProfile(depth=QUEUE, reliability=reliability),
            raw=True,
        )

    def _take(self, type_name: str, data: bytes, information: dict[str, Any]) -> None:
        self.longest_wait = max(self.longest_wait, 1e-9 * (time.time_ns() - information["received_timestamp"]))
        number = information["publication_sequence_number"] or 0
        # several publishers number their messages each for itself: their gaps mean nothing
        if 0 < self._last_number < number - 1 and self._node.count_publishers(self.topic_name) == 1:
            self.lost += number - self._last_number - 1
        self._last_number = number
        self._receive(self.source, type_name, data)
