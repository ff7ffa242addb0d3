"""The manager of a team on a recording."""

import pytest
from manager_cases import PERIOD, TEAM, feed, manager, random_ratings
from refusals import refuses

from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.recording import RecordedMessage, Recorder
from roletrust_manager.journal.lines import read_journal
from roletrust_manager.robots.manager import replay


def record_ratings(folder, ratings, mask):
    """Write a recording of ratings (R, S, P), one message per rater and round."""
    with Recorder(folder) as recorder:
        for r in range(len(ratings)):
            for i, name in enumerate(TEAM.raters):
                row = {p: ratings[r, i, j] for j, p in enumerate(TEAM.providers) if mask[r, i, j]}
                raw = messages.encode(messages.ratings_message(name, PERIOD * (r + 1), row))
                recorder.write(
                    RecordedMessage(PERIOD * (r + 1) + i, f"/{name}/ratings", messages.RATINGS, raw)
                )


def test_a_replay_writes_the_rounds_of_a_recording(tmp_path):
    notes, mask = random_ratings(10)
    record_ratings(tmp_path / "bag", notes, mask)
    shares = []
    found = replay(
        tmp_path / "bag",
        tmp_path / "journal",
        model="mean",
        progress=lambda done, total: shares.append(done / total),
    )
    direct = feed(manager(tmp_path / "direct", model="mean"), notes, mask)
    assert found.rounds == len(direct)
    assert not found.refusals
    assert shares == sorted(shares)
    assert shares[-1] == 1
    assert [entry.trust for entry in read_journal(tmp_path / "journal")] == [
        entry.trust for entry in direct
    ]
    with refuses(FileExistsError, "journal"):
        replay(tmp_path / "bag", tmp_path / "journal")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({}, ("bag",)),
        ({"speed": 0.05}, ("speed", "0.05")),
        ({"model": "nonsense"}, ("nonsense",)),
    ],
)
def test_a_replay_that_cannot_be_leaves_no_journal(arguments, words, tmp_path):
    with refuses(ValueError, *words):
        replay(tmp_path / "bag", tmp_path / "journal", **arguments)
    assert list(tmp_path.iterdir()) == []
