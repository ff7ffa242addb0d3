"""Coalitions of raters, against slow copies of their rules, for one agent and one game at a
time."""

import dataclasses

import numpy as np
import pytest
import torch

from roletrust_baselines import (
    CheatingRing,
    Promotion,
    RankLies,
    ReviewBurst,
    ShiftedLies,
    SlanderUnmet,
    Sleeper,
    SwapEnds,
)
from roletrust_env import Game, JointPolicy, make_scenario, record
from roletrust_env.game.views import RaterView
from roletrust_env.randomness import Random

P, ROUNDS = 6, 8
SHAPE = (P, 2, 3)  # providers, raters, games

COALITIONS = [
    RankLies(),
    RankLies(best=0.2, worst=0.9, bend=0.5, by="published", start=2, stop=6),
    RankLies(best=1.0, worst=0.0, accomplices=(1, 4)),
    Promotion(),
    Promotion(place=0.7, lift=0.5, sink=0.3, accomplices=(0,)),
    Promotion(place=1.0, by="published"),
    ShiftedLies(),
    ShiftedLies(shift=0.4, place=0.0, by="published", start=2),
    ShiftedLies(shift=0.3, place=1.0, accomplices=(1, 4)),
    SlanderUnmet(),
    SlanderUnmet(low=0.2, accomplices=(1, 4), start=1, stop=7),
    SwapEnds(),
    SwapEnds(sink=0.6, lift=0.5, by="published", start=1, stop=7),
    SwapEnds(accomplices=(1, 4)),
    CheatingRing(accomplices=(2, 5), cut=0.3, sink=0.8),
    CheatingRing(accomplices=(0,), cut=1.0, start=3),
    ReviewBurst(burst=2, every=3, start=1),
    Sleeper(start=2, wakes_at=0.6),
    Sleeper(start=0, wakes_at=0.9, stop=7),
]


def views(seed, rounds=ROUNDS):
    rng, found = np.random.default_rng(seed), []
    for round in range(rounds):
        awaiting = rng.random(SHAPE) < 0.6
        service = np.round(rng.random(SHAPE), 1) * awaiting  # with ties
        published = np.round(rng.random(SHAPE), 1)
        trust = rng.random(SHAPE[1:])
        found.append(
            RaterView(
                np.full(SHAPE[1:], float(round)),
                trust,
                published,
                service,
                awaiting,
                service,
                awaiting,
            )
        )
    return found


def ratings(policy, seen, like=None):
    random = Random(np.random.default_rng(0), like)
    memory, found = policy.begin(random, tuple(seen[0].trust.shape)), []
    for view in seen:
        given, memory = policy.ratings(view, memory, random)
        found.append(given)
    return found


def slow_rating(policy, estimates, rank, j, met):
    """The rating of one provider, by the rule in the docstring of the attack."""
    if policy.accomplices is not None and j in policy.accomplices:
        return 1.0
    if isinstance(policy, SlanderUnmet):
        return estimates[j] if met else policy.low
    if isinstance(policy, CheatingRing):
        return estimates[j] * (1 - policy.sink) if rank[j] <= policy.cut else estimates[j]
    if isinstance(policy, Promotion):
        nearest = min(rank.values(), key=lambda r: (round(abs(r - policy.place), 9), r))
        if rank[j] == nearest:
            return estimates[j] + policy.lift * (1 - estimates[j])
        return estimates[j] * (1 - policy.sink) if rank[j] < nearest else estimates[j]
    if isinstance(policy, ShiftedLies):
        if rank[j] < policy.place:
            return max(0.0, estimates[j] - policy.shift)
        return min(1.0, estimates[j] + policy.shift)
    if isinstance(policy, SwapEnds):
        ends = {
            0.0: estimates[j] * (1 - policy.sink),
            1.0: estimates[j] + policy.lift * (1 - estimates[j]),
        }
        return ends.get(rank[j], estimates[j])
    return policy.best + (policy.worst - policy.best) * rank[j] ** policy.bend


def slow_ratings(policy, seen, rater, game):
    """The ratings of one rater in one game, provider by provider."""
    perceived, awake, found = {j: [] for j in range(P)}, False, []
    for t, view in enumerate(seen):
        for j in range(P):
            if view.awaiting[j, rater, game]:
                perceived[j].append(view.service[j, rater, game])
        published = view.published[:, rater, game].tolist()
        estimates = [
            float(np.mean(perceived[j])) if perceived[j] else published[j] for j in range(P)
        ]
        value = [round(x, 6) for x in (estimates if policy.by == "perceived" else published)]
        others = [j for j in range(P) if j not in (policy.accomplices or ())]
        rank = {}
        for j in others:
            better = sum(value[k] > value[j] for k in others)
            equal = sum(value[k] == value[j] for k in others) - 1
            rank[j] = (better + equal / 2) / (len(others) - 1)
        lies = t >= policy.start and (policy.stop is None or t < policy.stop)
        if isinstance(policy, ReviewBurst):
            lies = lies and (t - policy.start) % policy.every < policy.burst
        if isinstance(policy, Sleeper):
            awake = awake or (lies and view.trust[rater, game] >= policy.wakes_at)
            lies = awake and (policy.stop is None or t < policy.stop)
        found.append(
            [
                slow_rating(policy, estimates, rank, j, bool(perceived[j]))
                if lies
                else estimates[j]
                for j in range(P)
            ]
        )
    return found


