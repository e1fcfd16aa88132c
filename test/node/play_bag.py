"""Child of test_node_process.py: publish a bag's messages, `play_bag.py BAG SECONDS STEP TOPIC...`, raw and in their order.

With STEP "each", a message goes out when the node has said that it has read the one before; with "all", all go at once.
"""

import sys
from importlib import import_module

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile

from physics_prior.recording import open_bag

bag, seconds, step, topics = sys.argv[1], float(sys.argv[2]), sys.argv[3], sys.argv[4:]
records = list(open_bag(bag).read(topics))
records = [record for record in records if record.log_time_ns - records[0].log_time_ns <= seconds * 1e9]

rclpy.init()
node = rclpy.create_node("player")
read = 0


def note(array: DiagnosticArray) -> None:
    global read
    values = {value.key: value.value for value in array.status[0].values}
    read = int(values["measurements read"])


node.create_subscription(DiagnosticArray, "/diagnostics", note, QoSProfile(depth=10))
publishers = {}
for record in records:
    if record.topic not in publishers:
        package, _, name = record.message_type.split("/")
        message_class = getattr(import_module(f"{package}.msg"), name)
        publishers[record.topic] = node.create_publisher(message_class, record.topic, QoSProfile(depth=1000))
while any(publisher.get_subscription_count() == 0 for publisher in publishers.values()):
    rclpy.spin_once(node, timeout_sec=0.05)
for count, record in enumerate(records):
    while step == "each" and read < count:
        rclpy.spin_once(node, timeout_sec=0.1)
    publishers[record.topic].publish(record.data)
while read < len(records):
    rclpy.spin_once(node, timeout_sec=0.1)
node.destroy_node()
rclpy.shutdown()
