"""Managers, and messages to them."""

import numpy as np
import pytest

from roletrust_env.trust import make_trust_model, trust_models
from roletrust_manager.admission.validation import Envelope, RatingMessage
from roletrust_manager.dds.manager import Manager
from roletrust_manager.dds.rounds import RoundTiming
from roletrust_manager.dds.team_run import grows
from roletrust_manager.dds.team_trust import replay_rounds
from roletrust_manager.journal.lines import read_journal
from roletrust_manager.team import Team

PERIOD = 500_000_000
QUICK = "role-trust", "mean", "fire", "qor"
MODELS = [
    pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in trust_models()
]
"""All trust models; two that grow and two that do not are tried in every run of the tests."""

TEAM = Team(("sr_0", "sr_1", "sr_2"), ("sp_0", "sp_1", "sp_2"))


def manager(path, *, model="role-trust", silence=3.0, **settings):
    timing = RoundTiming(PERIOD, silence=silence)
    return Manager(make_trust_model(model), path, timing=timing, **{"team": TEAM, **settings})


def replay_journal(model, path):
    """Return the trust of a journal that a trust model wrote, checked round by round."""
    team = None if grows(model) else list(read_journal(path))[-1].team
    return replay_rounds(model, read_journal(path), team, path)


def rating_message(rater, round, ratings):
    """Return a message of a round from ratings by provider."""
    return RatingMessage(Envelope(rater, PERIOD * round), tuple(ratings), tuple(ratings.values()))


def random_ratings(rounds, seed=0, lost=0.2, team=TEAM):
    """Return random ratings (R, S, P) and a mask of those that arrive; at least one does in each
    round."""
    random = np.random.default_rng(seed)
    shape = (rounds, *team.peers.shape)
    mask = random.random(shape) >= lost
    mask[:, 0, 0] |= ~mask.any(axis=(1, 2))
    return random.random(shape), mask


def feed(keeper, ratings, mask, team=TEAM, first=1, message=rating_message):
    """Return the rounds that a manager publishes, numbered from `first`, with ticks in between."""
    published = []
    for r, (row_of, heard) in enumerate(zip(ratings, mask, strict=True), first):
        for i, rater in enumerate(team.raters):
            row = {name: row_of[i, j] for j, name in enumerate(team.providers) if heard[i, j]}
            if row:
                published += keeper.receive(message(rater, r, row), PERIOD * r + 20_000_000 + i)
        for share in (0.5, 0.75, 0.9):
            published += keeper.tick(int(PERIOD * (r + share)))
    return published
