"""The paper's robots on real middleware, twice as fast as the scenario's clock."""

import json
import os

import imageio.v2 as imageio
import pytest
from typer.testing import CliRunner

from experiments.cli import app
from roletrust_env.live.journal import read_journal
from roletrust_env.live.manager import replayed
from roletrust_env.trust import make_trust_model

pytestmark = pytest.mark.live


@pytest.mark.parametrize(("attack", "figure"), [("bad-mouthing", 4), ("on-off", 3)])
def test_the_plateaus_are_those_of_the_paper(attack, figure, tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))
    done = CliRunner().invoke(app, ["live", "demo", "--attack", attack, "--speed", "2", "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    results = json.loads((tmp_path / "results.json").read_text())
    assert {claim["figure"] for claim in results["claims"]} == {figure}
    assert [claim["what"] for claim in results["claims"] if not claim["ok"]] == []
    assert results["rounds"] > 220
    entries = list(read_journal(tmp_path / "journal.jsonl"))
    assert replayed(make_trust_model("role-trust"), tmp_path / "journal.jsonl").trust == entries[-1].trust
    assert imageio.imread(tmp_path / "figure.png").shape[0] > 100
