"""The one place of the package's Python metadata; what ROS states too is read from package.xml."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

manifest = ElementTree.parse("package.xml").getroot()
maintainer = manifest.find("maintainer")
name = manifest.findtext("name")
share = Path("share", name)


def shipped_files() -> list[tuple[str, list[str]]]:
    """Everything read at run time, folder by folder, where ament and a plain pip install both look for it."""
    folders: dict[str, list[str]] = {
        str(Path("share", "ament_index", "resource_index", "packages")): [str(Path("resource", name))],
        str(share): ["package.xml"],
    }
    for top in ("config", "launch", "bags"):
        for file in sorted(Path(top).rglob("*")):
            if file.is_file() and "__pycache__" not in file.parts:
                folders.setdefault(str(share / file.parent), []).append(str(file))
    return list(folders.items())


setup(
    name=name,
    version=manifest.findtext("version"),
    description=manifest.findtext("description"),
    maintainer=maintainer.text,
    maintainer_email=maintainer.get("email"),
    license=manifest.findtext("license"),
    python_requires=">=3.11",
    packages=find_packages(include=[name, f"{name}.*"]),
    data_files=shipped_files(),
    install_requires=[
        "numpy",  # arrays; the readable formulations
        "scipy",  # dense linear algebra, chi-square quantiles, reference integrators
        "numba",  # compiled kernels
        "mcap",  # recordings
        "PyYAML",  # scene files, through its safe loader
        "pydantic>=2",  # validation whose errors name the field
        "rich",  # progress bars and tables in the terminal
        "matplotlib",  # plots
    ],
    extras_require={
        # the node, for those without apt; the middleware wheel is not pulled in by rclpy's own
        "ros": ["ros-jazzy-rclpy", "ros-jazzy-common-interfaces", "ros-jazzy-rmw-fastrtps-cpp"],
        "test": [
            "pytest",
            "pytest-xdist",  # both cores: compiling kernels is most of the tests' time
            "hypothesis",  # property tests
            "rosbags",  # an independent reader of the recordings
            "setuptools",  # the packaging tests read this file
            "ruff==0.17.*",  # a newer minor version may lint and format differently
            "mypy==2.*",
            "types-PyYAML",
        ],
        # oracles and peers of the kernels
        "bench": ["pin", "mujoco", "exudyn"],
    },
    entry_points={
        "console_scripts": [
            "physics-prior = physics_prior.cli:main",
            "physics_prior_node = physics_prior.node:main",
        ],
    },
)
