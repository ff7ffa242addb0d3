"""Agents that judge one another: their ratings, their ranking against people, and bought judges."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses

from roletrust_baselines.panels.peers import (
    BradleyTerry,
    Comparisons,
    PeersByTrust,
    WinRate,
    against_people,
    judges_to_win,
    make_peer_method,
    promoted,
    read_comparisons,
)
from roletrust_env.trust import make_trust_model
from roletrust_env.trust.run import make_run

CSV = """judge,question,model_a,model_b,winner
x,1,x,y,model_a
y,1,x,y,tie (bothbad)
z,2,y,z,z
x,1,y,z,A
human,1,x,y,2
human,2,w,y,model_a
x,2,x,z,
"""
NONE = [np.zeros(0, np.int64)]


def test_votes_have_many_forms(tmp_path: Path) -> None:
    (tmp_path / "votes.csv").write_text(CSV)
    votes, people = read_comparisons(tmp_path / "votes.csv", item="question")
    assert votes.agents == ["x", "y", "z"]
    assert votes.values.tolist() == [1, 0.5, 1, 0]
    assert (votes.judges.tolist(), votes.items.tolist()) == ([0, 1, 0, 2], [0, 0, 0, 1])
    assert people is not None
    assert (people.first.tolist(), people.values.tolist()) == (
        [0],
        [0],
    )  # nobody compares w but people
    assert votes.win_rate.tolist() == [0.75, 0.375, 0.5]
    (tmp_path / "votes.csv").write_text(
        CSV.replace("human,1", "expert_0,1").replace("human,2", "expert_1,2")
    )
    experts = read_comparisons(tmp_path / "votes.csv", item="question", people="expert_*")[1]
    assert experts is not None
    assert experts.values.tolist() == people.values.tolist()


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("x,1,y,y,tie", ("vote", "1", "y")),
        ("x,1,x,y,w", ("vote", "1", "w")),
        ("human,1,x,y,tie", ("human",)),
    ],
)
def test_faults_are_named(tmp_path: Path, row: str, words: tuple[str, ...]) -> None:
    (tmp_path / "votes.csv").write_text(f"judge,item,first,second,vote\n{row}\n")
    with refuses(ValueError, *words):
        read_comparisons(tmp_path / "votes.csv")


@pytest.fixture(scope="module")
def votes() -> Comparisons:
    """Five agents of falling quality; the last judge is contrary."""
    rng, rows = np.random.default_rng(0), []
    for item, judge, (one, other) in itertools.product(
        range(20), range(5), itertools.combinations(range(5), 2)
    ):
        better = float(rng.random() < 0.8)
        rows.append((judge, item, one, other, 1 - better if judge == 4 else better))
    judges, items, first, second, values = (np.array(column) for column in zip(*rows, strict=True))
    names = list("abcde")
    return Comparisons(judges, items, first, second, values, names, [f"{n}" for n in range(20)])


def test_trust_is_that_of_rounds_by_hand(votes: Comparisons) -> None:
    model = make_trust_model("role-trust")
    run = make_run(model, (5, 5), one_role=False)
    for item in range(20):
        ratings: dict[tuple[int, int], list[float]] = {}
        for judge, first, second, value in zip(
            *votes.at(votes.items == item)[:1], *votes.at(votes.items == item)[2:5], strict=True
        ):
            for author, rating in ((first, value), (second, 1 - value)):
                if author != judge:
                    ratings.setdefault((int(judge), int(author)), []).append(float(rating))
        pairs = np.array(list(ratings))
        run.play(pairs[:, 0], pairs[:, 1], np.array([np.mean(one) for one in ratings.values()]))
    found = PeersByTrust(model)(votes)
    assert found.tor is not None
    assert found.toa is not None
    np.testing.assert_allclose(found.score, run.provider_trust)
    np.testing.assert_allclose(found.tor, run.rater_trust)
    given = 20 * 20 - 20 * 4  # a judge sees each pair, and rates both but itself
    assert found.toa == pytest.approx((given * found.tor + given * found.score) / (2 * given))
    assert found.tor[4] == found.tor.min()


def test_agreement_leaves_own_votes_out(votes: Comparisons) -> None:
    people = votes.at(votes.judges == 0)
    found = against_people(votes, people, WinRate(), NONE)
    decided = people.first < people.second  # the first of a pair is the better one
    assert found["agreement"].value == pytest.approx(people.values[decided].mean())
    own = [np.arange(len(people.judges) - 1)]
    last = against_people(votes, people, PeersByTrust(make_trust_model("first-hand")), own)
    assert last["agreement"].value in (0, 1)  # a single vote is left
    assert "spearman" in found
    assert "spearman" not in last  # people's win rates have the own votes


def test_bought_judges_promote_and_the_least_number_is_that_of_all_sets(votes: Comparisons) -> None:
    bought = promoted(votes, np.array([0, 1]), 4, 0)
    assert np.array_equal(bought.values[votes.judges > 1], votes.values[votes.judges > 1])
    rows = (votes.judges < 2) & ((votes.first == 4) | (votes.second == 4))
    assert np.array_equal(bought.values[rows] == 1, bought.first[rows] == 4)
    method = WinRate()
    for target in range(5):
        expected = next(
            (
                number
                for number in range(6)
                for judges in itertools.combinations(range(5), number)
                for rival in (None, 0)
                if method(
                    promoted(votes, np.array(judges, int), target, rival) if number else votes
                ).score.argmax()
                == target
            ),
            None,
        )
        assert judges_to_win(votes, method, target) == expected


@pytest.mark.slow
def test_bradley_terry_needs_its_library_and_ranks_by_strength(
    votes: Comparisons, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr("roletrust_baselines.panels.peers.find_spec", lambda name: None)
        with refuses(ValueError, "bradley-terry", "crowd-kit"):
            make_peer_method("bradley-terry")
    pytest.importorskip("crowdkit", reason="needs crowd-kit: pip install 'roletrust-env[crowd]'")
    assert (
        BradleyTerry()(votes).score.argsort().tolist() == WinRate()(votes).score.argsort().tolist()
    )
