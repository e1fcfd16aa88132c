"""What is shipped is what is in the tree, under one version; setup.py is read as pip and colcon read it."""

import importlib
import subprocess
from distutils.core import Distribution, run_setup  # setuptools' own copy from Python 3.12 on
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree

import pytest

import physics_prior

ROOT = Path(__file__).resolve().parents[1]

TOP_LEVEL = {
    *("package.xml", "setup.py", "setup.cfg", "pyproject.toml", "MANIFEST.in", "resource"),
    *("physics_prior", "config", "launch", "bags", "test", "docs"),
    *("README.md", "CHANGELOG.rst", "LICENSE", ".ci", ".gitignore"),
}


@pytest.fixture
def distribution(monkeypatch: pytest.MonkeyPatch) -> Distribution:
    monkeypatch.chdir(ROOT)
    return run_setup("setup.py", stop_after="init")


@pytest.fixture(scope="module")
def tracked() -> set[PurePosixPath]:
    """Files under version control, relative to the repository."""
    if not (ROOT / ".git").exists():
        pytest.skip("missing .git: this copy is not under version control")
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return {PurePosixPath(name) for name in listing.split("\0") if name}


def test_one_version_and_one_name(distribution: Distribution) -> None:
    manifest = ElementTree.parse(ROOT / "package.xml").getroot()
    assert distribution.get_version() == manifest.findtext("version") == physics_prior.__version__
    assert distribution.get_name() == manifest.findtext("name") == physics_prior.__name__
    assert (ROOT / "resource" / physics_prior.__name__).read_bytes() == b""


def test_every_scene_launch_file_and_bag_is_installed_at_its_own_path(
    distribution: Distribution, tracked: set[PurePosixPath]
) -> None:
    installed = {
        PurePosixPath(source): PurePosixPath(folder, PurePosixPath(source).name)
        for folder, sources in distribution.data_files
        for source in sources
    }
    wanted = {file for file in tracked if file.parts[0] in {"config", "launch", "bags"}}
    wanted.add(PurePosixPath("package.xml"))
    assert {file: installed.get(file) for file in wanted} == {
        file: PurePosixPath("share", "physics_prior", file) for file in wanted
    }


def test_every_module_is_in_an_installed_package(distribution: Distribution, tracked: set[PurePosixPath]) -> None:
    modules = {file for file in tracked if file.parts[0] == "physics_prior" and file.suffix == ".py"}
    assert modules
    assert {".".join(file.parts[:-1]) for file in modules} <= set(distribution.packages)


@pytest.mark.parametrize("script", ["physics-prior", "physics_prior_node"])
def test_a_command_leads_to_a_function(distribution: Distribution, script: str) -> None:
    commands = dict(line.split(" = ") for line in distribution.entry_points["console_scripts"])
    module, function = commands[script].split(":")
    if module == "physics_prior.node":
        pytest.importorskip("rclpy", reason="missing rclpy: the node needs the `ros` extra")
    assert callable(getattr(importlib.import_module(module), function))


def test_the_top_level_holds_what_the_layout_names(tracked: set[PurePosixPath]) -> None:
    assert {file.parts[0] for file in tracked} <= TOP_LEVEL
