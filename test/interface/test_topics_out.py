"""Topics out: what each scene publishes, and names that are valid in ROS whatever things are called in the scene."""

import re
from dataclasses import replace

import pytest

from physics_prior.dynamics.simulator import Simulator
from physics_prior.interface import Output, topics_of
from physics_prior.interface.topics import force_topics
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.model.part import MassProperties
from physics_prior.resources import share_directory, shipped_scenes
from physics_prior.scene import load_scene


def test_a_scene_has_no_topic_for_what_it_has_not():
    pendulum, free, four_bar = (set(topics_of(load_scene(name))) for name in ("pendulum", "free_body", "four_bar"))
    always = {"center_of_mass", "energy", "state_covariance", "markers", "/diagnostics"}
    assert free == always | {"multi_dof_joint_states", "odometry", "/tf"}
    (force,) = (topic for topic in pendulum if topic.startswith("constraint_forces/") and not topic.endswith("stddev"))
    assert pendulum == always | {"joint_states", "joint_states/stddev", force, f"{force}/stddev"}
    assert {"constraint_forces/ground_pin", "constraint_forces/ground_pin/stddev"} <= four_bar


@pytest.mark.parametrize("name", [*shipped_scenes(), None])
def test_just_the_announced_topics_are_published_with_their_types(name, every_joint, estimate_of):
    scene = every_joint if name is None else load_scene(name)
    simulator = Simulator(scene.tree, scene.effects, scene.step.integrator)
    estimate, output = estimate_of(simulator), Output(scene, simulator)
    out = output.states(estimate) + output.markers(estimate)
    out += output.diagnostics(estimate.stamp, estimate.health, estimate.counts, estimate)
    assert [topic for topic, _ in out] == list(output.topics) == list(topics_of(scene))
    for topic, message in out:
        assert type(message) is output.topics[topic]


def test_nobody_listens_to_himself(tmp_path):
    """The node of a person who is seen by markers on /markers could not start: it published pictures there."""
    assert {"/markers"} == {source.topic for source in load_scene("simulated_walk").measurements}
    topics = topics_of(load_scene("simulated_walk"))
    assert topics["estimated_markers"].ros_type == "visualization_msgs/msg/MarkerArray"
    assert "markers" not in topics
    text = (share_directory() / "config" / "scenes" / "pendulum.yaml").read_text()
    path = tmp_path / "encoder.yaml"
    path.write_text(
        text.replace(
            "measurements:", "measurements:\n  - joints: {topic: joint_states, joints: {pivot: pivot}, noise: 1e-3}", 1
        )
    )
    assert {"estimated_joint_states", "joint_states/stddev", "markers"} < set(topics_of(load_scene(path)))


def test_names_are_made_valid_and_stay_different(every_joint):
    names = ["knee.l", "knee-l", "knee l", "1st", "_hidden", "knöchel", "", "x" * 300, "x" * 299, "knee_l_2"]
    parts = [
        Part(f"p{index}", MassProperties(1.0, [0.1, 0, 0], [[1, 0, 0], [0, 1, 0], [0, 0, 1]]))
        for index in range(len(names))
    ]
    joints = [Joint(name, JointKind.REVOLUTE, "world", part.name) for name, part in zip(names, parts, strict=True)]
    topics = force_topics(replace(every_joint, tree=Tree(parts, joints), effects=()))
    assert list(topics) == names
    assert len(set(topics.values())) == len(names)
    for topic in topics.values():
        assert re.fullmatch(r"constraint_forces/[A-Za-z][A-Za-z0-9_]*", topic)
        assert len(topic) < 120
    assert topics["knee.l"] == "constraint_forces/knee_l"
