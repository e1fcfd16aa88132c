"""What sleep saves: the case that is timed is the one that is told."""

from physics_prior.studies import sleep_costs


def test_a_case_sleeps_lies_where_it_would_and_is_told(monkeypatch):
    monkeypatch.setattr(sleep_costs, "CASES", ((2, 60.0), (1, 0.0)))
    told = []
    figures = sleep_costs.run_sleep_costs(told.append)
    swinging, hanging = figures["cases"]
    assert swinging["asleep"] == ["box0", "box1"]
    assert hanging["asleep"] == ["box0", "bob"]
    assert max(swinging["apart"], hanging["apart"]) < 1e-12  # measured 1e-16
    assert told == [0.5, 1.0]
    rows = sleep_costs.table(figures).splitlines()[2:]
    assert [row.split(" | ")[:2] for row in rows] == [["| 2", "swings"], ["| 1", "hangs still"]]
