"""What effects cost scenes that do not name them: how a build without one is made, and what is compared."""

import shutil
import subprocess
import sys

import pytest

from physics_prior.effects import REGISTRY
from physics_prior.effects.contact import Contact
from physics_prior.effects.drag import Drag
from physics_prior.effects.gravity import Gravity
from physics_prior.studies import effect_costs
from physics_prior.studies.effect_costs import PACKAGE, remove, run_effect_costs, scenes, table
from physics_prior.studies.effect_probe import instructions

ANSWER = {"bits": "a", "text": "b", "code": "c", "instructions": 9}
FIGURES = {"scene", "same_bits", "same_code", "instructions", "instructions_more", "kernels_compiled"}


@pytest.mark.parametrize("kind", REGISTRY)
def test_a_build_without_an_effect_knows_all_others(kind, tmp_path):
    """Nothing of it is left, and the rest is still Python that imports."""
    room = tmp_path / "physics_prior" / "effects"
    shutil.copytree(PACKAGE, room.parent, ignore=shutil.ignore_patterns("__pycache__"))
    remove(room, REGISTRY[kind])
    assert f"class {REGISTRY[kind].__name__}(" not in "\n".join(file.read_text() for file in room.glob("*.py"))
    if kind in ("drag", "hinge"):  # one of each way
        script = "from physics_prior.effects import REGISTRY; print(*REGISTRY)"
        told = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=True, capture_output=True, text=True)
        assert told.stdout.split() == [other for other in REGISTRY if other != kind]


def row(effect, *cases):
    """A row of the table."""
    figures = {"name": effect.kind, "kernels": bool(effect_costs._kernels(effect)), "cases": cases}
    return table({"effects": [figures]}).splitlines()[-1]


def test_what_differs_is_told():
    whole = ANSWER | {"modules": ["physics_prior.effects.drag", "physics_prior.dynamics.contact.detect"]}
    same = effect_costs._compared(Drag, whole, whole)
    assert (same["same_bits"], same["same_code"], same["kernels_compiled"]) == (True, True, 1)
    assert effect_costs._compared(Contact, whole, whole)["kernels_compiled"] == 1
    gravity = effect_costs._compared(Gravity, whole, whole)
    assert row(Gravity, gravity, gravity) == (
        "| `gravity` | none of its own | yes | 9, the same, +0 | yes | 9, the same, +0 |"
    )
    for name, figure in (("bits", "same_bits"), ("text", "same_code"), ("code", "same_code")):
        assert effect_costs._compared(Drag, whole, whole | {name: "x"})[figure] is False
    other = effect_costs._compared(Drag, whole | {"instructions": 10}, whole | {"bits": "x", "code": "x"})
    assert row(Drag, same, other) == "| `drag` | 2 | yes | 9, the same, +0 | NO | 10, NOT THE SAME, +1 |"


def test_instructions_are_those_of_the_machine_by_neutral_names():
    text = "\t.text\nlabel:\n\tmovq\t$fB4v123_RecordILi2319E, %rax\n\tret\n"
    assert instructions(text) == instructions(text.replace("B4v123", "B2v9").replace("2319", "2316"))
    assert len(instructions(text)) == 2
    assert instructions(text) != instructions(text.replace("%rax", "%rbx"))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["joint_damping", "contact", "weld"])
def test_scenes_do_not_pay_for_effects_that_they_do_not_name(kind):
    """A force that one scene names, inequality rows, equality rows; ``physics-prior bench --effects`` shows all."""
    (figures,) = run_effect_costs([kind])["effects"]
    assert set(figures) == {"name", "kernels", "cases"}
    assert [case["scene"] for case in figures["cases"]] == list(scenes())
    for case in figures["cases"]:
        assert set(case) == FIGURES
        assert case["same_bits"]
        assert case["same_code"]
        assert case["kernels_compiled"] == case["instructions_more"] == 0
