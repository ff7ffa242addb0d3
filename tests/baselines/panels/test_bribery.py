"""Bought judges vote as their bribe says, and nobody else does anything."""

import numpy as np
import pytest
from panel_cases import votes_of

from roletrust_baselines.panels.bribery import Bribe, bribed, chosen, worst_bribe
from roletrust_baselines.panels.trials import draws, judge, scopes
from roletrust_baselines.panels.verdicts import Majority, make_method
from roletrust_baselines.panels.votes import Votes


@pytest.fixture(scope="module")
def votes() -> Votes:
    rng = np.random.default_rng(0)
    truth = rng.integers(0, 3, 30)
    skill = np.linspace(0.3, 0.95, 8)[:, None]
    return votes_of(np.where(rng.random((8, 30)) < skill, truth, rng.integers(0, 3, (8, 30))), truth)


def test_a_plain_lie_is_wrong_everywhere_and_leaves_others_alone(votes: Votes) -> None:
    judges = np.array([2, 5])
    found = bribed(votes, judges, Bribe())
    bought = np.isin(votes.judges, judges)
    assert np.array_equal(found.shares[~bought], votes.shares[~bought])
    assert (found.shares[bought, votes.truth[votes.items[bought]]] == 0).all()
    together = found.shares[bought].reshape(2, 30, 3)
    assert np.array_equal(together[0], together[1])


@pytest.mark.parametrize("elsewhere", ["own", "truth", "majority"])
def test_lies_are_told_in_the_window_alone(votes: Votes, elsewhere: str) -> None:
    judges, bribe = np.array([0, 7]), Bribe("best", 0.1, 0.6, elsewhere)  # type: ignore[arg-type]
    found = bribed(votes, judges, bribe)
    others = votes.tally(np.isin(np.arange(8), judges, invert=True).astype(float))
    for row in np.flatnonzero(np.isin(votes.judges, judges)):
        item = votes.items[row]
        wrong = np.delete(np.arange(3), votes.truth[item])
        lead = (others[item, votes.truth[item]] - others[item, wrong].max()) / others[item].sum()
        said = found.shares[row].argmax()
        if 0.1 <= lead <= 0.6:
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


def test_a_longer_search_is_never_better_for_the_panel(votes: Votes) -> None:
    scope, method = scopes(votes)[0], make_method("first-hand")
    labelled = draws(scope, 5, 2, 0)
    honest = judge(scope, method, labelled)["accuracy"].value
    found = [worst_bribe(scope, method, 3, labelled, budget)[0].value for budget in (1, 4, 16)]
    assert honest > found[0] >= found[1] >= found[2]
    assert worst_bribe(scope, Majority(), 8, draws(scope, 0, 1, 0), 1)[0].value == 0
    assert worst_bribe(scope, method, 3, labelled, 16) == worst_bribe(scope, method, 3, labelled, 16)
