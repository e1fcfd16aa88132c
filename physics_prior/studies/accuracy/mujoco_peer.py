"""MuJoCo on our benchmarks: its steps in C, held points as its ``connect``, at their stiffest that works on all."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from physics_prior.dynamics.compose import GRAVITY, pack_parameters
from physics_prior.effects.attachment import Attachment
from physics_prior.effects.effect import Anchor
from physics_prior.errors import SimulationError
from physics_prior.inertia import MassProperties
from physics_prior.model import Part, Tree
from physics_prior.studies.accuracy.trajectory import Setting, Trajectory, run_timed
from physics_prior.studies.bench_models import mjcf
from physics_prior.studies.problems.mechanism import Benchmark

THIN = 1e-10  # m^2: the least moment over mass that MuJoCo is given, which refuses rods and points without any
IMPEDANCE = 0.9999  # its default, 0.95, opens the four-bar's loop so far that errors are 40 times as large
INTEGRATORS = {"Euler": "mjINT_EULER", "implicitfast": "mjINT_IMPLICITFAST", "RK4": "mjINT_RK4"}


@dataclass
class MuJoCo:
    """MuJoCo with one of its integrators."""

    integrator: str
    settings: Sequence[Setting]
    engine: str = "mujoco"

    @property
    def name(self) -> str:
        """As ``Scheme`` says."""
        return f"MuJoCo {self.integrator}"

    def trajectory(self, benchmark: Benchmark, setting: Setting) -> Trajectory:
        """As ``Scheme`` says."""
        import mujoco

        mujoco.set_mju_user_warning(lambda message: None)  # told by what it counts, not in a file of the working folder
        bad = mujoco.mjtWarning
        model = _model(benchmark)
        model.opt.integrator = getattr(mujoco.mjtIntegrator, INTEGRATORS[self.integrator])
        model.eq_solref[:], model.eq_solimp[:, :2] = (2.0 * setting.h, 1.0), IMPEDANCE
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = benchmark.q, benchmark.v

        def advance(h: float, count: int) -> None:
            model.opt.timestep = h
            mujoco.mj_step(model, data, count)
            if any(data.warning[each].number for each in (bad.mjWARN_BADQPOS, bad.mjWARN_BADQVEL, bad.mjWARN_BADQACC)):
                raise SimulationError(f"{self.name} lost the motion at steps of {h:g} s")

        return run_timed(benchmark, setting, advance, lambda: (data.qpos, data.qvel))


def _model(benchmark: Benchmark) -> Any:
    """The benchmark as MuJoCo's model; its points on other parts are put in afterwards."""
    import mujoco

    tree = _with_thickness(benchmark.tree)
    held = [effect for effect in benchmark.effects if isinstance(effect, Attachment)]
    anchors = [Anchor(each.part, np.array(each.point)) for each in held]
    gravity = pack_parameters(tree, benchmark.effects)[:GRAVITY]
    model = mujoco.MjModel.from_xml_string(mjcf(tree, gravity, 1e-3, anchors))
    for row, (each, anchor) in enumerate(zip(held, anchors, strict=True)):
        link, at, _ = Anchor(each.to, np.array(each.at)).on_link(tree)
        model.eq_obj2id[row] = link + 1
        model.eq_data[row, :3], model.eq_data[row, 3:6] = anchor.on_link(tree)[1], at
    return model


def _with_thickness(tree: Tree) -> Tree:
    """The tree with moments of inertia that MuJoCo takes."""
    parts = []
    for part in tree.parts:
        own = part.mass_properties
        least = THIN * own.mass * np.eye(3)
        parts.append(Part(part.name, MassProperties(own.mass, own.center_of_mass, own.inertia + least)))
    return Tree(parts, tree.joints)
