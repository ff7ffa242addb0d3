"""The study of judges: its methods on votes worked by hand, and a small run of it."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from csv_files import csv_rows

from studies import judges
from studies.judges import Votes
from studies.study import run

NO_LABEL = np.zeros(0, np.int64)
LABELS = np.array([0, 1])


@pytest.fixture
def votes() -> Votes:
    """Four items whose truth is 1. Judge 0 is right, judge 1 is wrong on the last three, judge 2 on
    all but the last, on which it does not vote."""
    judge, item, answer = np.array(
        [
            *((0, item, 1) for item in range(4)),
            *((1, item, int(item == 0)) for item in range(4)),
            *((2, item, 0) for item in range(3)),
        ]
    ).T
    return Votes(judge, item, answer, np.ones(4, np.int64))


def right(votes: Votes, method: str, labelled: np.ndarray) -> list[float]:
    return judges.right_shares(votes, judges.METHODS[method](votes, labelled)).tolist()


def test_the_majority_counts_votes_and_a_tie_counts_as_half(votes: Votes) -> None:
    assert right(votes, "majority", LABELS) == [1, 0, 0, 0.5]


def test_the_trivial_rule_follows_the_judge_with_most_right_labels(votes: Votes) -> None:
    assert right(votes, judges.TRIVIAL, LABELS) == [1, 1, 1, 1]


def test_judges_with_as_many_right_labels_vote_and_then_all_do(votes: Votes) -> None:
    assert right(votes, judges.TRIVIAL, NO_LABEL) == right(votes, "majority", NO_LABEL)
    # Judges 0 and 1 are right on item 0. They differ on item 2, where judge 2 decides, and on 3.
    assert right(votes, judges.TRIVIAL, np.array([0])) == [1, 0, 0, 0.5]


def test_labels_alone_weigh_by_the_log_odds(votes: Votes) -> None:
    # Right votes on items 0 and 1: 2, 1 and 0 of 2, so the odds are 3 to 1, 1 to 1 and 1 to 3.
    expected = [[-np.log(3), np.log(3)]] * 3 + [[0, np.log(3)]]
    np.testing.assert_allclose(judges.labels_alone(votes, LABELS), expected)
    assert right(votes, "labels alone", NO_LABEL) == [0.5] * 4


@pytest.mark.parametrize("model", ["first-hand", "yu-singh"])
def test_personal_models_believe_who_agrees_with_the_labels(votes: Votes, model: str) -> None:
    assert right(votes, model, LABELS)[2:] == [1, 1]
    assert right(votes, model, NO_LABEL) == right(votes, "majority", NO_LABEL)


def test_hits_leave_out_items_with_a_label(votes: Votes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judges, "METHODS", {"majority": judges.majority})
    found = judges.hits(votes, {2: [LABELS, LABELS + 2]})
    np.testing.assert_array_equal(
        found["majority", 2], [[np.nan, np.nan, 0, 0.5], [1, 0, np.nan, np.nan]]
    )


def test_intervals_are_paired_and_over_items_and_draws() -> None:
    rng = np.random.default_rng(0)
    rule = (rng.random((40, 300)) < 0.5).astype(float)
    found = judges.intervals(
        {(judges.TRIVIAL, 5): rule, ("same", 5): rule, ("none", 5): 0 * rule}, rng
    )
    accuracy, difference = found["same", 5]
    assert difference == (0, 0, 0)
    assert accuracy.value == pytest.approx(rule.mean())
    assert found["none", 5][1] == pytest.approx([-rule.mean(), -accuracy.high, -accuracy.low])
    # All draws are alike: only items count. All items are alike: only draws do.
    for values, size in ((np.tile(rule[0], (40, 1)), 300), (np.tile(rule[:, :1], (1, 300)), 40)):
        interval, _ = judges.intervals({(judges.TRIVIAL, 5): values}, rng)[judges.TRIVIAL, 5]
        mean = values.mean()
        half = 1.96 * np.sqrt(mean * (1 - mean) / size)
        assert interval.high - interval.low == pytest.approx(2 * half, rel=0.15)


def test_a_small_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(judges.METHODS, "mace")  # minutes
    rng = np.random.default_rng(1)
    truth = rng.integers(0, 2, 30)
    rows = [
        (item, judge, truth[item] if rng.random() < skill else 1 - truth[item])
        for item in range(30)
        for judge, skill in enumerate((0.9, 0.8, 0.6, 0.4))
    ]
    logs = tmp_path / "logs"
    for folder in ("crowd-product", "llm-judges"):
        (logs / folder).mkdir(parents=True)
    answers = pd.DataFrame(rows, columns=["question", "worker", "answer"])
    answers.to_csv(logs / "crowd-product" / "answer.csv.gz", index=False)
    pd.DataFrame({"question": range(30), "truth": truth}).to_csv(
        logs / "crowd-product" / "truth.csv.gz", index=False
    )
    models = pd.DataFrame(
        {
            "item": answers["question"],
            "model": "m" + answers["worker"].astype(str),
            "prompt": "p",
            "order": "swap = False",
            "vote": answers["answer"] + 1,
            "truth": truth[answers["question"]] + 1,
        }
    )
    swapped = models.assign(order="swap = True").iloc[1:]
    pd.concat([models, swapped]).to_csv(logs / "llm-judges" / "llmbar-votes.csv.gz", index=False)
    out = tmp_path / "out"
    run("studies.judges", ["--logs", str(logs), "--draws", "2", "--out", str(out)])
    found = {
        (row["data"], row["method"], int(row["labels"])): float(row["accuracy"])
        for row in csv_rows(out / "judges.csv")
    }
    assert len(found) == len(judges.DATA) * len(judges.METHODS) * len(judges.LABELS)
    for method in judges.METHODS:
        assert found[judges.ONE_ORDER, method, 20] == found[judges.PRODUCT, method, 20]
    answer = answers.assign(right=answers["answer"] == truth[answers["question"]])
    share = answer.groupby("question")["right"].mean()
    majority = ((share > 0.5) + 0.5 * (share == 0.5)).mean()
    assert found[judges.PRODUCT, "majority", 0] == pytest.approx(majority)
