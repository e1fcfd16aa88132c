"""README.md and docs: their commands and snippets run, their figures hold, their links and names lead somewhere."""

import json
import re
import shlex
from pathlib import Path

import pytest

from physics_prior import cli
from physics_prior.resources import shipped_scenes
from physics_prior.scene import load_scene

ROOT = Path(__file__).resolve().parents[1]
PAGES = {
    page.relative_to(ROOT).as_posix(): page.read_text("utf-8") for page in [ROOT / "README.md", *ROOT.glob("docs/*.md")]
}
README = PAGES["README.md"]

TABLE = {
    ("a", "physics"): [],
    ("a", "physics, smoothed"): ["--smooth"],
    ("a", "no physics"): ["--process", "kinematic"],
    ("a", "no physics, smoothed"): ["--process", "kinematic", "--smooth"],
}
TABLE |= {("b", kind): options for (_, kind), options in TABLE.items()}
"""Rows of the README's table: recording, estimate -> options of `replay`."""

FIGURES = ("position_rmse_deg", "velocity_rmse", "force_rmse_percent_weight")


def blocks(page, language):
    """The fenced blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE)


def marked(name):
    """The fenced block after a marker, as .ci/run reads it."""
    return re.search(rf"^<!-- {name} -->\n+```\w+\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)[1]


def commands(page):
    """The command lines of a page that call physics-prior, without what installs it."""
    lines = [line.strip() for block in blocks(page, "sh") for line in block.splitlines()]
    calls = [line.partition("physics-prior ")[2] for line in lines if "physics-prior " in line]
    return [shlex.split(call) for call in calls]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder to work in that looks like the repository to a command."""
    (tmp_path / "bags").symlink_to(ROOT / "bags")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def alike(text, other):
    """Whether two outputs have the same words, and numbers within 1 %: processors round differently."""
    number = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")
    words, others = number.sub("#", text).split(), number.sub("#", other).split()
    values, expected = ([float(found) for found in number.findall(each)] for each in (text, other))
    return words == others and values == pytest.approx(expected, rel=1e-2, abs=1e-3)


def test_both_commands_are_one_line_each():
    for name in ("replay", "test"):
        assert marked(f"command: {name}").count("\n") == 1
        assert marked(f"command: {name}").startswith("python3 -m venv .venv && .venv/bin/pip install -q ")


@pytest.mark.parametrize("name", [name for name, page in PAGES.items() if commands(page)])
def test_commands_do_what_the_page_says(name, folder, capsys):
    for words in commands(PAGES[name]):
        assert cli.main(words) == 0, words
        capsys.readouterr()


def test_replay_prints_what_the_readme_shows_and_draws_its_picture(folder, capsys):
    words = shlex.split(marked("command: replay").partition("physics-prior ")[2])
    assert cli.main(words) == 0
    shown, printed = (
        "\n".join(
            line.rstrip()
            for line in text.splitlines()
            if not line.startswith("recording")  # how fast is the machine's
        )
        for text in (marked("output: replay"), capsys.readouterr().out)
    )
    assert alike(shown.strip(), printed.strip())
    picture = words[words.index("--plot") + 1]
    assert (folder / picture).read_bytes().startswith(b"\x89PNG")
    assert f"(docs/{picture})" in README


@pytest.mark.parametrize("key", TABLE, ids=" ".join)
def test_table_of_what_physics_buys(key, shared, capsys):
    recording, kind = key
    bag = shared / "bags" / f"uw_double_pendulum_{recording}_noisy"
    if not bag.is_dir():
        pytest.skip(f"missing ../shared/bags/{bag.name}")
    row = next(line for line in README.splitlines() if line.startswith(f"| {recording} | {kind} |"))
    words = ["replay", str(bag), "--scene", "uw_double_pendulum", "--reference", "/reference/joint_states"]
    assert cli.main([*words, *TABLE[key], "--json", "-"]) == 0
    score = json.loads(capsys.readouterr().out)["reference"]
    stated = [float(cell) for cell in row.split("|")[3:6]]
    assert stated == pytest.approx([score[figure] for figure in FIGURES], rel=0.03)  # two digits


@pytest.mark.parametrize(
    ("name", "code"), [(name, code) for name, page in PAGES.items() for code in blocks(page, "python")]
)
def test_snippets_run(name, code, folder, capsys):
    if "rclpy" in code:
        pytest.importorskip("rclpy", reason="missing rclpy: the snippet needs the `ros` extra")
    exec(compile(code, name, "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out


def test_the_scene_of_the_readme_loads(tmp_path):
    (text,) = blocks(README, "yaml")
    path = tmp_path / "pendulum.yaml"
    path.write_text(text)
    assert load_scene(path).tree.nv == 1


@pytest.mark.parametrize(("name", "page"), PAGES.items(), ids=PAGES)
def test_links_lead_to_files(name, page):
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page):
        if not target.startswith("https://"):
            assert ((ROOT / name).parent / target).exists(), target


@pytest.mark.parametrize(("name", "page"), PAGES.items(), ids=PAGES)
def test_names_in_code_style_are_there(name, page):
    tests = "\n".join(path.read_text("utf-8") for path in ROOT.glob("test/**/test_*.py"))
    for named in re.findall(r"`([\w./-]+)`", page):
        if re.fullmatch(r"[\w./-]+\.(py|yaml)", named) or named.endswith("/"):
            assert (ROOT / named).exists() or list((ROOT / "physics_prior").glob(f"**/{named}")), named
        elif named.startswith("test_"):
            assert f"def {named}(" in tests, named


def test_not_a_word_of_help_is_lost():
    """The README shows each command at least once; scenes that it names are shipped."""
    calls = [words for page in PAGES.values() for words in commands(page)]
    assert {words[0] for words in calls} >= {"check", "simulate", "replay"}
    named = {words[words.index("--scene") + 1] for words in calls if "--scene" in words}
    assert named <= set(shipped_scenes())
