"""A user's effect in a package of its own: the very text of docs/effects.md, found through its entry point."""

import importlib
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import physics_prior
from physics_prior.dynamics.compose import Structure, step_source
from physics_prior.errors import ModelError, SceneError
from physics_prior.estimation.process import PhysicsProcess
from physics_prior.recording.simulate import motion
from physics_prior.scene import load_scene

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "effects.md").read_text(encoding="utf-8")
CODE, CHECK = re.findall(r"^```py\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE)
(SCENE,) = re.findall(r"^```yaml\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE)
(TABLE,) = re.findall(r"^```toml\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE)
PACKAGE = Path(physics_prior.__file__).parent
GROUP, OFFER = TABLE.replace('"', "").splitlines()


@pytest.fixture
def install(tmp_path, monkeypatch):
    """`install(code, offer) -> path of the scene`, as pip would: the package and its metadata on the path."""

    def put(code, offer=OFFER):
        for name in [name for name in sys.modules if name.split(".")[0] == "kites"]:
            del sys.modules[name]
        files = {
            "kites/__init__.py": "",
            "kites/wind.py": code,
            "kites-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: kites\nVersion: 1.0\n",
            "kites-1.0.dist-info/entry_points.txt": f"[physics_prior.effects]\n{offer}\n",
            "kite.yaml": SCENE,
        }
        for name, text in files.items():
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).write_text(text)
        importlib.invalidate_caches()
        return tmp_path / "kite.yaml"

    monkeypatch.syspath_prepend(tmp_path)
    yield put
    for name in [name for name in sys.modules if name.split(".")[0] == "kites"]:
        del sys.modules[name]


def test_example_is_short_and_offers_itself_under_the_group():
    assert len([line for line in CODE.splitlines() if line]) < 40
    assert GROUP == "[project.entry-points.physics_prior.effects]"


def test_example_of_the_documentation_blows_is_right_and_an_edit_is_noticed(install, monkeypatch, capsys):
    path = install(CODE)
    monkeypatch.chdir(path.parent)
    exec(compile(CHECK, "docs/effects.md", "exec"), {})
    assert float(capsys.readouterr().out) < 1e-7  # measured 2e-9
    scene = load_scene("kite.yaml")
    simulator = scene.simulator()
    q, v = scene.initial.q, scene.initial.v
    simulator.acceleration(q, v)
    wind = np.array([6.0, 0.0, 2.0])
    force = 0.05 * np.linalg.norm(wind) * wind + scene.tree.mass * np.array([0.0, 0.0, -9.80665])
    line = q[:3] / np.linalg.norm(q[:3])
    assert np.allclose(
        simulator.acceleration(q, v)[:3], (force - (force @ line) * line) / scene.tree.mass, rtol=0.0, atol=1e-9
    )
    before = step_source(scene.effects, Structure(constrained=True), "rk4")
    edited = load_scene(install(CODE.replace("c = wind_at", "c  = wind_at")))
    after = step_source(edited.effects, Structure(constrained=True), "rk4")
    assert after != before
    (path.parent / "kites" / "air.py").write_text("DENSITY = 1.2")  # which its kernels may use
    assert step_source(edited.effects, Structure(constrained=True), "rk4") not in (before, after)


def test_noise_of_an_effect_grows_the_covariance_as_its_force_would(install):
    """White force s along each axis on the mass m, across the line l: the velocity's variance grows by s^2/m^2 a second."""
    path = install(CODE)
    path.write_text(SCENE.replace("force: 1e-3", "force: 0"))
    scene = load_scene(path)
    process = PhysicsProcess(scene, scene.simulator())
    state, h = process.start(scene.initial.q.copy(), scene.initial.v.copy()), 1e-3
    _, G = process.advance(state, h)
    line, expected = state.q[:3] / np.linalg.norm(state.q[:3]), np.zeros((6, 6))
    expected[:3, :3] = 0.1**2 / scene.tree.mass**2 * h * (np.eye(3) - np.outer(line, line))
    off = np.abs((G @ G.T)[6:, 6:] - expected).max() / expected.max()
    assert off < 1e-6  # measured 3e-7: the line turns within the step


def test_simulations_blow_as_hard_as_the_estimator_reckons(install):
    path = install(CODE)
    path.write_text(SCENE.replace("force: 1e-3", "force: 0"))
    scene = load_scene(path)
    simulator, across, seconds = scene.simulator(), np.array([0.0, 1.0, 0.0]), 0.02
    ends = [list(motion(scene, simulator, seed=seed, duration=seconds))[-1].v[:3] @ across for seed in range(400)]
    assert np.std(ends) == pytest.approx(0.1 / scene.tree.mass * np.sqrt(seconds), rel=0.1)  # measured 1.034


@pytest.mark.parametrize(
    ("code", "offer", "message"),
    [
        (
            CODE,
            "kite_wind = kites.storm:KiteWind",
            "cannot be loaded: ModuleNotFoundError: No module named 'kites.storm'",
        ),
        ("1/0", "kite_wind = kites.wind:KiteWind", "of kites.* cannot be loaded: ZeroDivisionError"),
        ("KiteWind = 3", "kite_wind = kites.wind:KiteWind", "is no class derived from"),
        (CODE.replace('"kite_wind"', '"wind"'), "kite_wind = kites.wind:KiteWind", "has the kind 'wind'"),
        (CODE.replace("explain", "tell"), "kite_wind = kites.wind:KiteWind", "does not explain itself"),
        (CODE.replace("q, v, tau):", "tau):"), "kite_wind = kites.wind:KiteWind", "'apply' .* the 6 arguments"),
        (
            CODE.replace("@kernel\ndef apply", "def apply"),
            "kite_wind = kites.wind:KiteWind",
            "'apply' that is no kernel",
        ),
        (CODE, "gravity = kites.wind:KiteWind", "has the name of a built-in effect"),
    ],
)
def test_broken_effects_are_one_sentence_at_the_line_of_the_scene(install, code, offer, message):
    with pytest.raises(SceneError, match=rf"kite.yaml:\d+: effects\[\d\].*{message}") as caught:
        load_scene(install(code, offer))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("    push(work", "    pull(work", "its 'apply' .*does not compile: .*'pull'"),
        ("dot(u, u), 1e-9", "dot(u, 3), 1e-9", "its 'differentiate' .*does not compile: "),
    ],
)
def test_kernels_that_do_not_compile_are_one_sentence(install, right, wrong, message):
    assert right in CODE
    scene = load_scene(install(CODE.replace(right, wrong)))
    with pytest.raises(ModelError, match=rf"effect 'kite_wind': {message}") as caught:
        scene.simulator()
    assert "\n" not in str(caught.value)
    assert "wind.py:" in str(caught.value)


def test_scenes_that_do_not_name_a_broken_effect_do_not_notice(install):
    install("1/0")
    assert load_scene("pendulum").effects


def test_an_edit_of_a_kernel_that_an_effects_kernel_calls_is_noticed(install):
    """In a package's other file, by the next process: Numba alone would run what it had inlined before."""
    head, told = "from physics_prior.dynamics.kernel import kernel\n", []
    wind = f"{head}from kites.air import f\n@kernel\ndef g(x):\n    return f(x)\n"
    folder = install(wind).parent
    command = [sys.executable, "-c", "from kites.wind import g; print(g(1.0))"]
    paths = os.pathsep.join([str(PACKAGE.parent), str(folder)])
    environment = os.environ | {"PYTHONPATH": paths, "PHYSICS_PRIOR_CACHE": str(folder / "cache")}
    for factor in ("1.0", "2.0"):
        (folder / "kites" / "air.py").write_text(f"{head}@kernel\ndef f(x):\n    return {factor} * x\n")
        told.append(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout.strip())
    assert told == ["1.0", "2.0"]
