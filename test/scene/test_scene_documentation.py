"""docs/scenes.md: its examples are loaded as they stand there."""

import re
from pathlib import Path

import pytest
import yaml

from physics_prior.effects import REGISTRY
from physics_prior.errors import SceneError
from physics_prior.scene import load_scene
from physics_prior.scene.measurements import SOURCES
from physics_prior.scene.parts import SHAPES
from physics_prior.scene.readouts import READOUTS
from physics_prior.scene.schema import SceneFile

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "scenes.md").read_text(encoding="utf-8")
WHOLE, *SECTIONS, WRONG = re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)


def test_the_first_example_is_a_whole_scene_of_fifteen_lines_or_so(tmp_path):
    (tmp_path / "pendulum.yaml").write_text(WHOLE)
    scene = load_scene(tmp_path / "pendulum.yaml")
    assert scene.tree.nv == 1
    assert len(WHOLE.splitlines()) <= 17


@pytest.mark.parametrize("text", SECTIONS, ids=lambda text: text.split(":")[0])
def test_every_section_example_loads_in_place_of_that_of_the_whole_scene(tmp_path, text):
    path = tmp_path / "example.yaml"
    # sections end where the next begins: keys at the start of a line
    replaced = yaml.safe_load(WHOLE) | yaml.safe_load(text)
    assert set(yaml.safe_load(text)) <= set(SceneFile.model_fields)
    kept = {key: value for key, value in yaml.safe_load(WHOLE).items() if key not in yaml.safe_load(text)}
    path.write_text(yaml.safe_dump(kept) + text)
    scene = load_scene(path)
    assert len(scene.effects) == len(replaced["effects"])
    assert len(scene.measurements) == len(replaced["measurements"])
    assert len(scene.readouts) == len(replaced["readouts"])


def test_the_wrong_example_gives_the_error_that_the_page_shows(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("wrong.yaml").write_text(WRONG)
    with pytest.raises(SceneError) as error:
        load_scene("wrong.yaml")
    assert str(error.value) in PAGE


def test_the_values_left_out_are_those_that_the_page_states(tmp_path):
    (text,) = [text for text in SECTIONS if text.startswith("frame_id")]
    stated = yaml.safe_load(text)
    del stated["initial"]
    scenes = []
    for name, sections in (("stated", stated), ("bare", {})):
        path = tmp_path / f"{name}.yaml"
        path.write_text(yaml.safe_dump(yaml.safe_load(WHOLE) | sections))
        scenes.append(load_scene(path))
    for attribute in ("frame_id", "step", "gate", "health", "simulation"):
        assert getattr(scenes[0], attribute) == getattr(scenes[1], attribute)


@pytest.mark.parametrize("kind", [*REGISTRY, *SOURCES, *READOUTS, *SHAPES, *SceneFile.model_fields])
def test_the_page_names_every_kind_and_section(kind):
    assert f"`{kind}`" in PAGE or f"## {kind}\n" in PAGE
