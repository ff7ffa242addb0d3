"""Bought judges vote as their bribe says, and nobody else does anything."""

from typing import Any

import numpy as np
import pytest
from panel_cases import votes_of

from roletrust_baselines.panels.bribery import Bribe, bribed, chosen, find_bribe
from roletrust_baselines.panels.trials import accuracy, draws, judge, scopes
from roletrust_baselines.panels.verdicts import Majority, log_odds, make_method
from roletrust_baselines.panels.votes import Votes


@pytest.fixture(scope="module")
def votes() -> Votes:
    rng = np.random.default_rng(0)
    truth = rng.integers(0, 3, 30)
    skill = np.linspace(0.3, 0.95, 8)[:, None]
    return votes_of(
        np.where(rng.random((8, 30)) < skill, truth, rng.integers(0, 3, (8, 30))), truth
    )


def test_a_plain_lie_is_wrong_everywhere_and_leaves_others_alone(votes: Votes) -> None:
    judges = chosen(votes, 2, "random", 4)
    found = bribed(votes, judges, Bribe("random"))
    bought = np.isin(votes.judges, judges)
    assert np.array_equal(found.shares[~bought], votes.shares[~bought])
    assert (found.shares[bought, votes.truth[votes.items[bought]]] == 0).all()
    together = found.shares[bought].reshape(2, 30, 3)
    assert np.array_equal(together[0], together[1])


@pytest.mark.parametrize(("elsewhere", "honest"), [("own", 0.0), ("truth", 0.0), ("majority", 0.5)])
def test_lies_are_told_in_the_window_alone(votes: Votes, elsewhere: Any, honest: float) -> None:
    judges, bribe = chosen(votes, 2, "best"), Bribe("best", 0.1, 0.6, elsewhere, honest=honest)
    found = bribed(votes, judges, bribe)
    others = votes.tally(np.isin(np.arange(8), judges, invert=True).astype(float))
    for row in np.flatnonzero(np.isin(votes.judges, judges)):
        item = votes.items[row]
        wrong = np.delete(np.arange(3), votes.truth[item])
        lead = (others[item, votes.truth[item]] - others[item, wrong].max()) / others[item].sum()
        said = found.shares[row].argmax()
        if 0.1 <= lead <= 0.6 and item >= 30 * honest:
            assert said != votes.truth[item]
            assert others[item, said] == others[item, wrong].max()
        elif elsewhere == "own":
            assert np.array_equal(found.shares[row], votes.shares[row])
        else:
            assert said == (votes.truth[item] if elsewhere == "truth" else others[item].argmax())


def test_judges_are_chosen_by_accuracy_or_likeness(votes: Votes) -> None:
    order = np.argsort(votes.accuracy, kind="stable")
    assert set(chosen(votes, 2, "worst")) == set(order[:2])
    assert set(chosen(votes, 2, "best")) == set(order[-2:])
    assert len(set(chosen(votes, 5, "random", 3))) == 5
    twins = votes_of([[0, 1, 0, 1], [0, 0, 1, 1], [0, 0, 1, 1], [0, 0, 1, 0]], [0, 0, 0, 0])
    assert set(chosen(twins, 2, "kindred")) == {1, 2}


def test_known_judges_count_as_they_are_right(votes: Votes) -> None:
    """Lies where the truth leads by log-odds are told elsewhere than where it leads by number."""
    judges = chosen(votes, 2, "best")
    equal, known = (
        bribed(votes, judges, Bribe("best", 0.0, 1.0, "own", share)) for share in (0.0, 1.0)
    )
    odds = log_odds(votes.accuracy, votes.shape[2])
    odds[judges] = 0
    tally = votes.tally(odds)
    rows = np.isin(votes.judges, judges)
    for item in range(30):
        ahead = tally[item, votes.truth[item]] >= np.delete(tally[item], votes.truth[item]).max()
        said = known.shares[rows & (votes.items == item)]
        assert not ahead or (said[:, votes.truth[item]] == 0).all()
    assert not np.array_equal(equal.shares, known.shares)


def test_a_longer_search_is_never_better_for_the_panel(votes: Votes) -> None:
    scope, method = scopes(votes)[0], make_method("first-hand")
    labelled = draws(scope, 5, 2, 0)

    def least(budget: int, starts: tuple[Bribe, ...] = ()) -> float:
        bribe = find_bribe(scope, method, 3, labelled, budget, starts=starts)
        return accuracy(
            scope, bribed(votes, chosen(votes, 3, bribe.choice), bribe), method, labelled
        ).value

    found = [least(budget) for budget in (1, 4, 16)]
    assert judge(scope, method, labelled)["accuracy"].value > found[0] >= found[1] >= found[2]
    best = find_bribe(scope, method, 3, labelled, 16)
    assert least(4, (best,)) <= found[2]
    assert find_bribe(scope, method, 3, labelled, 0, starts=[best]) == best
    all_lie = bribed(votes, np.arange(8), Bribe())
    assert accuracy(scope, all_lie, Majority(), draws(scope, 0, 1, 0)).value == 0
