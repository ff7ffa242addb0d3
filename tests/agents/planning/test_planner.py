"""The rungs of the ladder that know the game: honest play, the planner, the optimum; and how all
are measured."""

from dataclasses import dataclass

import numpy as np
import pytest
import torch
from refusals import refuses

from roletrust_agents.planning.optimum import BestKnown, Exact
from roletrust_agents.planning.planner import Planner
from roletrust_agents.smooth import SOFT, SmoothRoleTrust
from roletrust_baselines import BadMouthing, OnOff
from roletrust_env.evaluation.attackers import OpenLoop, Scripted
from roletrust_env.evaluation.measurement import (
    HELD_OUT,
    SEARCHED,
    exact_task,
    is_certain,
    judged_rollout,
    mean_rewards,
    random_sources,
)
from roletrust_env.evaluation.search import Budget, HonestPlay, UnsuitableError, find
from roletrust_env.game.make_task import make_task
from roletrust_env.trust import Ratings, RoleTrust


def certain(rounds, **arguments):
    return {
        "scenario": "paper-3x3",
        "noise": 0.0,
        "perturbations": (),
        "max_cycles": rounds,
        **arguments,
    }


PROVIDER = certain(20, compromised=("sp_2",), objective="exploit")
RATER = certain(
    20, compromised=("sr_2",), objective="damage", stealth={"weight": 2.0, "tolerance": 0.1}
)
CROWD = {
    "scenario": "crowd-10x10",
    "max_cycles": 8,
    "compromised": ("sr_8", "sr_9", "sp_9"),
    "objective": "damage",
}


def nobody(rounds):
    """Tells nobody."""


def found(rung, arguments, budget=100_000, seed=0, games=3):
    return find(rung, arguments, budget=budget, seed=seed, games=games)


# --- measuring
# ---------------------------------------------------------------------------------------


def test_honest_play_scores_what_the_start_leaves():
    """Nothing under exploit; under damage the initial trust of 0.5 alone, which halves its distance
    each round."""
    assert found(HonestPlay(), PROVIDER).scores == pytest.approx(0, abs=1e-15)
    # 1 - ToR[n] = 0.5^(n + 1), and ToP follows it: with d = 1 - ToP, d[n] = 0.5^(n + 2) + d[n - 1]
    # / 2, d[0] = 0.5.
    n = np.arange(20)
    assert found(HonestPlay(), RATER).scores == pytest.approx(
        (0.5 ** (n + 1) * (1 + n / 2)).mean(), abs=1e-12
    )


def test_scripts_and_open_loop_measure_alike():
    actions = np.where(np.arange(20)[:, None] % 2, 1.0, 0.0)
    task = exact_task(PROVIDER)
    scripted, sequence = Scripted({"sp_2": OnOff()}), OpenLoop(actions)
    for one, other in zip(
        *(mean_rewards(task, a, 0, (1, 2), SEARCHED) for a in (scripted, sequence)), strict=True
    ):
        assert one == pytest.approx(other, abs=1e-15)


def test_attacks_side_by_side_meet_the_same_luck_and_score_as_alone():
    task = exact_task(CROWD)
    actions = np.random.default_rng(0).random((8, task.action_size, 3))
    together = mean_rewards(task, OpenLoop(actions), 5, (3, 4), SEARCHED)[0]
    alone = [
        mean_rewards(task, OpenLoop(actions[..., k]), 5, (1, 4), SEARCHED)[0][0] for k in range(3)
    ]
    assert together == pytest.approx(np.array(alone), abs=1e-14)
    assert not np.allclose(together[:, 0], together[:, 1], atol=1e-9)


def test_held_out_luck_is_none_that_was_searched_with():
    task = exact_task(CROWD)
    luck = [
        random_sources(task, seed, kind)[0].normal((4,)).tolist()
        for seed in (0, 1)
        for kind in (SEARCHED, HELD_OUT)
    ]
    assert len({tuple(row) for row in luck}) == 4


def test_who_is_caught_earns_nothing_more():
    arguments = certain(
        30, compromised=("sp_2",), objective="damage", admission={"threshold": 0.4, "rounds": 2}
    )
    moments = list(
        judged_rollout(
            exact_task(arguments),
            OpenLoop(np.zeros((30, 1))),
            (1, 1),
            *random_sources(exact_task(arguments), 0, 0),
        )
    )
    caught = [bool(moment.outcome.caught[0, 0]) for moment in moments]
    paid = [float(moment.outcome.reward[0, 0]) for moment in moments]
    first = caught.index(True)
    assert first < 10
    assert all(reward == 0 for reward in paid[first + 1 :])
    assert paid[first] > 0


def test_luck_is_noticed():
    assert is_certain(PROVIDER)
    assert is_certain(RATER)
    assert not is_certain(CROWD)


# --- the planner's copy of the trust model
# -----------------------------------------------------------


def test_smooth_trust_is_near_the_true_one():
    random = np.random.default_rng(0)
    true, soft = RoleTrust(), SmoothRoleTrust()
    states = [model.start(np.zeros((4, 3))) for model in (true, soft)]
    for _ in range(10):
        ratings, mask = random.random((4, 3)), random.random((4, 3)) < 0.7
        states = [
            model.update(s, Ratings(ratings, mask))
            for model, s in zip((true, soft), states, strict=True)
        ]
    for one, other in zip(*states, strict=True):
        assert one == pytest.approx(other, abs=2 * SOFT**0.5)


