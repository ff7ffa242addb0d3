"""The gap of identities: none while they wait in reserve, and kept once they are gone."""

import numpy as np
import pytest

from roletrust_env import Game, Scenario
from roletrust_env.game.attacker_side import AttackerSide
from roletrust_env.world.presence import CUT_OFF, LEFT, PRESENT, WAITING

SCENARIO = Scenario(
    agents=[{"role": "SR", "count": 2}, {"role": "SP", "count": 2}, {"role": "SP", "reserve": 1}]
)


@pytest.mark.parametrize(
    ("first", "second", "gap"),
    [(PRESENT, WAITING, 0.2), (LEFT, PRESENT, 0.6), (CUT_OFF, LEFT, 0.6), (LEFT, WAITING, 0.2)],
)
def test_a_gap_stays_when_an_identity_is_gone(first: int, second: int, gap: float) -> None:
    game = Game(SCENARIO)
    roster = game.roster
    side = AttackerSide(roster, ["sp_2"], list(roster.names), game.like)
    top = np.array(
        [0.9, 0.7, 0.6, 0.2]
    )  # of two honest providers, and of the two identities of the third
    phase = np.array([PRESENT] * roster.n_agents)
    phase[roster.names.index("sp_2")], phase[roster.names.index("sp_3")] = first, second
    present = phase == PRESENT
    there = roster.raters(present), roster.providers(present)
    assert side.gap((np.ones(2), top), there, phase, tolerance=0.0).tolist() == pytest.approx([gap])
