"""What the score of a trained attacker is compared with."""

import pytest

pytest.importorskip("torch")

from roletrust_agents.learned.policy import play_attacker
from roletrust_agents.training.yardsticks import best_script, known_scores
from roletrust_baselines import BadMouthing, OnOff
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.game.make_task import make_task

CERTAIN = {"scenario": "paper-3x3", "noise": 0.0, "perturbations": (), "max_cycles": 6}


def test_the_best_script_is_at_least_as_good_as_those_of_the_paper():
    for agent, objective, paper in (
        ("sp_2", "exploit", OnOff()),
        ("sr_2", "damage", BadMouthing()),
    ):
        task = make_task(**CERTAIN, compromised=(agent,), objective=objective)
        best = best_script([task], games=2, seed=0)
        assert (
            best.score >= play_attacker(task, Scripted({agent: paper}), games=2, seed=0).mean() > 0
        )
        assert best.name.startswith(f"best script ({agent}: ")


def test_no_optimum_is_known_where_there_is_noise_or_another_objective():
    task = {**CERTAIN, "compromised": ("sp_2",), "objective": "exploit"}
    assert (
        known_scores({**task, "noise": 0.1}, seed=0)
        == known_scores({**task, "objective": "mislead"}, seed=0)
        == []
    )


@pytest.mark.slow
def test_the_optimum_is_above_the_best_script_and_the_best_known_lies_are_those_of_raters():
    exploit = {**CERTAIN, "compromised": ("sp_2",), "objective": "exploit"}
    (optimum,) = known_scores(exploit, seed=0)
    assert optimum.name == "exact"
    assert best_script([make_task(**exploit)], games=1, seed=0).score < optimum.score < 1
    (lies,) = known_scores({**CERTAIN, "compromised": ("sr_2",), "objective": "damage"}, seed=0)
    assert lies.name == "best known"
