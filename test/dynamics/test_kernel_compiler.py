"""Kernels have two editions: the one that kernels take in is never made machine code, and gives the bits of the other."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from physics_prior.dynamics import algebra
from physics_prior.dynamics.kernel_cache import cache_directory, is_own

KERNELS = '''
import math
import sys

import numpy as np

from physics_prior.dynamics.kernel import kernel


@kernel
def root(x):
    if x < 0.0:
        raise ValueError("root of a negative number")
    return math.sqrt(x) / 3.0


@kernel
def total(numbers):
    """Said aloud: what a user does who looks for an error."""
    result = 0.0
    for number in numbers:
        result += root(number)
    print("total", result)
    return result
'''


@pytest.fixture
def use(tmp_path, monkeypatch):
    """`use(statements) -> what they print`: in a process of its own, with the kernels above and a cache of the test."""
    (tmp_path / "some_kernels.py").write_text(KERNELS)
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{':'.join(sys.path)}")
    monkeypatch.setenv("PHYSICS_PRIOR_CACHE", str(tmp_path / "cache"))

    def run(statements):
        (tmp_path / "program.py").write_text(f"from some_kernels import *\n{statements}")
        ran = subprocess.run([sys.executable, tmp_path / "program.py"], capture_output=True, text=True)
        assert ran.returncode == 0, ran.stderr
        return ran.stdout

    return run


def test_only_what_python_calls_is_machine_code(use):
    told = use(
        "total(np.ones(2))\n"
        "print([len(each.overloads) for each in (root, root.inner, total, total.inner)])\n"
        "print([each.library._finalized for each in (*root.inner.overloads.values(), *total.overloads.values())])"
    )
    assert told.splitlines()[1:] == ["[0, 1, 1, 0]", "[False, True]"]


def test_both_editions_give_the_same_bits_fresh_and_from_the_cache(use):
    numbers = "np.random.default_rng(0).uniform(0.0, 9.0, 50)"
    ask = f"numbers = {numbers}\nsum = 0.0\nfor x in numbers: sum += root(x)\nprint(total(numbers).hex(), float(sum).hex())"
    fresh, again = use(ask), use(ask)
    assert fresh == again
    assert len(set(fresh.splitlines()[-1].split())) == 1


def test_errors_and_words_of_kernels_taken_in_come_out(use):
    caller = (
        "from physics_prior.dynamics.kernel import kernel\n"
        "import some_kernels\n"
        "@kernel\ndef twice(numbers):\n    return 2.0 * some_kernels.total(numbers)\n"
        "print(twice(np.ones(3)))\n"
        "try: twice(-np.ones(1))\nexcept ValueError as error: print(error)"
    )
    use("total(np.ones(1))")  # what twice takes in comes from the cache, in part
    assert use(caller).splitlines() == ["total 1.0", "2.0", "root of a negative number"]
    assert use("print(total(np.ones(3)))").splitlines() == ["total 1.0", "1.0"]


def test_what_allocates_or_hands_an_array_to_python_is_refused(use):
    """Nothing counts references in a kernel: memory that it allocates would never be freed."""
    told = use(
        "from numba.core.errors import NumbaError\n"
        "@kernel\ndef twice(x):\n    out = np.zeros(2)\n    out[0] = x\n    return 2.0 * out[0]\n"
        "@kernel\ndef through(x):\n    return twice(x)\n"
        "@kernel\ndef rest(numbers):\n    return numbers[1:]\n"
        "@kernel\ndef second(numbers):\n    return rest(numbers)[0]\n"
        "for ask in (lambda: twice(1.0), lambda: through(1.0), lambda: rest(np.arange(3.0)), lambda: second(np.arange(3.0))):\n"
        "    try: print(ask())\n"
        "    except NumbaError as problem: print(str(problem).splitlines()[1])\n"
    )
    assert told.splitlines() == [
        "kernel 'twice' allocates memory: have it write into an array that it is given",
        "kernel 'through' allocates memory: have it write into an array that it is given",
        "kernel 'rest' returns an array to Python: have it write into one that it is given",
        "1.0",
    ]


def test_another_checkout_of_the_same_sources_finds_what_is_compiled(tmp_path):
    package = Path(algebra.__file__).parents[1]
    shutil.copytree(package, tmp_path / "physics_prior")
    ask = "from physics_prior.dynamics import algebra; print(algebra.product._cache.cache_path, algebra.__file__)"
    ran = subprocess.run(
        [sys.executable, "-c", ask],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
    )
    folder, file = ran.stdout.split()
    assert Path(file).is_relative_to(tmp_path)
    assert folder == algebra.product._cache.cache_path


def test_own_kernels_take_variable_indices_as_they_are_and_users_count_from_the_end(use):
    assert is_own(Path(algebra.__file__))
    assert is_own(cache_directory() / "step_0.py")
    assert not is_own(Path(__file__))
    corners = "@kernel\ndef corners(a, row):\n    return a[row, 0], a[row, -1], a[-1, 0], a[-1][-1]\n"
    at = "@kernel\ndef at(a, row, column):\n    return a[row, column], a[row][column]\n"
    own = "import physics_prior.dynamics.kernel_compiler as compiler\ncompiler.is_own = lambda file: True\n"
    told = use(
        f"a = np.arange(6.0).reshape(2, 3)\n{at}print(at(a, -1, -2))\n{own}{corners}print(corners(a, 1))\n"
        # what comes before the first row: the end of another, where the array is a part of one
        f"{at.replace('at(', 'there(')}print(there(np.arange(12.0).reshape(4, 3)[2:], -1, 1))\n"
    )
    assert told.splitlines() == ["(4.0, 4.0)", "(3.0, 5.0, 3.0, 5.0)", "(4.0, 4.0)"]


def test_fields_that_a_record_lacks_are_constants_and_what_they_rule_out_is_not_compiled(use):
    """A lean record has no 'kind': the branch of another kind, which names a field that there is not, is never looked at."""
    told = use(
        "from physics_prior.dynamics.kernel import constant_fields\n"
        "LEAN = np.dtype([('x', 'f8')], align=True)\n"
        "constant_fields(LEAN, {'kind': 4})\n"
        "@kernel\n"
        "def look(records):\n"
        "    kind, result = records[0].kind, 0.0\n"
        "    for i in range(records.shape[0]):\n"
        "        each = records[i]\n"
        "        if each.kind == 3 or kind == 2:\n"
        "            result += each.missing\n"
        "        else:\n"
        "            result += each.x\n"
        "    return result + kind\n"
        "print(look(np.ones(2).view(LEAN)))\n"
        "print(look(np.array([(3, 1.0, 7.0)], dtype=[('kind', 'i8'), ('x', 'f8'), ('missing', 'f8')])))\n"
    )
    assert told.split() == ["6.0", "10.0"]


def test_constants_do_not_compile_a_kernel_anew(use):
    told = use(
        "@kernel\ndef scaled(x, k):\n    return k * x\n"
        "@kernel\ndef several(x, k):\n    return scaled(x, 2) + scaled(x, 3) + scaled(x, k)\n"
        "print(several(1.0, 4), len(scaled.inner.overloads))\n"
    )
    assert told.split() == ["9.0", "1"]
