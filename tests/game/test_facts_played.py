"""The closed forms of the model once more, by playing: the game with a joint policy, and PettingZoo
with players."""

from collections.abc import Mapping
from math import pi, sin, sqrt

import numpy as np
import pytest

from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import (
    Game,
    JointPolicy,
    Player,
    Policy,
    Random,
    Scenario,
    make_scenario,
    parallel_env,
)
from roletrust_env.game.rollout import record

FACT = pytest.mark.parametrize("play", ["game", "pettingzoo"], indirect=True)


def sinc(x: float) -> float:
    return sin(pi * x) / (pi * x) if x else 1.0


def paper(
    raters: int = 3, providers: int = 3, noise: float = 0.0, max_cycles: int = 90
) -> Scenario:
    agents = [{"role": "SR", "count": raters, "noise": noise}, {"role": "SP", "count": providers}]
    return make_scenario("paper-3x3").change(agents=agents, perturbations=(), max_cycles=max_cycles)


def in_game(scenario: Scenario, policies: Mapping[str, Policy]) -> tuple[np.ndarray, np.ndarray]:
    history = record(JointPolicy(Game(scenario), policies), Random(np.random.default_rng(0)))
    return history.tor, history.top


def in_pettingzoo(
    scenario: Scenario, policies: Mapping[str, Policy]
) -> tuple[np.ndarray, np.ndarray]:
    env = parallel_env(scenario)
    players = {
        name: Player(policies.get(name, Policy()), name, env.layout) for name in env.possible_agents
    }
    observations, _ = env.reset(seed=0)
    trust = []
    while env.agents:
        observations, *_, infos = env.step(
            {name: players[name](observations[name]) for name in env.agents}
        )
        trust.append([infos[name]["trust"] for name in env.possible_agents])
    raters = env.layout.n_raters
    return np.array(trust)[:, :raters], np.array(trust)[:, raters:]


@pytest.fixture
def play(request: pytest.FixtureRequest) -> object:
    """Play to the end; returns ToR and ToP after every round, (T, S) and (T, P)."""
    return {"game": in_game, "pettingzoo": in_pettingzoo}[request.param]


def close(value: float) -> object:
    return pytest.approx(value, abs=1e-6)


def printed(value: object, digits: int = 3) -> object:
    return pytest.approx(value, abs=0.5 * 10**-digits)


@FACT
@pytest.mark.parametrize(
    ("lie", "shown"), [(0.5, (0.5918, 0.4226, 0.4393)), (0.0, (1 - sqrt(1 / 3), 0.1835, 0.2818))]
)
def test_one_liar_of_three(play, lie: float, shown: tuple[float, float, float]) -> None:
    tor, top = play(paper(), {"sr_2": BadMouthing(level=lie)})
    honest, liar = 1 - sqrt((1 - lie) / 3), 1 - sqrt((1 - lie) * 2 / 3)
    assert tor[-1] == close([honest, honest, liar])
    assert top[-1] == close([(2 * honest + sinc(1 - lie) * liar * lie) / 3] * 3)
    assert (tor[-1, 0], tor[-1, 2], top[-1, 0]) == printed(shown, digits=4)


@FACT
def test_a_liar_that_attacks_one_provider_of_three(play) -> None:
    tor, top = play(paper(), {"sr_2": BadMouthing(targets=(1,))})
    honest, liar = 1 - sqrt(1 / 6) / 3, 1 - sqrt(1 / 3) / 3
    assert tor[-1] == close([honest, honest, liar])
    assert tor[-1] == printed([0.864, 0.864, 0.808])
    assert top[-1, 1] == close((2 * honest + liar / pi) / 3)
    assert top[-1, 1] == printed(0.66, digits=2)
    assert top[-1, [0, 2]] == close((2 * honest + liar) / 3)


@FACT
@pytest.mark.parametrize(
    ("quality", "shown"), [(0.9, 0.885), (0.8, 0.748), (0.7, 0.601), (0.5, 0.318)]
)
def test_constant_quality_among_the_honest(play, quality: float, shown: float) -> None:
    tor, top = play(paper(), {f"sp_{j}": OnOff(duty=1.0, bad=quality) for j in range(3)})
    assert tor[-1] == close(1)
    assert top[-1] == close(sinc(1 - quality) * quality)
    assert top[-1] == printed(shown)


@FACT
def test_on_off_in_turn_loses_all_trust(play) -> None:
    tor, top = play(paper(), {"sp_2": OnOff()})
    assert tor[-1] == close(1)
    assert top[-1] == close([1, 1, 0])


@FACT
def test_on_off_with_one_bad_round_per_five_good(play) -> None:
    _, top = play(paper(max_cycles=240), {"sp_2": OnOff(period=6, duty=1 / 6)})
    cycle = top[-6:, 2]
    assert sorted(cycle) == close([5 / 21, 10 / 21, 13 / 21, 17 / 21, 19 / 21, 20 / 21])
    assert (cycle.min(), cycle.max(), cycle.mean()) == printed((0.238, 0.952, 0.667))


@pytest.mark.parametrize("raters", [3, 30, 300])
def test_a_third_of_liars_is_never_diluted(raters: int) -> None:
    tor, top = in_game(paper(raters), {f"sr_{i}": BadMouthing() for i in range(raters // 3)})
    assert tor[-1, -1] == close(1 - sqrt(1 / 6))
    assert tor[-1, 0] == close(1 - sqrt(1 / 3))
    assert top[-1] == close((2 * (1 - sqrt(1 / 6)) + (1 - sqrt(1 / 3)) / pi) / 3)


@pytest.mark.parametrize(("raters", "shown"), [(10, 0.709), (100, 0.921)])
def test_one_liar_is_diluted(raters: int, shown: float) -> None:
    _, top = in_game(paper(raters), {"sr_0": BadMouthing()})
    honest, liar = 1 - sqrt(0.5 / raters), 1 - sqrt(0.5 * (1 - 1 / raters))
    assert top[-1] == close(((raters - 1) * honest + liar / pi) / raters)
    assert top[-1] == printed(shown)


@pytest.mark.parametrize("spread", [0.01, 0.05, 0.1])
def test_noisy_perception_costs_honest_raters_much_trust(spread: float) -> None:
    scenario = paper(raters=100, providers=30, noise=spread, max_cycles=40)
    tor, _ = in_game(scenario, {f"sp_{j}": OnOff(duty=1.0, bad=0.5) for j in range(30)})
    assert tor[-1].mean() == pytest.approx(1 - 0.822 * sqrt(spread), abs=0.01)
    if spread == 0.05:
        assert tor[-1].mean() == pytest.approx(0.816, abs=0.01)
