"""A scene's step holds the effects that it names and nothing else; an edit of an effect is never missed."""

import ast
import gc
import importlib.util
import sys

import numpy as np
import pytest
from numba.core import event
from numba.core.errors import TypingError

from physics_prior.dynamics.compose import GRAVITY, Structure, pack_parameters, step_module, step_source, structure_of
from physics_prior.dynamics.integrators import INTEGRATORS
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.kernel_cache import cache_directory
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.attachment import Attachment
from physics_prior.effects.gravity import Gravity
from physics_prior.effects.joint_damping import JointDamping
from physics_prior.studies.bench_models import humanlike

EFFECT = """
from typing import ClassVar

from physics_prior.dynamics.integrators import INTEGRATORS
from physics_prior.dynamics.kernel import kernel
from physics_prior.effects.effect import CompiledForce, Effect


@kernel
def {name}(parameters, links, work, q, v, tau):
    tau[0] += {push}


@kernel
def differentiate_{name}(parameters, links, work, freedoms, composites, q, v, tau_q, tau_v):
    pass


class Push(Effect):
    kind: ClassVar[str] = "{module}"
    compiled: ClassVar = CompiledForce({name}, differentiate_{name})
"""


@pytest.fixture
def own_effect(tmp_path):
    """`own_effect(module, push, name="push") -> effect`: a user's effect in a file of its own."""
    loaded = []

    def load(module, push, name="push"):
        path = tmp_path / f"{module}.py"
        path.write_text(EFFECT.format(module=module, push=push, name=name))
        spec = importlib.util.spec_from_file_location(module, path)
        sys.modules[module] = importlib.util.module_from_spec(spec)
        loaded.append(module)
        spec.loader.exec_module(sys.modules[module])
        return sys.modules[module].Push()

    yield load
    for module in loaded:
        sys.modules.pop(module, None)


def test_step_of_no_force_is_the_template(double_pendulum):
    """Gravity and constraints are no force functions; lines of the equation of motion but the two marked stand as they are."""
    plain = step_source([], Structure(), "rk4")
    assert plain == step_source([Gravity()], Structure(), "rk4")
    assert "none import differentiate_forces, forces" in plain
    assert "CONSTRAINED = False" in plain
    held = step_source([Gravity(), Attachment(part="lower")], Structure(constrained=True), "rk4")
    changed = [(a, b) for a, b in zip(plain.splitlines(), held.splitlines(), strict=True) if a != b]
    assert changed == [("CONSTRAINED = False", "CONSTRAINED = True")]


def test_a_step_of_few_errors_is_without_blocks_of_reflections(double_pendulum):
    few, many = (step_source([], structure_of(tree, []), "rk4") for tree in (double_pendulum, humanlike()))
    assert "blocks" not in few
    assert "import triangularise_in_blocks as triangularise" in many


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_step_is_motion_integrator_and_step_in_one_module(integrator):
    """Each names what it takes from those before it, and imports it from nowhere else."""
    text = step_source([], Structure(), integrator)
    imports = [node.module for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)]
    assert not any(module.endswith(".motion") or "integrators" in module for module in imports)
    functions = [node.name for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]
    order = [functions.index(name) for name in ("evaluate", "smooth_step", "linearise_smooth", "advance")]
    assert order == sorted(order)
    assert len(functions) == len(set(functions))


def test_step_names_its_effects_only():
    text = step_source([Gravity(), JointDamping(coefficients={"elbow": 1.0})], Structure(), "rk4")
    assert "apply_joint_damping(section(parameters, 0), links, work, q, v, tau)" in text
    assert "differentiate_joint_damping(section(parameters, 0), links, work, freedoms, composites, q, v," in text
    assert "effects.none" not in text
    assert text.count("physics_prior.effects") == 2
    assert not any(line.endswith((" scene: effects", " scene: constraints")) for line in text.splitlines())


def test_numbers_of_an_effect_stand_where_its_call_looks(double_pendulum):
    damping = [JointDamping(coefficients={"elbow": 2.0}), JointDamping(name="b", coefficients={"shoulder": 3.0})]
    numbers = pack_parameters(double_pendulum, [Gravity(), damping[0], Gravity(acceleration=(1, 0, 0)), damping[1]])
    assert np.allclose(numbers[:GRAVITY], [1.0, 0.0, -9.80665])
    starts = numbers[GRAVITY : GRAVITY + 3].astype(int)
    assert list(numbers[starts[0] : starts[1]]) == [0.0, 2.0]
    assert list(numbers[starts[1] : starts[2]]) == [3.0, 0.0]


def test_step_without_an_effect_is_bit_identical_to_one_where_it_does_nothing(double_pendulum):
    """And the module of the one does not know the other."""
    q, v = np.array([0.4, 0.8]), np.array([1.0, -2.0])
    a, b, c, d = q.copy(), v.copy(), q.copy(), v.copy()
    Simulator(double_pendulum, [Gravity()]).advance(a, b, 1e-3, 100)
    Simulator(double_pendulum, [Gravity(), JointDamping(coefficients={"elbow": 0.0})]).advance(c, d, 1e-3, 100)
    assert np.array_equal(a, c)
    assert np.array_equal(b, d)


def test_step_module_is_shared_by_scenes_of_the_same_effects(double_pendulum, heavy_top):
    modules = {Simulator(tree, [Gravity()]).step.module for tree in (double_pendulum, heavy_top)}
    assert len(modules) == 1
    assert len({step_module([], Structure(), integrator) for integrator in INTEGRATORS}) == len(INTEGRATORS)


def test_edited_effect_is_another_step(own_effect, double_pendulum):
    first = own_effect("bench_push", 1.0)
    before = step_source([first], Structure(), "rk4")
    edited = own_effect("bench_push", 2.0)
    assert step_source([edited], Structure(), "rk4") != before


def test_effects_of_one_function_name_keep_apart(own_effect, double_pendulum):
    """Two users' effects may both call their function push."""
    effects = [own_effect("push_one", 1.0), own_effect("push_ten", 10.0)]
    simulator = Simulator(double_pendulum, effects)
    simulator.acceleration(np.zeros(2), np.zeros(2))
    assert simulator.effort[0] == 11.0


def test_cache_is_keyed_by_the_kernels_sources(monkeypatch, tmp_path):
    """An edit of any kernel's source is another folder; so is another place."""
    monkeypatch.setenv("PHYSICS_PRIOR_CACHE", str(tmp_path))
    cache_directory.cache_clear()
    try:
        here = cache_directory()
        assert here.parent == tmp_path
        original = type(here).read_bytes
        monkeypatch.setattr(
            type(here),
            "read_bytes",
            lambda path: original(path) + (b"# edited" if path.name == "algebra.py" else b""),
        )
        cache_directory.cache_clear()
        assert cache_directory() != here
    finally:
        monkeypatch.undo()
        cache_directory.cache_clear()


def test_garbage_collector_rests_while_kernels_compile_and_works_again_after_failures(monkeypatch, tmp_path):
    """In an empty cache: what an earlier run left in the usual one would be loaded and not compiled."""
    monkeypatch.setattr("physics_prior.dynamics.kernel_cache.cache_directory", lambda: tmp_path)
    seen = []

    class Look(event.Listener):
        def on_start(self, event):
            seen.append(gc.isenabled())

        def on_end(self, event):
            pass

    with event.install_listener("numba:run_pass", Look()):
        assert kernel(lambda number: number + 1.0)(1.0) == 2.0
    assert seen
    assert not any(seen)
    assert gc.isenabled()
    with pytest.raises(TypingError):
        kernel(lambda number: number.none)(1.0)
    assert gc.isenabled()
