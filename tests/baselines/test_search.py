"""Scripted attackers as points to search through, and the searchers."""

import numpy as np
import pytest

from agents.ladder.players import Scripted
from agents.ladder.rungs import SEARCHED, UnsuitableError, exact_task, find, measure
from baselines import BadMouthing, OnOff
from baselines.scripts import Both, Scripts, describe, side_by_side
from baselines.search import CmaEs, Grid, PaperAttacks, RandomSearch
from roletrust_env.game.attack import make_task

PROVIDER = {
    "scenario": "paper-3x3",
    "noise": 0.0,
    "perturbations": (),
    "max_cycles": 20,
    "compromised": ("sp_2",),
    "objective": "exploit",
}
CROWD = {"scenario": "crowd-10x10", "max_cycles": 10, "compromised": ("sr_8", "sr_9", "sp_9"), "objective": "damage"}
DUAL = {"scenario": "peers", "max_cycles": 10, "compromised": ("srsp_5",), "objective": "exploit"}
SEARCHERS = [Grid(), RandomSearch(), CmaEs()]


def nobody(rounds):
    """Tells nobody."""


def found(rung, arguments, budget, seed=0):
    return find(rung, arguments, budget=budget, seed=seed, games=4, tell=nobody)


def scripts(arguments):
    return Scripts.of(make_task(**arguments))


def test_the_cube_has_the_parameters_of_every_compromised_agent():
    assert [scripts(arguments).size for arguments in (PROVIDER, CROWD, DUAL)] == [4, 10, 7]


def test_corners_of_the_cube_are_attacks():
    space = scripts(CROWD)
    low, high = space.decode(np.zeros(10)), space.decode(np.ones(10))
    assert low["sp_9"] == OnOff(period=1, duty=0, bad=0, good=0)
    assert high["sp_9"] == OnOff(period=12, duty=1, bad=1, good=1)
    assert low["sr_8"] == BadMouthing(lie="constant", level=0, targets=(0,))
    assert high["sr_9"] == BadMouthing(lie="relative", level=1, targets=tuple(range(9)))


def test_accomplices_are_no_victims():
    assert 9 not in scripts(CROWD).victims
    assert len(scripts(CROWD).victims) == 9


def test_an_agent_with_both_roles_attacks_on_both_channels():
    policy = scripts(DUAL).default["srsp_5"]
    assert policy == Both(OnOff(), BadMouthing())
    assert describe({"srsp_5": policy}) == "srsp_5: on-off 2 rounds, 0.5 of them at 0, else 1 and rates all 0.5"


@pytest.mark.parametrize("arguments", [PROVIDER, CROWD, DUAL], ids=["provider", "crowd", "dual"])
def test_attacks_side_by_side_score_as_alone(arguments):
    task, random = exact_task(arguments), np.random.default_rng(0)
    space = Scripts.of(task)
    attacks = [space.decode(random.random(space.size)) for _ in range(5)]
    together = measure(task, Scripted(side_by_side(attacks)), 2, (5, 3), SEARCHED)[0]
    alone = [measure(task, Scripted(attack), 2, (1, 3), SEARCHED)[0][0] for attack in attacks]
    assert together == pytest.approx(np.array(alone), abs=1e-14)


def test_random_switching_plays_side_by_side():
    task = exact_task(PROVIDER)
    attacks = [{"sp_2": OnOff(switching="random", period=4)}, {"sp_2": OnOff(duty=0)}]
    scores = measure(task, Scripted(side_by_side(attacks)), 0, (2, 50), SEARCHED)[0]
    assert np.ptp(scores[0]) > 0
    assert scores[1] == pytest.approx(0)


@pytest.mark.parametrize("rung", SEARCHERS, ids=lambda rung: rung.name)
@pytest.mark.parametrize("arguments", [PROVIDER, CROWD, DUAL], ids=["provider", "crowd", "dual"])
def test_searchers_keep_the_budget_and_their_seed_decides(rung, arguments):
    one, again, other = (found(rung, arguments, 12_000, seed) for seed in (0, 0, 1))
    assert one.scores.tolist() == again.scores.tolist()
    assert one.rounds == again.rounds <= 12_000
    assert one.words == again.words
    assert other.rounds <= 12_000


def test_searchers_find_what_beats_the_default():
    default = found(PaperAttacks(), PROVIDER, 0).scores.mean()
    for rung in SEARCHERS:
        assert found(rung, PROVIDER, 20_000).scores.mean() > 5 * default


def test_more_budget_finds_more():
    few, many = (found(RandomSearch(), PROVIDER, budget).scores.mean() for budget in (1_000, 40_000))
    assert many > few


def test_cma_es_beats_the_grid():
    """Its own space holds the grid, and it goes on between the grid's lines."""
    grid, best = (found(rung, PROVIDER, 60_000).scores.mean() for rung in (Grid(), CmaEs()))
    assert best > 1.01 * grid


@pytest.mark.parametrize("rung", SEARCHERS, ids=lambda rung: rung.name)
def test_a_budget_too_small_is_refused(rung):
    with pytest.raises(UnsuitableError, match="give 640 or more"):
        found(rung, PROVIDER, 100)