@pytest.mark.parametrize("policy", COALITIONS, ids=repr)
def test_it_rates_as_a_slow_copy_of_its_rule(policy):
    for seed in (0, 1):
        seen = views(seed)
        given = np.stack(ratings(policy, seen))
        assert given.min() >= 0
        assert given.max() <= 1
        for rater, game in np.ndindex(SHAPE[1:]):
            assert given[..., rater, game] == pytest.approx(
                np.array(slow_ratings(policy, seen, rater, game))
            ), seed


@pytest.mark.parametrize("policy", COALITIONS, ids=repr)
def test_agents_and_games_are_not_mixed_and_torch_plays_like_numpy(policy):
    seen = views(2)
    given = np.stack(ratings(policy, seen))
    alone = ratings(policy, [RaterView(*(field[..., 1, 2] for field in view)) for view in seen])
    assert np.stack(alone) == pytest.approx(given[..., 1, 2], abs=1e-12)
    tensors = [RaterView(*(torch.asarray(field) for field in view)) for view in seen]
    on_torch = ratings(policy, tensors, torch.zeros((), dtype=torch.float64))
    assert torch.stack(on_torch).numpy() == pytest.approx(given, abs=1e-12)


@pytest.mark.parametrize("policy", COALITIONS, ids=repr)
def test_the_order_of_the_providers_does_not_matter(policy):
    seen, order = views(3), np.random.default_rng(3).permutation(P)
    where = np.argsort(order)
    own = None if policy.accomplices is None else tuple(int(where[j]) for j in policy.accomplices)
    moved = dataclasses.replace(policy, accomplices=own)
    shuffled = [
        RaterView(*(field[order] if field.ndim == 3 else field for field in view)) for view in seen
    ]
    assert np.stack(ratings(moved, shuffled)) == pytest.approx(
        np.stack(ratings(policy, seen))[:, order], abs=1e-12
    )


def test_half_of_the_raters_turn_the_order_of_the_providers_around():
    """In a plain mean: without noise the best of six has (1 + 0) / 2, the worst (0.5 + 1) / 2."""
    scenario = make_scenario("crowd-10x10").change(
        agents=[
            {"role": "SR", "count": 4},
            *({"role": "SP", "ability": 1 - 0.1 * j} for j in range(6)),
        ],
        max_cycles=30,
    )
    game = Game(scenario, "mean")
    history = record(
        JointPolicy(game, dict.fromkeys(("sr_0", "sr_1"), RankLies(bend=1.0))), game.random(0)
    )
    assert history.top[-1] == pytest.approx([(1 - 0.1 * j + j / 5) / 2 for j in range(6)], abs=1e-6)


def test_a_liar_without_noise_looks_better_than_an_honest_rater():
    scenario = make_scenario("crowd-10x10").change(noise=0.1, max_cycles=40)
    game = Game(scenario, "role-trust")
    asleep = record(JointPolicy(game, {"sr_0": Sleeper(start=100)}), game.random(0), (20,))
    assert asleep.tor[-1, 0].mean() > asleep.tor[-1, 1:].mean() + 0.02


def test_promotion_lifts_one_provider_above_the_better_ones_and_is_honest_about_the_rest():
    service = np.array([0.9, 0.5, 0.7, 0.3, 0.6, 0.4])
    view = RaterView(
        np.zeros(()), np.zeros(()), service, service, service > 0, service, service > 0
    )
    given = {
        place: ratings(Promotion(place=place), [view])[0].tolist() for place in (0.0, 0.5, 0.6, 1.0)
    }
    assert given[0.0] == [1, 0.5, 0.7, 0.3, 0.6, 0.4]
    assert given[0.5] == [0, 0.5, 0, 0.3, 1, 0.4]  # two are as near, the better one is promoted
    assert given[0.6] == [0, 1, 0, 0.3, 0, 0.4]
    assert given[1.0] == [0, 0, 0, 1, 0, 0]


@pytest.mark.parametrize(
    ("service", "given"),
    [
        ([0.9, 0.5, 0.7, 0.3, 0.6, 0.4], [0, 0.5, 0.7, 1, 0.6, 0.4]),
        ([0.9, 0.9, 0.7, 0.3, 0.6, 0.4], [0.9, 0.9, 0.7, 1, 0.6, 0.4]),
        ([0.9, 0.3, 0.7, 0.3, 0.6, 0.4], [0, 0.3, 0.7, 0.3, 0.6, 0.4]),
        ([0.5, 0.5], [0.5, 0.5]),
        ([0.2, 0.4], [1, 0]),
    ],
)
def test_the_ends_are_swapped_unless_they_are_shared(service, given):
    service = np.array(service)
    view = RaterView(
        np.zeros(()), np.zeros(()), service, service, service > 0, service, service > 0
    )
    assert ratings(SwapEnds(), [view])[0].tolist() == given
