"""Replays of real logs beside the leaderboard."""

from pathlib import Path

import pytest
from refusals import refuses
from test_leaderboard import RUN, SUITE

from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.real_logs import read_replays

HEAD = "log,sha256,round,protocol,model,measure,value,low,high\n"
LINES = [
    "otc,ab,9,attack,mean,\"sink, honest\",0.99,0.9,1.0",
    "otc,ab,9,attack,mean,\"sink, 3 new\",0.5,0.4,0.6",
    "otc,ab,9,attack,mean,\"sink, 10 new\",0.3,0.2,0.5",
    "otc,ab,9,attack,mean,\"lift, 3 new\",0.2,0.1,0.4",
    "otc,ab,9,attack,mean,\"lift, 10 new\",0.1,0.0,0.3",
    "otc,ab,9,next rating,mean,auc,0.6,0.5,0.7",
    "otc,ab,9,attack,half,\"sink, 3 new\",0.5,0.4,0.6",
]  # fmt: skip


def test_the_worst_replay_of_each_goal_counts(tmp_path: Path) -> None:
    path = tmp_path / "comparison.csv"
    path.write_text(HEAD + "\n".join(LINES) + "\n")
    real = read_replays(path)
    assert list(real) == ["mean"]  # the other one lacks a goal
    assert real["mean"] == pytest.approx(((0.3 + 0.8) / 2, (0.2 + 0.6) / 2, (0.5 + 0.9) / 2))
    table = Leaderboard.of(SUITE, RUN, real).to_markdown()
    assert "| real |" in table
    assert "| 0.550 (0.400, 0.700) |" in table
    assert "real" not in Leaderboard.of(SUITE, RUN).columns


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("model,worst\nmean,0.5\n", ("comparison.csv",)),
        (HEAD + LINES[1].replace("0.5,", "half,") + "\n", ("comparison.csv",)),
        (HEAD + LINES[5] + "\n", ("other.csv", "--compare")),
    ],
)
def test_another_file_is_refused(tmp_path: Path, text: str, words: tuple[str, ...]) -> None:
    (tmp_path / "other.csv").write_text(text)
    with refuses(ValueError, *words):
        read_replays(tmp_path / "other.csv")
