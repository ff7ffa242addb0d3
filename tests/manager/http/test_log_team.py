"""The export of a trust manager becomes a scenario, and is played."""

import random
import re
from pathlib import Path

import pytest
from command_line import play, run
from refusals import assert_names
from signing_agents import QUICK, Agent, Clock, managed

from roletrust_env import make_scenario
from roletrust_manager.http.requests import Request
from roletrust_manager.http.tokens import Rating

ABILITY = {"ann": 0.9, "bob": 0.5, "cec": 0.7, "dan": 1.0}


@pytest.fixture
def export(tmp_path: Path) -> Path:
    """Ratings on five stars in thirty rounds; an agent rates another in two of three rounds."""
    clock, draw = Clock(), random.Random(3)
    agents = [Agent(name, clock) for name in ABILITY]
    with managed(tmp_path / "s", clock, QUICK._replace(every=10.0, scale=(1.0, 5.0))) as manager:
        for agent in agents:
            manager.register(agent.registration())
        for _ in range(30):
            requests = []
            for rater in agents:
                rated = [one for one in ABILITY if one != rater.name and draw.random() < 2 / 3]
                seen = [min(max(draw.gauss(ABILITY[one], 0.05), 0), 1) for one in rated]
                tokens = [
                    rater.rating(one, 1 + 4 * value) for one, value in zip(rated, seen, strict=True)
                ]
                requests += [manager.check(Request(Rating, tokens))] if tokens else []
            assert all(isinstance(answer, list) for answer in manager.take(requests))
            clock.now += 10.001  # events differ by microseconds
        (tmp_path / "ratings.csv").write_text(manager.export()[0])
    return tmp_path / "ratings.csv"


def test_a_log_becomes_a_scenario_that_is_played(export: Path, tmp_path: Path):
    out = tmp_path / "agents.toml"
    done = run(
        "live", "scenario", str(export), "--every", "10", "--scale", "1", "5", "--out", str(out)
    )
    assert done.exit_code == 0, done.output
    scenario = make_scenario(out)
    assert (scenario.max_cycles, scenario.period_s, len(scenario.agents)) == (30, 10, 4)
    assert scenario.ratings.lost == pytest.approx(1 / 3, abs=0.1)
    assert [agent.role for agent in scenario.agents] == ["SR+SP"] * 4
    names = re.findall(r"# (\w+)$", out.read_text(), flags=re.MULTILINE)
    found = {name: agent.ability for name, agent in zip(names, scenario.agents, strict=True)}
    assert found == pytest.approx(ABILITY, abs=0.05)
    results, _ = play(tmp_path / "play", str(out))
    assert results
    for every in ("1000", "3e-4"):
        done = run(
            "live",
            "scenario",
            str(export),
            "--every",
            every,
            "--scale",
            "1",
            "5",
            "--out",
            str(tmp_path / "x.toml"),
        )
        assert done.exit_code == 2
        assert_names(" ".join(done.stderr.split()), "rounds")