@pytest.mark.parametrize("model", [RoleTrust, SmoothRoleTrust])
def test_gradients_are_finite_where_raters_agree(model):
    """All raters agree on provider 0, and nobody rates provider 1. A gap of rounding counts as 0,
    without a slope."""
    like = torch.zeros((3, 2), dtype=torch.float64)
    note = torch.tensor(0.7, dtype=torch.float64, requires_grad=True)
    ratings, mask = like + note, torch.tensor([[True, False]] * 3)
    state = model().update(model().start(like), Ratings(ratings, mask))
    (state.tor.sum() + state.top.sum()).backward()
    assert bool(torch.isfinite(note.grad))


@pytest.mark.parametrize("arguments", [PROVIDER, RATER], ids=["provider", "rater"])
def test_gradients_through_a_game_are_those_of_the_score(arguments):
    task = make_task(
        **arguments, trust_model=SmoothRoleTrust(), like=torch.zeros((), dtype=torch.float64)
    )
    actions = torch.tensor(
        np.random.default_rng(1).uniform(0.2, 0.8, (20, task.action_size)), requires_grad=True
    )

    def score(x):
        moments = judged_rollout(task, OpenLoop(x), (1, 1), *random_sources(task, 0, SEARCHED))
        return sum(moment.outcome.reward for moment in moments).sum()

    score(actions).backward()
    slope = actions.grad[7, 0].item()
    shift = torch.zeros_like(actions)
    shift[7, 0] = 1e-6
    with torch.no_grad():
        measured = (score(actions + shift) - score(actions - shift)).item() / 2e-6
    assert slope == pytest.approx(measured, rel=1e-4, abs=1e-7)


# --- the planner
# -------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "top"), [(PROVIDER, Exact()), (RATER, BestKnown())], ids=["provider", "rater"]
)
def test_planner_comes_near_the_optimum_of_a_short_game(arguments, top):
    arguments = {**arguments, "max_cycles": 6}
    best, plan = found(top, arguments), found(Planner(starts=16), arguments, budget=4_500)
    assert plan.scores.mean() > 0.98 * best.scores.mean()
    assert plan.scores.mean() <= best.bound + 1e-12
    assert 0.8 * 4_500 < plan.rounds <= 4_500


def test_without_stealth_the_best_lie_is_0():
    arguments = {**RATER, "stealth": None, "max_cycles": 6}
    zero = mean_rewards(
        exact_task(arguments), Scripted({"sr_2": BadMouthing(level=0)}), 0, (1, 1), SEARCHED
    )[0].mean()
    best = found(BestKnown(), arguments)
    assert best.scores == pytest.approx(zero, abs=1e-12)
    assert best.bound == pytest.approx(zero, abs=1e-12)
    plan = found(Planner(starts=4), arguments, budget=1_500).scores.mean()
    assert zero >= plan > 0.98 * zero


def test_planner_counts_keeps_its_budget_and_its_seed_decides():
    budgets = [Budget(2_000) for _ in range(3)]
    plans = [
        find(Planner(starts=4), CROWD, budget=budget, seed=seed, games=2).scores
        for budget, seed in zip(budgets, (3, 3, 4), strict=True)
    ]
    assert plans[0].tolist() == plans[1].tolist() != plans[2].tolist()
    assert all(0 < budget.spent <= 2_000 for budget in budgets)
    assert plans[0].mean() > found(HonestPlay(), CROWD).scores.mean()


def test_planner_leaves_torch_as_it_was():
    threads = torch.get_num_threads()
    found(Planner(starts=2), PROVIDER, budget=500)
    assert torch.get_num_threads() == threads


def test_planner_needs_some_budget_and_no_camera():
    with refuses(UnsuitableError, "300", "20"):
        found(Planner(), PROVIDER, budget=300)
    with refuses(UnsuitableError, "camera"):
        found(Planner(), {**PROVIDER, "scenario": "paper-3x3-hog", "max_cycles": 2})


# --- the optimum
# -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class OtherModel(RoleTrust):
    """Another trust model."""


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (CROWD, "exploit"),
        ({**PROVIDER, "noise": 0.1}, "noise"),
        ({**PROVIDER, "stealth": {"weight": 1.0}}, "stealth"),
        ({**PROVIDER, "trust_model": "mean"}, "role-trust"),
        ({**PROVIDER, "trust_model": OtherModel()}, "role-trust"),
        ({**PROVIDER, "trust_model": RoleTrust(lam=0.9)}, "lam"),
        ({**PROVIDER, "others": {"sr_0": BadMouthing()}}, "attackers"),
    ],
)
def test_tasks_without_a_known_optimum_are_refused(arguments, word):
    with refuses(UnsuitableError, word):
        found(Exact(), arguments)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (CROWD, ("damage",)),
        (PROVIDER, ("damage",)),
        ({**RATER, "noise": 0.1}, ("noise",)),
        ({**RATER, "trust_model": "mean"}, ("role-trust",)),
        ({**RATER, "compromised": ("sr_0", "sr_1", "sr_2")}, ("compromised", "3")),
    ],
)
def test_tasks_of_which_no_best_is_known_are_refused(arguments, words):
    with refuses(UnsuitableError, *words):
        found(BestKnown(), arguments)


def test_several_raters_have_no_bound():
    best = found(BestKnown(), {**RATER, "compromised": ("sr_0", "sr_2")})
    assert best.bound is None
    assert best.scores.mean() > found(HonestPlay(), RATER).scores.mean()
