"""The two halves of the games: one chooses the worst case, the other measures it."""

import numpy as np

from roletrust_env.evaluation.measurement import SplitScores
from roletrust_env.game.consumer import Bought


def test_the_first_half_of_the_games_chooses_and_the_second_measures() -> None:
    scores = {"utility": np.array([[0.1, 0.2, 0.8, 0.9]])}
    got = np.array([[[0.0, 0.0, 0.5, 0.25]]])  # one round, one attack, four games
    measured = SplitScores.halves(scores, Bought(got, np.ones_like(got), np.ones_like(got)))
    assert measured.chosen["utility"].tolist() == [[0.1, 0.2]]
    assert measured.measured["utility"].tolist() == [[0.8, 0.9]]
    assert measured.by_round.tolist() == [[0.375]]
