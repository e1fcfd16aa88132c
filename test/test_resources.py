"""Shipped files are found wherever the code is installed, and an unknown scene is refused by name."""

from pathlib import Path

import pytest

from physics_prior import resources
from physics_prior.errors import PhysicsPriorError, SceneError

ROOT = Path(__file__).resolve().parents[1]

# where each kind of installation puts the package, and its share folder, below one prefix
LAYOUTS = {
    "checkout": ("physics_prior", "."),
    "virtual environment": ("lib/python3.12/site-packages/physics_prior", "share/physics_prior"),
    "64-bit library folder": ("lib64/python3.12/site-packages/physics_prior", "share/physics_prior"),
    "Debian": ("local/lib/python3.12/dist-packages/physics_prior", "local/share/physics_prior"),
    "pip --target": ("physics_prior", "share/physics_prior"),
    "Windows": ("Lib/site-packages/physics_prior", "share/physics_prior"),
    "checkout around its environment": (
        ".venv/lib/python3.12/site-packages/physics_prior",
        ".venv/share/physics_prior",
    ),
}


def install(monkeypatch: pytest.MonkeyPatch, prefix: Path, layout: str) -> Path:
    package, share = (prefix / below for below in LAYOUTS[layout])
    package.mkdir(parents=True)
    (share / "config" / "scenes").mkdir(parents=True)
    for name in ("pendulum", "four_bar"):
        (share / "config" / "scenes" / f"{name}.yaml").touch()
    monkeypatch.setattr(resources, "__file__", str(package / "resources.py"))
    return share.resolve()


@pytest.mark.parametrize("layout", LAYOUTS)
def test_finds_its_files_in_every_layout(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, layout: str) -> None:
    share = install(monkeypatch, tmp_path, layout)
    assert resources.share_directory() == share
    assert resources.shipped_scenes() == ["four_bar", "pendulum"]
    assert resources.scene_path("pendulum") == share / "config" / "scenes" / "pendulum.yaml"


def test_an_environment_inside_the_checkout_reads_its_own_files(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "config" / "scenes").mkdir(parents=True)
    share = install(monkeypatch, tmp_path, "checkout around its environment")
    assert resources.share_directory() == share


def test_a_linked_package_reads_the_files_it_links_to(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """As ``colcon build --symlink-install`` does it: the build folder links to the checkout."""
    share = install(monkeypatch, tmp_path / "source", "checkout")
    (tmp_path / "source" / "physics_prior" / "resources.py").touch()
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "physics_prior").symlink_to(tmp_path / "source" / "physics_prior")
    monkeypatch.setattr(resources, "__file__", str(tmp_path / "build" / "physics_prior" / "resources.py"))
    assert resources.share_directory() == share


def test_code_without_its_files_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(resources, "__file__", str(tmp_path / "physics_prior" / "resources.py"))
    with pytest.raises(PhysicsPriorError, match="install it with pip or colcon"):
        resources.share_directory()


def test_a_file_goes_before_a_shipped_name(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    share = install(monkeypatch, tmp_path / "prefix", "virtual environment")
    monkeypatch.chdir(tmp_path)
    assert resources.scene_path("four_bar").parent == share / "config" / "scenes"
    Path("four_bar").touch()
    assert resources.scene_path("four_bar") == Path("four_bar")
    assert resources.scene_path(tmp_path / "four_bar") == tmp_path / "four_bar"


@pytest.mark.parametrize(
    "name", ["pendulm", "pendulum.yaml", "../scenes/pendulum", "", ".", "no/such.yaml", "a\0b", "x" * 5000]
)
def test_unknown_scenes_are_refused_with_the_names_that_exist(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str
) -> None:
    install(monkeypatch, tmp_path, "virtual environment")
    with pytest.raises(SceneError, match=r"shipped are four_bar, pendulum$"):
        resources.scene_path(name)


def test_every_scene_of_this_copy_is_found_by_its_name() -> None:
    names = resources.shipped_scenes()
    assert names == sorted(file.stem for file in (ROOT / "config" / "scenes").iterdir())
    assert all(resources.scene_path(name).is_file() for name in names)
