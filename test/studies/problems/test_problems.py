"""The benchmark mechanisms: what they are compared with is what lies beside the repository, and they start where they must."""

import numpy as np
import pytest

from physics_prior.effects.spring import Spring
from physics_prior.errors import ModelError
from physics_prior.studies.problems import andrews, bricard, chain, four_bar, governor, pendulum, tops
from physics_prior.studies.problems.mechanism import Mechanism

KNOWN = {
    "A01_simple_pendulum_10s.csv": (pendulum.simple_pendulum, ("x", "y")),
    "A02_four_bar_N1_20s.csv": (lambda: four_bar.four_bar(1), ("B0x", "B0y")),
    "A02_four_bar_N40_20s.csv": (lambda: four_bar.four_bar(40), ("B0x", "B0y")),
    "A03_andrews_squeezer_50ms.csv": (andrews.andrews, ("beta", "Theta", "gamma", "Phi", "delta", "epsilon")),
    "A04_bricard_10s.csv": (bricard.bricard, ("P3x", "P3y", "P3z")),
    "A05_flyball_governor_10s.csv": (governor.governor, ("s",)),
    "double_pendulum_moderate.csv": (pendulum.double_pendulum, ("tipx", "tipy")),
    "heavy_top_fast.csv": (tops.heavy_top, ("qw", "qx", "qy", "qz")),
    "torque_free_asymmetric_top.csv": (tops.free_top, ("qw", "qx", "qy", "qz")),
}


@pytest.mark.parametrize("name", KNOWN)
def test_values_are_those_of_the_reference(name, shared):
    """Closed solutions over all of it, and the numbers that stand in the code. Measured 5e-14 at most."""
    make, columns = KNOWN[name]
    path = shared / "reference" / name
    if not path.exists():
        pytest.skip(f"missing ../shared/reference/{name}")
    table, benchmark = np.genfromtxt(path, delimiter=",", names=True), make()
    rows = [int(np.argmin(np.abs(table["t"] - time))) for time in benchmark.times]
    assert np.max(np.abs(table["t"][rows] - benchmark.times)) < 1e-9
    expected = np.stack([table[column][rows] for column in columns], axis=1)
    assert np.max(np.abs(benchmark.values - expected)) < 1e-12


@pytest.mark.parametrize("make", [make for make, _ in KNOWN.values()], ids=KNOWN)
def test_loops_close_at_the_start(make):
    """Measured 3e-16 m."""
    benchmark = make()
    run = benchmark.run()
    assert run.residual() < 1e-15
    assert np.max(np.abs(run.q - benchmark.q)) < 1e-14
    assert np.max(np.abs(run.v - benchmark.v)) < 1e-13
    assert benchmark.observe(run).shape == benchmark.values[0].shape


def test_a_run_reaches_the_times_that_it_is_asked_for():
    run = pendulum.double_pendulum().run()
    run.to(0.0105, 1e-3)
    assert run.time == 0.0105
    assert run.simulator.time == pytest.approx(0.0105, rel=1e-12)


def test_scaled_mechanisms_keep_their_times():
    """Angles of the human after 0.1 s in millimetres and grams. Measured 1e-15."""
    plain, other = chain.hung_human().run(), chain.scaled(chain.hung_human(), 1e3, 1e3).run()
    for run in (plain, other):
        run.to(0.1, 1e-3)
    assert np.max(np.abs(plain.q - other.q)) < 1e-12
    assert other.kinetic_energy() == pytest.approx(1e9 * plain.kinetic_energy(), rel=1e-10)
    tree = chain.arm().tree
    with pytest.raises(ModelError, match="'spring' cannot be scaled"):
        chain.scaled(Mechanism(tree, (Spring(part="link6", stiffness=1.0),), np.zeros(7), np.zeros(7)), 1.0, 1.0)
