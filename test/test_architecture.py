"""The rooms of docs/architecture.md hold: who may import whom, how long a file may be, what __all__ promises."""

import ast
import importlib
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from physics_prior.cli import COMMANDS

PACKAGE = Path(__file__).resolve().parents[1] / "physics_prior"
COMMAND_MODULES = [module.removeprefix("physics_prior.") for module, _ in COMMANDS.values()]
FILES = sorted(PACKAGE.rglob("*.py"))

ROOMS = [
    ("errors", "resources", "rotations"),
    ("inertia",),
    ("model",),
    (
        "dynamics.kernel",
        "dynamics.kernel_cache",
        "dynamics.kernel_compiler",
        "dynamics.types",
        "dynamics.blocks",
        "dynamics.algebra",
        "dynamics.spatial",
    )
    + ("dynamics.trigonometry", "dynamics.rotation_vector", "dynamics.point_force"),
    ("effects",),
    ("dynamics",),
    ("scene",),
    ("recording.wire", "recording.messages", "recording.cdr", "recording.definitions", "recording.mcap_file")
    + ("recording.bag", "recording.reader", "recording.writer", "recording"),
    ("estimation",),
    ("interface",),
    ("recording.simulate", "recording.truth", "recording.references", "recording.replay", "interface.warm_up"),
    ("stepping",),
    ("calibration",),
    ("studies",),
    ("commands", "ros_inputs", "ros_parameters"),
    ("cli", "node"),
]
"""From the ground up: a module imports from its own room and from rooms below."""

ROS = {"rclpy", "rcl_interfaces", "rosidl_runtime_py", "rosgraph_msgs", "builtin_interfaces", "std_srvs", "std_msgs"}
ROS |= {"geometry_msgs", "sensor_msgs", "nav_msgs", "visualization_msgs", "diagnostic_msgs", "lifecycle_msgs"}


def module_name(path):
    """Dotted name below the package; the package itself is ''."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


MODULES = {module_name(path): path for path in FILES}


def room(module):
    """The number of the room with the longest name that fits, the package's own first."""
    best, number = -1, -1
    for index, names in enumerate(ROOMS):
        for name in names:
            if (module == name or module.startswith(f"{name}.")) and len(name) > best:
                best, number = len(name), index
    return number


def imports(path, *, at_top=False):
    """Names of all modules that a file imports, dotted; with at_top only those imported when it is."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.iter_child_nodes(tree) if at_top else ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: import by absolute names"
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                yield full if full.removeprefix("physics_prior.") in MODULES else node.module


def own_imports(path, **options):
    """Names below the package of the package's modules that a file imports."""
    for name in imports(path, **options):
        if name == "physics_prior" or name.startswith("physics_prior."):
            yield name.removeprefix("physics_prior").removeprefix(".")


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_run_one_way(path):
    own = module_name(path)
    assert own == "" or room(own) >= 0, f"{own} is in no room: give it one, here and in docs/architecture.md"
    for name in own_imports(path):
        assert room(name) <= room(own), f"{own} imports {name} from a room above its own"


def test_no_module_imports_itself_through_others():
    graph = {own: set(own_imports(path, at_top=True)) for own, path in MODULES.items()}
    TopologicalSorter(graph).prepare()  # CycleError names the ring


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_only_the_node_and_its_helpers_know_ros(path):
    used = {name.split(".")[0] for name in imports(path)} & ROS
    assert not used or path.name == "node.py" or path.name.startswith("ros_")


def test_nothing_light_imports_the_compiler():
    """What `--help` loads, and the rooms below the dynamics, do without numba."""
    for own, path in MODULES.items():
        light = own in ("", "cli", "commands", "commands.terminal", *COMMAND_MODULES)
        if light or own.split(".")[0] in ("errors", "resources", "rotations", "inertia", "model", "recording"):
            assert "numba" not in {name.split(".")[0] for name in imports(path)}, own
        if light:
            heavy = [name for name in own_imports(path, at_top=True) if room(name) in range(1, len(ROOMS) - 2)]
            assert not heavy, f"{own} imports {heavy} before it needs them"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_file_is_one_idea(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 400


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_every_module_says_what_it_is(path):
    assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize("own", [own for own, path in MODULES.items() if "__all__" in path.read_text(encoding="utf-8")])
def test_all_lists_real_names_in_order(own):
    module = importlib.import_module(f"physics_prior.{own}".rstrip("."))
    assert [name for name in module.__all__ if not hasattr(module, name)] == []
    assert len(set(module.__all__)) == len(module.__all__)


def test_the_page_names_every_room():
    page = (PACKAGE.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    for path in [*PACKAGE.glob("*.py"), *(path.parent for path in PACKAGE.glob("*/__init__.py"))]:
        if path.name != "__init__.py":
            assert f"`{path.name}" in page or f"    {path.name}" in page or f"  {path.name}" in page, path.name
