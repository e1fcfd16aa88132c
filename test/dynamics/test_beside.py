"""Derivatives compiled in another process are found, are the same, and are not asked for in vain."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from physics_prior.dynamics import beside
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.gravity import Gravity

LINEARISE = """
import json, sys
import numpy as np
from numba.core import event
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.gravity import Gravity
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.effect_probe import Compiled
from physics_prior.inertia import MassProperties

top = MassProperties(1.0, np.zeros(3), np.diag([1.0, 2.0, 3.0]))
tree = Tree([Part("top", top)], [Joint("flight", JointKind.FREE, "world", "top")])
simulator = Simulator(tree, [Gravity()])
if "path" in sys.argv:
    print(simulator.step.module.__file__)
else:
    compiled = Compiled()
    compiled.on_start = lambda event: compiled.modules.append(event.data["dispatcher"].py_func.__name__)
    with event.install_listener("numba:compile", compiled):
        F, G = simulator.linearise(tree.neutral(), np.arange(6.0), 1e-2, np.ones(6))
    print(json.dumps([compiled.modules, F.tolist(), G.tolist()]))
"""


@pytest.fixture
def run(tmp_path, monkeypatch):
    """`run(words) -> what it prints`: Python, with a cache of the test."""
    monkeypatch.setenv("PHYSICS_PRIOR_CACHE", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))

    def call(*words):
        ran = subprocess.run([sys.executable, *words], capture_output=True, text=True)
        assert ran.returncode == 0, ran.stderr
        return ran.stdout

    return call


def test_what_another_process_compiled_is_found_and_gives_the_same(run, free_top):
    path = run("-c", LINEARISE, "path").strip()
    run("-m", "physics_prior.dynamics.beside", path)
    names, F, G = json.loads(run("-c", LINEARISE))
    assert "carry" in names
    assert not {"differentiate", "sweep", "solve_mass", "spread_noise", "carry_factor", "triangularise"} & set(names)
    own_F, own_G = Simulator(free_top, [Gravity()]).linearise(free_top.neutral(), np.arange(6.0), 1e-2, np.ones(6))
    assert np.array_equal(F, own_F)
    assert np.array_equal(G, own_G)


@pytest.mark.parametrize(("cores", "kept", "asked"), [(2, False, 1), (1, False, 0), (2, True, 0)])
def test_another_process_is_asked_where_there_is_work_and_a_core_for_it(monkeypatch, free_top, cores, kept, asked):
    """And it is gone when the block ends."""
    step, started = Simulator(free_top, [Gravity()]).step, []
    begin = subprocess.Popen

    def wait(command, **settings):
        started.append(begin([sys.executable, "-c", "import signal; signal.pause()"], **settings))
        return started[-1]

    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    monkeypatch.setattr(beside, "is_kept", lambda kernel: kept)
    monkeypatch.setattr(subprocess, "Popen", wait)
    with beside.derivatives_beside(step):
        assert len(started) == asked
    assert all(process.poll() is not None for process in started)
