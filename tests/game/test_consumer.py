"""What consumers get who go by trust, against loops over rounds and providers."""

import math
from statistics import fmean
from typing import Any

import numpy as np
import pytest
import torch
from attack_cases import EVERY_ACCESS, busy, deeds, make, play
from refusals import refuses

from roletrust_env import Game, JointPolicy, make_scenario, record
from roletrust_env.game.consumer import buy
from roletrust_env.game.make_task import make_task
from roletrust_env.world.presence import PRESENT

SELLERS = {"compromised": ("sp_1", "srsp_2", "sp_4"), "objective": "mislead"}


def serving(game: Game, before: Any, after: Any, provider: str) -> bool:
    """Return whether a provider serves in the round between two states."""
    at = game.roster.names.index(provider)
    there = all(
        state.population is None or state.population.phase[at] == PRESENT
        for state in (before, after)
    )
    duty = game.roster.role_schedule(game.scenario.max_cycles)[1][before.round]
    return there and bool(duty[game.roster.provider_names.index(provider)])


@EVERY_ACCESS
def test_misled_is_who_went_to_the_most_trusted(access: str) -> None:
    task = make(busy(access), SELLERS)
    game, names, losses = task.game, task.game.roster.provider_names, []
    for (before, after, outcome), action in zip(play(task), deeds(task, 0), strict=True):
        qualities = dict.fromkeys(names, 1.0) | {
            "sp_1": action[0],
            "srsp_2": action[1],
            "sp_4": action[-1],
        }
        trust = dict(zip(names, game.published(before.game)[1], strict=True))
        phase = before.game.population.phase
        known = [k for k in names if serving(game, before.game, after.game, k)]
        known = [k for k in known if phase[game.roster.names.index(k)] == PRESENT]
        top = max(trust[k] for k in known)
        got = fmean(qualities[k] for k in known if trust[k] == top)
        losses.append(max(qualities[k] for k in known) - got)
        assert outcome.objective == pytest.approx(losses[-1], abs=1e-12)
    assert max(losses) > 0.01


@EVERY_ACCESS
@pytest.mark.parametrize("model", ["role-trust", "qor"])
def test_each_honest_rater_goes_by_what_it_knows(access: str, model: str) -> None:
    task = make(busy(access), {**SELLERS, "consumers": "raters", "trust_model": model})
    game, roster, losses = task.game, task.game.roster, []
    attacked = {*task.identities, *task.joint_policy.attackers}
    for (before, after, outcome), action in zip(play(task), deeds(task, 0), strict=True):
        qualities = dict.fromkeys(roster.provider_names, 1.0) | {
            "sp_1": action[0],
            "srsp_2": action[1],
            "sp_4": action[-1],
        }
        state, phase = (
            before.game,
            dict(zip(roster.names, before.game.population.phase, strict=True)),
        )
        bought = []
        for i, rater in enumerate(roster.rater_names):
            if rater in attacked or phase[rater] != PRESENT:
                continue
            own = game.published(state)[1] if model == "role-trust" else state.trust.trust[i]
            trust = dict(zip(roster.provider_names, own, strict=True))
            known = [
                k
                for k in trust
                if k != rater and phase[k] == PRESENT and serving(game, state, after.game, k)
            ]
            most = [qualities[k] for k in known if trust[k] == max(trust[k] for k in known)]
            bought.append((fmean(most), max(qualities[k] for k in known)) if known else (0.0, 0.0))
        losses.append(fmean(best - got for got, best in bought) if bought else 0.0)
        assert outcome.objective == pytest.approx(losses[-1], abs=1e-12)
    assert max(losses) > 0.01


def test_without_honest_raters_nobody_consumes() -> None:
    with refuses(ValueError, "consumers"):
        make_task("paper-3x3", ("sr_0", "sr_1", "sr_2"), consumers="raters")


def test_what_is_offered_does_not_depend_on_who_comes() -> None:
    """Ability times the chosen quality, also where nobody came and nothing was delivered."""
    game = Game(make_scenario("market").change(max_cycles=30))
    history = record(JointPolicy(game, {}), game.random(0), (4,))
    came = history.served.any(axis=1)
    assert not came.all()
    assert np.array_equal(history.quality[came], history.offered[came])
    assert (history.quality[~came] == 0).all()
    assert (history.offered == history.offered[0]).all()  # each has its ability, and is honest


def test_who_does_not_serve_or_is_not_known_counts_for_nothing() -> None:
    nowhere = math.nan
    bought = buy(np.array([nowhere, 0.4, 0.8, 0.8]), np.array([1.0, 0.9, nowhere, 0.5]))
    assert bought == (0.5, 0.9, pytest.approx(0.7))
    assert buy(np.array([nowhere]), np.array([1.0])) == (0, 0, 0)


def test_a_consumer_is_the_same_on_torch_and_in_batches() -> None:
    random = np.random.default_rng(0)
    trust, offered = random.integers(0, 4, (2, 6, 5, 7)) / 3
    trust[random.random(trust.shape) < 0.2] = math.nan
    many = buy(trust, offered, axis=1)
    for name, row in many._asdict().items():
        assert np.array_equal(row[2], getattr(buy(trust[2], offered[2]), name))
        on_torch = getattr(buy(torch.tensor(trust), torch.tensor(offered), axis=1), name)
        assert np.allclose(on_torch.numpy(), row, atol=1e-15)


def test_an_absent_provider_is_not_chosen_where_nobody_is_trusted() -> None:
    assert buy(np.array([0.0, np.nan]), np.array([0.5, np.nan])).got == 0.5
