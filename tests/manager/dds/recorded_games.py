"""Recordings of simulated games."""

import numpy as np

from roletrust_env import Game, JointPolicy, Random
from roletrust_env.game.rollout import rollout
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.recording import RecordedMessage

PERIOD = 500_000_000
START = 1_000 * PERIOD


def spoken(scenario, seed=0, late=0.0, attackers=None):
    """Return the ratings of a game as recorded messages, one per rater and round; a share of them
    is too late."""
    game, random = Game(scenario), np.random.default_rng([seed, 7])
    raters, providers = game.roster.rater_names, game.roster.provider_names
    said, noise = [], Random(np.random.default_rng(seed))
    for r, one in enumerate(rollout(JointPolicy(game, attackers or {}), noise, noise)):
        for i, rater in enumerate(raters):
            row = {
                p: float(one.state.ratings[i, j])
                for j, p in enumerate(providers)
                if one.state.rated[i, j]
            }
            stamp, delay = START + r * PERIOD, 1.3 if random.random() < late else 0.1
            if row:
                raw = messages.encode(messages.ratings_message(rater, stamp, row))
                said.append(
                    RecordedMessage(
                        stamp + int(delay * PERIOD) + i, f"/{rater}/ratings", messages.RATINGS, raw
                    )
                )
    return sorted(said)
