"""Steps that follow a stiff scene are told from those that do not, and a motion that diverges by itself is no reason."""

from dataclasses import replace

import numpy as np
import pytest

from physics_prior.effects.joint_damping import JointDamping
from physics_prior.scene import Step, load_scene
from physics_prior.stepping import stable


@pytest.fixture
def honey():
    """`honey(rate, angle, integrator) -> scene`: a pendulum whose speed decays at that rate, 1/s."""

    def scene(rate, angle=0.0, integrator="rk4"):
        pendulum = load_scene("pendulum")
        damping = JointDamping(coefficients={"pivot": rate / 3.0})  # the inertia about the pivot is 1/3 kg m^2
        return replace(
            pendulum,
            effects=(*pendulum.effects, damping),
            initial=replace(pendulum.initial, q=np.array([angle]), v=np.zeros(1)),
            step=Step(integrator=integrator, size=0.01),
        )

    return scene


@pytest.mark.parametrize(
    ("rate", "integrator", "follows"),
    [
        (270.0, "rk4", True),  # rk4 is stable up to 2.785 by the step's inverse (Hairer and Wanner 1996, IV.2)
        (290.0, "rk4", False),
        (1e5, "rk4", False),
        (1e5, "lobatto_iiic", True),
        (1e50, "rk4", False),
    ],
)
def test_a_step_follows_up_to_the_end_of_its_integrators_stability(honey, rate, integrator, follows):
    scene = honey(rate, integrator=integrator)
    assert stable(scene.simulator(), scene.initial.q, scene.initial.v, scene.step.size) is follows


def test_a_motion_that_falls_over_is_followed_all_the_same(honey):
    scene = honey(0.0, angle=np.pi)
    simulator = scene.simulator()
    assert stable(simulator, scene.initial.q, scene.initial.v, 0.2)  # errors grow by 2.1 in it
    assert simulator.time == 0.0
    np.testing.assert_array_equal(scene.initial.v, 0.0)


@pytest.mark.parametrize(("size", "follows"), [(0.005, True), (0.01, False)])
def test_muscles_of_light_limbs_are_stiff(size, follows):
    scene = load_scene("simulated_walk")
    assert stable(scene.simulator(), scene.initial.q, scene.initial.v, size) is follows
