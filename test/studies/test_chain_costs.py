"""Cost over the number of bodies: what is fitted, told and drawn. Nothing here asks how fast."""

import json

import pytest

from physics_prior import cli
from physics_prior.studies import chain_costs
from physics_prior.studies.chain_costs import Cost, exponents


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_the_power_of_made_up_costs_is_found(power):
    costs = [
        Cost(kind, links, 0, scale * links**power)
        for kind, scale in (("a", 1.0), ("b", 9.0))
        for links in (10, 40, 300)
    ]
    assert exponents(costs) == {"a": pytest.approx(power), "b": pytest.approx(power)}


def test_both_kinds_are_run_at_every_size_told_and_drawn(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(chain_costs, "ROUNDS", 1)
    run = chain_costs.run_chain_costs
    monkeypatch.setattr(chain_costs, "run_chain_costs", lambda progress: run((2, 4), progress))
    assert (
        cli.main(["bench", "--chain", "--plot", str(tmp_path / "chain.png"), "--json", str(tmp_path / "chain.json")])
        == 0
    )
    told = json.loads((tmp_path / "chain.json").read_text())
    assert [(cost["kind"], cost["links"], cost["rows"]) for cost in told["costs"]] == [
        ("open chain", 2, 0),
        ("open chain", 4, 0),
        ("four-bars in a row", 3, 3),
        ("four-bars in a row", 5, 6),
    ]
    assert set(told["exponents"]) == {"open chain", "four-bars in a row"}
    assert (tmp_path / "chain.png").read_bytes().startswith(b"\x89PNG")
    assert "| four-bars in a row | 5 | 6 |" in capsys.readouterr().out


def test_a_plot_of_nothing_is_refused(capsys):
    assert cli.main(["bench", "--plot", "x.png"]) == 2
    assert "--plot draws what --chain tells" in capsys.readouterr().err
