"""Pinocchio on our benchmarks: RK4 in Python over its kernels, loops with Baumgarte's stabilisation at 10 1/s."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from physics_prior.dynamics.compose import GRAVITY, pack_parameters
from physics_prior.effects.attachment import Attachment
from physics_prior.effects.effect import Anchor
from physics_prior.errors import SimulationError
from physics_prior.model import Tree
from physics_prior.studies.accuracy.trajectory import Setting, Trajectory, run_timed
from physics_prior.studies.bench_models import PinocchioModel
from physics_prior.studies.problems.mechanism import Benchmark

BAUMGARTE = 10.0  # 1/s: critically damped
LOST = 1e6  # rad or rad/s, beyond which the motion is lost


@dataclass
class Pinocchio:
    """Pinocchio's forward dynamics, integrated by RK4."""

    settings: Sequence[Setting]
    engine: str = "pinocchio"
    name: str = "Pinocchio RK4"

    def trajectory(self, benchmark: Benchmark, setting: Setting) -> Trajectory:
        """As ``Scheme`` says."""
        import pinocchio

        own = PinocchioModel(benchmark.tree, pack_parameters(benchmark.tree, benchmark.effects)[:GRAVITY])
        model, data, tau = own.model, own.data, np.zeros(benchmark.tree.nv)
        held = [effect for effect in benchmark.effects if isinstance(effect, Attachment)]
        if held:
            contacts, contact_data = _constraints(pinocchio, model, benchmark.tree, held)
            pinocchio.initConstraintDynamics(model, data, contacts, contact_data)
            proximal = pinocchio.ProximalSettings(1e-12, 1e-12, 10)

        def acceleration(q: np.ndarray, v: np.ndarray) -> Any:
            if held:
                return pinocchio.constraintDynamics(model, data, q, v, tau, contacts, contact_data, proximal)
            return pinocchio.aba(model, data, q, v, tau)

        q, v = benchmark.q.copy(), benchmark.v.copy()

        def advance(h: float, count: int) -> None:
            nonlocal q, v
            half = 0.5 * h
            for _ in range(count):
                a1 = acceleration(q, v).copy()
                v2 = v + half * a1
                a2 = acceleration(q + half * v, v2).copy()
                v3 = v + half * a2
                a3 = acceleration(q + half * v2, v3).copy()
                v4 = v + h * a3
                a4 = acceleration(q + h * v3, v4)
                q = q + h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
                v = v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
            if not np.max(np.abs(np.concatenate([q, v]))) < LOST:
                raise SimulationError(f"{self.name} lost the motion at steps of {h:g} s")

        return run_timed(benchmark, setting, advance, lambda: (q, v))


def _constraints(pinocchio: Any, model: Any, tree: Tree, held: Sequence[Attachment]) -> tuple[Any, Any]:
    """Pinocchio's own constraints of what is held; a link's joint there is its index here and one."""
    models, data = pinocchio.StdVec_RigidConstraintModel(), pinocchio.StdVec_RigidConstraintData()
    for each in held:
        places = []
        for anchor in (Anchor(each.part, np.array(each.point)), Anchor(each.to, np.array(each.at))):
            link, point, _ = anchor.on_link(tree)
            places += [link + 1, pinocchio.SE3(np.eye(3), point)]
        models.append(
            pinocchio.RigidConstraintModel(
                pinocchio.ContactType.CONTACT_3D, model, *places, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
        )
        last = models[len(models) - 1]
        last.setBaumgarteCorrectorParameters(pinocchio.BaumgarteCorrectorParameters(BAUMGARTE**2, 2.0 * BAUMGARTE))
        data.append(last.createData())
    return models, data
