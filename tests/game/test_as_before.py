"""What was played before agents differed and before there were two dozen trust models is played
still.

The numbers are of version 0.1.0, in which every game here was the same to the last bit; they are
compared to what machines may differ by.
"""

import pytest

from roletrust_agents.learned.policy import play_task
from roletrust_agents.learned.saved import load_attacker
from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import Game, JointPolicy, make_scenario, record

FIGURES = {
    ("paper-3x3", "role-trust"): (0.45406375614187755, 0.41239708947521087),
    ("paper-3x3", "mean"): (0.8411276902349856, 0.7994610235683189),
    ("crowd-10x10", "role-trust"): (0.7003768829075986, 0.6528768829075986),
    ("crowd-10x10", "mean"): (0.946032163274726, 0.8985321632747258),
    ("robots-that-move", "role-trust"): (0.7619254969011938, 0.7167866080123049),
    ("robots-that-move", "mean"): (0.9338773573387275, 0.8887384684498385),
    ("open-system", "role-trust"): (0.736660211491525, 0.678564973396287),
    ("open-system", "mean"): (0.8856981334014736, 0.82710024980359),
    ("peers", "role-trust"): (0.7649185014543295, 0.6871407236765517),
    ("peers", "mean"): (0.9498749344384485, 0.8720971566606708),
}
"""Mean trust and mean reward in three games of 60 rounds, under an on-off provider and a
bad-mouthing rater."""


@pytest.mark.parametrize(("preset", "trust_model"), FIGURES)
def test_every_preset_plays_as_before(preset: str, trust_model: str) -> None:
    game = Game(make_scenario(preset).change(max_cycles=60), trust_model)
    first, last = game.roster.provider_names[0], game.roster.rater_names[-1]
    history = record(
        JointPolicy(game, {first: OnOff(period=4), last: BadMouthing(start=5)}),
        game.random(0),
        (3,),
    )
    found = history.trust.mean(), history.rewards.mean()
    assert found == pytest.approx(FIGURES[preset, trust_model], abs=1e-9)


@pytest.mark.parametrize(
    ("name", "score"),
    [
        ("collusion-10x10", 0.39031471718102695),
        ("provider-3x3", 0.2399201817708672),
        ("rater-3x3", 0.4882214814424515),
    ],
)
def test_every_saved_attacker_plays_as_before(name: str, score: float) -> None:
    attacker = load_attacker(name)
    found = play_task(attacker.task(), attacker.network, games=4, seed=0).mean()
    assert found == pytest.approx(score, abs=1e-6)  # its network is in single precision
