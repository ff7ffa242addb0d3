"""Votes are read in any form, and counted as a loop counts them."""

import gzip
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses

from roletrust_baselines.panels.trials import scopes
from roletrust_baselines.panels.votes import Votes, read_votes, write_votes

CSV = """item,model,prompt,answer,truth,kind
a,gpt,plain,yes,yes,easy
a,gpt,plain,no,yes,easy
a,gpt,short,yes,yes,easy
a,llama,plain,no,,easy
b,gpt,plain,maybe,,hard
b,llama,plain,None,,hard
b,llama,plain,no,no,hard
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "votes.csv").write_text(CSV)
    return tmp_path / "votes.csv"


def test_several_votes_of_a_judge_are_one_opinion(path: Path) -> None:
    told: list[str] = []
    votes = read_votes(path, ("model", "prompt"), truth="truth", kind="kind", tell=told.append)
    assert votes.judge_names == ["gpt/plain", "gpt/short", "llama/plain"]
    assert (votes.item_names, votes.answer_names, votes.kind_names) == (
        ["a", "b"],
        ["yes", "no", "maybe"],
        ["easy", "hard"],
    )
    opinions = {
        (j, i): s.tolist()
        for j, i, s in zip(votes.judges.tolist(), votes.items.tolist(), votes.shares, strict=True)
    }
    assert opinions == {
        (0, 0): [0.5, 0.5, 0],
        (0, 1): [0, 0, 1],
        (1, 0): [1, 0, 0],
        (2, 0): [0, 1, 0],
        (2, 1): [0, 1, 0],
    }
    assert (votes.truth.tolist(), votes.kinds.tolist()) == ([0, 1], [0, 1])
    assert votes.accuracy.tolist() == [0.25, 1, 0.5]
    assert "vote in column 'answer'" in told[0]
    assert "abstentions: 1" in told[0]
    assert len(read_votes(path, ("model",)).judge_names) == 2


def test_the_same_votes_in_other_forms(path: Path, tmp_path: Path) -> None:
    expected = read_votes(path, ("model", "prompt"), truth="truth", kind="kind")
    rows = [line.split(",") for line in CSV.splitlines()]
    forms = {
        "votes.tsv": "\n".join("\t".join(row) for row in rows),
        "votes.jsonl": "\n".join(
            "{"
            + ",".join(
                f'"{name}":' + (f'"{one}"' if one else "null")
                for name, one in zip(rows[0], row, strict=True)
            )
            + "}"
            for row in rows[1:]
        ),
    }
    for name, text in forms.items():
        (tmp_path / f"{name}.gz").write_bytes(gzip.compress(text.encode()))
        found = read_votes(tmp_path / f"{name}.gz", ("model", "prompt"), truth="truth", kind="kind")
        for one, other in zip(found, expected, strict=True):
            assert np.array_equal(one, other), name


def test_white_space_at_the_ends_of_texts_does_not_count_and_is_told(tmp_path: Path) -> None:
    lines, path = list[str](), tmp_path / "votes.csv"
    path.write_text(
        "judge, item, vote, truth, kind\na,1,yes,yes,k\na , 2,yes ,\tyes,k \nb,2 , no,yes,k\n\n"
    )
    votes = read_votes(path, truth="truth", kind="kind", tell=lines.append)
    assert (votes.judge_names, votes.item_names, votes.answer_names) == (
        ["a", "b"],
        ["1", "2"],
        ["yes", "no"],
    )
    assert (
        "joined that differ only in white space at the ends or in the form of Unicode: 5."
        in lines[0]
    )


def test_truth_may_be_a_file_of_some_items(path: Path, tmp_path: Path) -> None:
    (tmp_path / "labels.csv").write_text("question,gold\nb,maybe\nelsewhere,yes\n")
    assert read_votes(path, ("model",), truth=tmp_path / "labels.csv").truth.tolist() == [-1, 2]
    (tmp_path / "labels.csv").write_text("item,truth\nb,never\n")
    with refuses(ValueError, "labels.csv", "votes.csv", "maybe"):
        read_votes(path, ("model",), truth=tmp_path / "labels.csv")


def test_truths_that_nobody_could_be_right_about_are_counted(path: Path, tmp_path: Path) -> None:
    (tmp_path / "labels.csv").write_text("item,truth\na,never\nb,no\nelsewhere,yes\n")
    told: list[str] = []
    assert read_votes(
        path, ("model",), truth=tmp_path / "labels.csv", tell=told.append
    ).truth.tolist() == [-1, 1]
    assert (
        told[1] == "Truths left out, as nobody voted on the item or nobody gave the true answer: 2."
    )
    (tmp_path / "labels.csv").write_text("name,truth\na,yes\n")
    with refuses(ValueError, "item", "truth"):
        read_votes(path, ("model",), truth=tmp_path / "labels.csv")


def test_a_kind_and_all_truths_may_be_missing(tmp_path: Path) -> None:
    (tmp_path / "votes.csv").write_text(
        "item,judge,vote,kind,truth\na,x,1,k,\nb,x,1,,\nc,x,2,l,\nc,y,2,,\n"
    )
    votes = read_votes(tmp_path / "votes.csv", kind="kind")
    assert votes.kinds.tolist() == [0, -1, 1]
    found = {
        one[:2]: one.votes.item_names for one in scopes(votes._replace(truth=np.zeros(3, np.int64)))
    }
    assert (found["k", "k"], found["k", "other"]) == (["a"], ["a", "c"])
    with refuses(ValueError, "truth"):
        read_votes(tmp_path / "votes.csv", truth="truth")


def test_texts_are_no_answers(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("roletrust_baselines.panels.votes.MEMORY", 100)
    with refuses(ValueError, "3", "6", "--vote"):
        read_votes(path, ("model",))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("item,judge,vote\na,x,\nb,x,NA\n", ("votes.csv", "2")),
        (
            "item,judge,vote,truth\na,x,1,1\na,y,1,2\n",
            ("a", "1", "2"),
        ),
        ("item,judge,vote\na,,1\n", ("2", "judge")),
        ("item,judge\na,x\n", ("vote",)),
        ("item,judge,vote\n", ("votes.csv",)),
    ],
)
def test_faults_are_named(tmp_path: Path, text: str, words: tuple[str, ...]) -> None:
    (tmp_path / "votes.csv").write_text(text)
    with refuses(ValueError, *words):
        read_votes(tmp_path / "votes.csv", truth="truth" if "truth" in text else None)


@pytest.fixture(scope="module")
def synthetic(tmp_path_factory: pytest.TempPathFactory) -> Votes:
    path = tmp_path_factory.mktemp("votes") / "votes.csv"
    write_votes(path, items=40, judges=9)
    return read_votes(path, truth="truth", kind="kind")


def test_a_tally_is_that_of_a_loop(synthetic: Votes) -> None:
    weights = np.random.default_rng(0).random(9)
    expected = np.zeros((40, 2))
    for judge, item, shares in zip(
        synthetic.judges, synthetic.items, synthetic.shares, strict=True
    ):
        expected[item] += weights[judge] * shares
    np.testing.assert_allclose(synthetic.tally(weights), expected)


def test_some_items_are_the_votes_on_them(synthetic: Votes) -> None:
    chosen = synthetic.kinds == 1
    part = synthetic.only(chosen)
    assert part.shape == (9, chosen.sum(), 2)
    np.testing.assert_allclose(part.tally(np.ones(9)), synthetic.tally(np.ones(9))[chosen])
    assert part.item_names == [
        name for name, there in zip(synthetic.item_names, chosen, strict=True) if there
    ]
