"""Who takes part in a problem, and at which settings."""

from importlib.util import find_spec

from physics_prior.dynamics.integrators import INTEGRATORS
from physics_prior.errors import PhysicsPriorError
from physics_prior.studies.accuracy.compiled import Compiled
from physics_prior.studies.accuracy.problem import Problem, in_plane, only_hinges, only_pinned
from physics_prior.studies.accuracy.textbook import FORMULATIONS, STEPS, Textbook
from physics_prior.studies.accuracy.trajectory import Scheme, Setting

FAMILIES = ("compiled", "textbook")
LOOSE = (
    1e-2  # error that an integrator of its own steps may make in each: it keeps to the steps given, where they resolve
)
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
PEERS = {"mujoco": "mujoco", "pinocchio": "pin", "exudyn": "exudyn"}
"""Module -> the package that has it."""


def own_schemes(problem: Problem) -> list[Scheme]:
    """Ours: the kernels with every integrator, and the textbook with the explicit ones."""
    fixed = [Setting(h) for h in problem.steps]
    out: list[Scheme] = []
    for name, integrator in INTEGRATORS.items():
        if integrator.adaptive:
            out.append(Compiled(name, [Setting(h, LOOSE) for h in problem.steps], name))
            own = [Setting(problem.steps[0], tolerance) for tolerance in TOLERANCES]
            out.append(Compiled(name, own, f"{name}, its own steps"))
        else:
            out.append(Compiled(name, fixed, name))
    out += [Textbook(formulation, step, fixed) for formulation in FORMULATIONS for step in STEPS]
    return out


def peer_schemes(problem: Problem) -> list[Scheme]:
    """Those engines that can be given the problem as it is: gravity, joints, and points that are held.

    Raises:
        PhysicsPriorError: one of them is not installed.
    """
    missing = [package for module, package in PEERS.items() if find_spec(module) is None]
    if missing:
        raise PhysicsPriorError(
            f"--peers needs {', '.join(missing)}, not installed here: pip install {' '.join(missing)}"
        )
    from physics_prior.studies.accuracy import exudyn_peer, mujoco_peer, pinocchio_peer

    benchmark = problem.make()
    if not only_pinned(benchmark) or benchmark.tau is not None:
        return []
    settings = [Setting(h) for h in problem.steps]
    out: list[Scheme] = [mujoco_peer.MuJoCo(name, settings) for name in mujoco_peer.INTEGRATORS]
    if only_hinges(benchmark):
        out.append(pinocchio_peer.Pinocchio(settings))
    if in_plane(benchmark) and len(benchmark.tree.links) <= exudyn_peer.MOST_BODIES:
        out.append(exudyn_peer.Exudyn(settings))
    return out
