"""A trust model and an attack of a package outside: one file each, one line each, and every command
and face has them.

The package is installed as Python sees it: a folder, and beside it what a wheel leaves of its entry
points.
"""

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from command_line import printed
from csv_files import csv_rows
from refusals import refuses

from roletrust_env import make_attacker, make_trust_model, parallel_env
from roletrust_env.trust import Traits
from studies.study import run

MODEL = '''
from typing import Any, NamedTuple

from pydantic.dataclasses import dataclass

from roletrust_env.arrays import namespace
from roletrust_env.parameters import Share


class GrudgeState(NamedTuple):
    providers: Any
    raters: Any


@dataclass(frozen=True)
class Grudge:
    """Trust falls to the lowest rating of a round at once, and rises slowly."""

    rise: Share = 0.25
    initial: Share = 0.5
    rates_raters = False
    source = "Nobody (2030)"
    differentiable = False

    def start(self, like):
        return GrudgeState(0 * like[0] + self.initial, 0 * like[:, 0] + 1)

    def update(self, state, ratings):
        xp, trust = namespace(ratings.values), state.providers
        lowest = xp.min(xp.where(ratings.weights > 0, ratings.values, trust[None, ...]), axis=0)
        return state._replace(providers=xp.where(lowest < trust, lowest, trust + self.rise * (lowest - trust)))

    def rater_trust(self, state):
        return state.raters

    def provider_trust(self, state):
        return state.providers
'''  # noqa: E501

ATTACK = '''
from typing import Annotated, ClassVar

from pydantic.dataclasses import dataclass

from roletrust_env import Policy
from roletrust_env.parameters import SearchRange, Share


@dataclass(frozen=True)
class Gossip(Policy):
    """Rates everybody a little lower, from some round on."""

    harm: Share = 0.5
    since: Annotated[int, SearchRange(0, 4)] = 2
    attacks: ClassVar = frozenset({"ratings"})

    def ratings(self, view, memory, random):
        return view.service * (1 - self.harm * (view.round >= self.since)), memory
'''

ENTRY_POINTS = """
[roletrust_env.trust_models]
grudge = village.grudge:Grudge
[roletrust_env.attackers]
gossip = village.gossip:Gossip
"""

SHORT = ("--set", "max_cycles=8")
CERTAIN = (*SHORT, "--set", "noise=0", "--set", "perturbations=[]")


@pytest.fixture(autouse=True)
def village(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The package, installed."""
    for folder, files in {
        "village": {"__init__.py": "", "grudge.py": MODEL, "gossip.py": ATTACK},
        "village-1.0.dist-info": {
            "METADATA": "Metadata-Version: 2.1\nName: village\nVersion: 1.0\n",
            "entry_points.txt": ENTRY_POINTS,
        },
    }.items():
        (tmp_path / folder).mkdir()
        for name, text in files.items():
            (tmp_path / folder / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    yield
    for name in ("village", "village.grudge", "village.gossip"):
        sys.modules.pop(name, None)


@pytest.fixture
def command(tmp_path: Path) -> Callable[..., tuple[Path, str]]:
    """Runs a command, which must be well; its folder and what it printed."""

    def run(*arguments: Any) -> tuple[Path, str]:
        out = tmp_path / "out"
        return out, printed(*arguments, *([] if arguments[0] == "list" else ["--out", out]))

    return run


def test_they_are_listed(command: Callable) -> None:
    printed = command("list", "models")[1] + command("list", "attackers")[1]
    for word in ("grudge", "rise=0.25", "gossip", "harm=0.5"):
        assert word in printed


def test_they_play(command: Callable) -> None:
    model, attack = "grudge:rise=0.5", "sr_2=gossip:harm=0.9"
    out, printed = command("play", "--model", model, "--attack", attack, *SHORT, "--games", 2)
    results = json.loads((out / "results.json").read_text())
    assert results["trust_models"][model]["parameters"] == {"rise": 0.5, "initial": 0.5}
    assert results["attackers"]["sr_2"]["parameters"] == {"harm": 0.9, "since": 2}
    assert results["measured"][model]["damage"]["3 sp"]["mean"] > 0.1
    assert "sr_2, gossip" in printed


def test_the_attack_is_searched_under_the_model(tmp_path: Path) -> None:
    task = ["task", "--task", "RaterAttack", "--model", "grudge", "--attack", "gossip"]
    run(
        "studies.ladder",
        [*task, *CERTAIN, "--budget", "1000", "--games", "2", "--out", str(tmp_path)],
    )
    rows = {row["rung"]: row for row in csv_rows(tmp_path / "ladder.csv")}
    scores = {rung: float(row["score"]) for rung, row in rows.items()}
    assert scores["random search"] > scores["scripted, default"] > scores["honest play"]
    assert rows["random search"]["attack"].startswith("sr_2: gossip:harm=0.9")
    assert "white-box planner" not in rows


def test_an_attacker_learns_against_the_model(command: Callable) -> None:
    pytest.importorskip("sb3_contrib")
    small = ["--learner", "PPO:games=8,n_steps=8,batch_size=32,n_epochs=1"]
    out, _ = command("train", "RaterAttack", "--model", "grudge", *CERTAIN, *small, "--steps", 64)
    card = json.loads((out / "attacker.json").read_text())
    assert card["trust_model"] == {"name": "grudge", "parameters": {"initial": 0.5}}


def test_environments_have_them_by_name() -> None:
    env = parallel_env("paper-3x3", trust_model="grudge", max_cycles=3)
    assert Traits.of(env.game.model).source == "Nobody (2030)"
    env.reset(seed=0)
    env.step({agent: env.action_space(agent).high for agent in env.agents})
    others = {"sr_1": make_attacker("gossip", harm=0.9, since=0)}
    task = gymnasium.make(
        "RoleTrust/RaterAttack-v0", trust_model="grudge", others=others, max_cycles=3
    )
    task.reset(seed=0)
    for _ in range(2):
        reward = task.step(task.action_space.high)[1]
    assert reward > 0.8  # trust fell to what it says


def test_their_ranges_hold() -> None:
    with refuses(ValueError, "grudge", "rise", "2"):
        make_trust_model("grudge", rise=2)
    with refuses(ValueError, "gossip", "harm", "-1"):
        make_attacker("gossip", harm=-1)
