"""Whether a scene's budget holds, told from made-up times."""

import pytest

from physics_prior.interface.pace import FEWEST, Pace
from physics_prior.scene import Accuracy

INTERVAL = 10_000_000  # ns


def run(asked, seconds, count=FEWEST, messages=1):
    pace = Pace(asked)
    for index in range(count):
        for _ in range(messages):
            pace.add(index * INTERVAL, seconds)
    return pace


def test_figures_are_told_of_any_scene_and_begin_anew():
    pace = run(None, 50e-6)
    assert pace.tell() == ("", {"us a measurement": "50", "real time factor": "200"})
    assert pace.tell() == ("", {})


def test_messages_of_one_stamp_count_as_one():
    assert run(None, 10e-6, messages=4).tell()[1]["us a measurement"] == "40"


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (Accuracy(budget=40e-6), "measurements take 50 us each: the scene's budget is 40 us"),
        (
            Accuracy(real_time_factor=300.0),
            "measurements are taken in 200x as fast as they come: the scene asks for 300x",
        ),
        (Accuracy(budget=60e-6), ""),
        (Accuracy(real_time_factor=100.0), ""),
        (Accuracy(tolerance=1e-4), ""),
    ],
)
def test_what_does_not_hold_is_said(asked, words):
    assert run(asked, 50e-6).tell()[0] == words


def test_few_measurements_tell_no_problem():
    assert run(Accuracy(budget=1e-6), 50e-6, count=FEWEST - 1).tell()[0] == ""
