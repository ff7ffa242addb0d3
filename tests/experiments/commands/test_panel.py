"""`roletrust panel`: its files and messages, of votes on items and of agents that judge one
another."""

from pathlib import Path

import pytest
from command_line import printed, run
from csv_files import csv_rows
from refusals import assert_names


@pytest.fixture(scope="module")
def votes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = tmp_path_factory.mktemp("votes") / "votes.csv"
    printed("panel", path, "--synthetic", "--out", path.parent / "out")
    return path


def test_a_few_labels_decide_whom_to_trust_and_the_verdicts(votes: Path, tmp_path: Path) -> None:
    truth = {row["item"]: row["truth"] for row in csv_rows(votes)}
    some = dict(list(truth.items())[:20])
    (tmp_path / "labels.csv").write_text(
        "item,truth\n" + "".join(f"{item},{one}\n" for item, one in some.items())
    )
    right = {}
    for name, more in (("labels", ["--truth", str(tmp_path / "labels.csv")]), ("none", [])):
        result = run("panel", votes, *more, "--out", tmp_path / name)
        assert max(map(len, result.output.splitlines()[1:-1])) <= 80
        verdicts = csv_rows(tmp_path / name / "verdicts.csv")
        judges = csv_rows(tmp_path / name / "judges.csv")
        right[name] = sum(
            row["verdict"] == truth[row["item"]] for row in verdicts if row["item"] not in some
        )
        assert sum(row["truth"] != "" for row in verdicts) == (20 if more else 0)
        trust = [float(row["trust"]) for row in judges]
        assert trust == sorted(trust, reverse=True)
        assert len(judges) == 30
    assert right["labels"] > right["none"] + 20


def test_methods_are_measured_and_attacked(votes: Path, tmp_path: Path) -> None:
    more = [
        "--truth",
        "truth",
        "--kind",
        "kind",
        "--labels",
        "0",
        "--labels",
        "5",
        "--draws",
        "3",
        "--bribes",
        "5",
    ]
    result = printed(
        "panel", votes, *more, "--method", "majority", "--method", "first-hand", "--out", tmp_path
    )
    assert "With 5 own labels, first-hand is right in" in result
    rows = csv_rows(tmp_path / "measures.csv")
    assert {row["scored"] for row in rows} == {"all", "easy", "hard"}
    attacked = {
        (row["method"], row["labels"], row["bought"]): float(row["value"])
        for row in rows
        if row["bribe"]
    }
    assert attacked["majority", "0", "10"] < attacked["first-hand", "5", "10"]
    page = (tmp_path / "panel.md").read_text()
    for row in rows:
        assert row["measure"] == "spearman" or f"{float(row['value']):.3f}" in page
    assert (tmp_path / "panel.png").stat().st_size > 10_000


def test_agents_that_judge_one_another(tmp_path: Path) -> None:
    rows = [
        (judge, item, one, other, "tie" if (item + int(judge == "b")) % 5 == 0 else "first")
        for item in range(12)
        for judge in ("a", "b", "c", "human")
        for one, other in (("a", "b"), ("a", "c"), ("b", "c"))
    ]
    path = tmp_path / "votes.csv"
    path.write_text(
        "judge,item,first,second,vote\n" + "".join(",".join(map(str, row)) + "\n" for row in rows)
    )
    numbers = ("--bribes", 5, "--labels", 0, "--labels", 4, "--draws", 2)
    methods = ("--method", "win-rate", "--method", "role-trust", "--method", "first-hand")
    printed("panel", path, "--peers", "--measure", *numbers, *methods, "--out", tmp_path / "out")
    assert [row["agent"] for row in csv_rows(tmp_path / "out" / "agents.csv")] == ["a", "b", "c"]
    measures = csv_rows(tmp_path / "out" / "measures.csv")
    assert {
        row["value"] for row in measures if row["measure"] == "agreement" and row["own"] == "0"
    } == {"1.000000"}
    win = {
        row["agent"]: float(row["value"])
        for row in measures
        if row["measure"] == "to win" and row["method"] == "win-rate"
    }
    assert win["a"] == 0 < win["b"]


def test_judges_without_answers_have_a_tor_and_names_stand_as_they_are(tmp_path: Path) -> None:
    names = ("k", "[b]l|", "m")
    rows = [
        (judge, item, "[b]a|", "c", "first") for judge in (*names, "human") for item in range(4)
    ]
    path = tmp_path / "votes.csv"
    path.write_text(
        "judge,item,first,second,vote\n" + "".join(",".join(map(str, row)) + "\n" for row in rows)
    )
    more = [
        "--measure",
        "--bribes",
        "2",
        "--method",
        "role-trust",
        "--labels",
        "0",
        "--labels",
        "4",
    ]
    result = printed("panel", path, "--peers", *more, "--out", tmp_path / "out")
    assert "method [b]a| c" in result
    assert "| method | [b]a&#124; | c |" in (tmp_path / "out" / "panel.md").read_text()
    assert "left out: 4 labels, since there are 4 votes of people" in result
    found = csv_rows(tmp_path / "out" / "agents.csv")
    assert [row["agent"] for row in found[:2]] == ["[b]a|", "c"]
    assert {row["agent"]: row["ToP"] for row in found[2:]} == dict.fromkeys(names, "")
    assert all(row["ToR"] for row in found)
    path.write_text(path.read_text().replace("c,first", "c,tie"))
    result = run("panel", str(path), "--peers", "--measure", "--out", str(tmp_path / "out"))
    assert "votes of people ('human', --people) on these agents, not only ties" in " ".join(
        result.output.split()
    )


def test_what_is_missing_is_said(votes: Path, tmp_path: Path) -> None:
    for arguments, words in (
        (["--measure"], ("--truth",)),
        (["--truth", "gold"], ("gold",)),
        (["--peers"], ("first",)),
        (["--method", "majorities"], ("majorities",)),
        (["--peers", "--judge", "judge", "--judge", "kind"], ("--peers",)),
        (["--peers", "--truth", "truth"], ("--truth", "--kind", "--synthetic")),
        (["--method", "majority", "--method", "first-hand"], ("--measure",)),
        (["--labels", "5"], ("--labels", "--measure")),
        (["--synthetic"], ("--synthetic",)),
        (
            ["--truth", "truth", "--measure", "--labels", "200"],
            ("200",),
        ),
    ):
        result = printed("panel", votes, *arguments, "--out", tmp_path / "none", code=2)
        assert_names(result, *words)
    assert not (tmp_path / "none").exists()


def test_without_the_extra_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("roletrust_experiments.commands.extras.find_spec", lambda name: None)
    result = run(
        "panel", str(tmp_path / "votes.csv"), "--synthetic", "--out", str(tmp_path / "out")
    )
    assert "roletrust panel needs pyarrow: pip install 'roletrust-env[data]'" in " ".join(
        result.output.split()
    )
    assert list(tmp_path.iterdir()) == []


def test_models_that_do_not_fit_are_left_out(
    votes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("roletrust_env.trust.grid_run.MEMORY", 1000.0)
    more = [
        "--truth",
        "truth",
        "--measure",
        "--method",
        "majority",
        "--method",
        "first-hand",
        "--out",
        str(tmp_path),
    ]
    result = printed("panel", votes, *more)
    assert result.count("left out: first-hand: trust model") == 1
    assert {row["method"] for row in csv_rows(tmp_path / "measures.csv")} == {"majority"}
