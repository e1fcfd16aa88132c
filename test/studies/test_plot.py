"""Pictures of a replay: drawn for whatever a replay may find, and refused for what is no picture."""

import numpy as np
import pytest

from physics_prior.errors import PhysicsPriorError
from physics_prior.estimation.estimate import Counts, Level
from physics_prior.recording.replay import ReplayResult
from physics_prior.scene import load_scene
from physics_prior.studies.plot import MOST_POINTS, plot_replay, require_format

MAGIC = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}


def result(count=500, reference=True):
    """A made-up replay: an angle through full turns, a height, a force and an energy; a gap and an outlier."""
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 10.0, count)
    angle = (3.0 * t + np.pi) % (2.0 * np.pi) - np.pi
    readouts = {
        "spin": angle,
        "height": np.cos(t),
        "load": np.stack([np.sin(t), 0.0 * t, 10.0 + np.cos(t)], axis=1),
        "energy": np.full(count, -3.0),
    }
    health = np.where(np.abs(t - 5.0) < 0.5, Level.DEGRADED, Level.OK)
    return ReplayResult(
        scene=load_scene("pendulum"),
        counts=Counts(read=count, used=count),
        stamps=t,
        readouts=readouts,
        deviations={name: np.full(values.shape, 0.01) for name, values in readouts.items()},
        units={"spin": "rad", "height": "m", "load": "N", "energy": "J"},
        health=health,
        reference_stamps=t[1:-1] if reference else np.zeros(0),
        reference={"spin": angle[1:-1] + 2.0 * np.pi} if reference else {},
        nis_stamps=t,
        nis=rng.chisquare(6, count),
        nis_dimension=np.full(count, 6),
        gated=np.arange(count) == count // 3,
        topics=["/pose"] * count,
        score={"from_s": 0.2, "position_rmse_deg": 0.5} if reference else None,
    )


@pytest.mark.parametrize("suffix", MAGIC)
def test_each_format_is_drawn(tmp_path, suffix):
    path = tmp_path / f"picture{suffix}"
    plot_replay(result(), path)
    assert path.read_bytes().startswith(MAGIC[suffix])


def texts(tmp_path, replayed):
    """The words of the picture: an SVG repeats each as a comment."""
    path = tmp_path / "picture.svg"
    plot_replay(replayed, path)
    return path.read_text(encoding="utf-8")


def test_what_a_reader_needs_is_written(tmp_path):
    words = texts(tmp_path, result())
    for word in (
        *("pendulum: causal estimate", "500 of 500 measurements used", "RMSE 0.5 deg"),
        *("spin", "height", "load", "energy", "[deg]", "[mm]", "[N]", "[J]"),
        *("reference", "error, estimate", "95 % band of the mean", "OK", "DEGRADED", "1 gated", "time [s]"),
    ):
        assert word in words
    assert "LOST" not in words


def test_without_a_reference_the_uncertainty_stands_alone(tmp_path):
    words = texts(tmp_path, result(reference=False))
    assert "uncertainty" in words
    assert "reference" not in words


def test_little_or_much_is_drawn_too(tmp_path):
    one = result(count=3)
    one.readouts, one.reference = {}, {}
    one.nis, one.nis_stamps, one.nis_dimension, one.gated = (
        np.zeros(0, dtype=kind) for kind in (float, float, int, bool)
    )
    assert "NIS" in texts(tmp_path, one)
    size = len(texts(tmp_path, result(count=MOST_POINTS)))
    assert len(texts(tmp_path, result(count=20 * MOST_POINTS))) < 1.5 * size


@pytest.mark.parametrize("name", ["picture", "picture.jpg", "picture.png.txt"])
def test_what_is_no_picture_is_refused(tmp_path, name):
    with pytest.raises(PhysicsPriorError, match=r"end its name in \.png, \.svg, \.pdf"):
        plot_replay(result(), tmp_path / name)
    assert not list(tmp_path.iterdir())
    require_format(tmp_path / "PICTURE.PNG")
