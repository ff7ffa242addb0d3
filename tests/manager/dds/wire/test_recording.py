import contextlib
import struct

import numpy as np
import pytest
import yaml
from manager_cases import PERIOD, TEAM, manager, random_ratings
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from refusals import refuses

from roletrust_manager.dds.nodes.manager_node import receive_raw, replay_recording
from roletrust_manager.dds.wire import messages
from roletrust_manager.dds.wire.recording import RecordedMessage, Recorder, read_recording

RATINGS = [
    messages.encode(messages.ratings_message(f"sr_{k % 3}", k, dict.fromkeys(TEAM.providers, 0.5)))
    for k in range(50)
]
SOME = [
    *(
        RecordedMessage(10**18 + k, f"/sr_{k % 3}/ratings", messages.RATINGS, raw)
        for k, raw in enumerate(RATINGS)
    ),
    RecordedMessage(
        10**18 + 100,
        "/sp_0/top",
        messages.NUMBER,
        messages.encode(messages.make(messages.NUMBER, data=0.25)),
    ),
]


def write(folder, recorded, *, flushed=7, closed=True):
    recorder = Recorder(folder)
    for k, message in enumerate(recorded):
        recorder.write(message)
        if k % flushed == 0:
            recorder.flush()
    if closed:
        recorder.close()


def test_a_recording_is_read_as_it_was_written(tmp_path):
    write(tmp_path / "bag", SOME)
    assert list(read_recording(tmp_path / "bag")) == SOME
    (path,) = (tmp_path / "bag").glob("*.mcap")
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        others = [found.decoded_message for found in reader.iter_decoded_messages()]
    assert others[0].rater == "sr_0"
    assert others[-1].data == 0.25


@pytest.mark.parametrize("cut", [0, 1, 100, 1000, 3000])
def test_a_killed_recorder_has_written_all_flushed_messages(cut, tmp_path):
    write(tmp_path / "bag", SOME, closed=False)
    (path,) = (tmp_path / "bag").glob("*.mcap")
    path.write_bytes(path.read_bytes()[: path.stat().st_size - cut])
    with refuses(ValueError, "bag"):
        list(read_recording(tmp_path / "bag"))
    count = 0
    with path.open("rb") as file, contextlib.suppress(EndOfFile, struct.error):
        for record in StreamReader(file).records:
            count += isinstance(record, Message)
    assert count >= 50 - cut / 50 - 7


@pytest.mark.parametrize(
    ("field", "value"), [("files", ""), ("version", "x"), ("relative_file_paths", 7)]
)
def test_another_index_of_a_recording_is_one_error(tmp_path, field, value):
    write(tmp_path / "bag", SOME)
    index = tmp_path / "bag" / "metadata.yaml"
    fields = yaml.safe_load(index.read_text())
    fields["rosbag2_bagfile_information"][field] = value
    index.write_text(yaml.safe_dump(fields))
    with refuses(ValueError, "bag"):
        list(read_recording(tmp_path / "bag"))


def test_an_existing_folder_is_refused(tmp_path):
    (tmp_path / "bag").mkdir()
    with refuses(ValueError, "bag"):
        Recorder(tmp_path / "bag")


@pytest.mark.parametrize("model", ["role-trust", "fire"])
def test_a_recording_through_the_manager_gives_the_trust_that_was_published(model, tmp_path):
    random = np.random.default_rng(0)
    values, mask = random_ratings(40, lost=0.2)
    said = []
    for r in range(40):
        for i, name in enumerate(TEAM.raters):
            row = {
                provider: values[r, i, j]
                for j, provider in enumerate(TEAM.providers)
                if mask[r, i, j]
            }
            if row and random.random() > 0.1:
                raw = messages.encode(messages.ratings_message(name, PERIOD * (r + 1), row))
                late = random.choice([0.05, 0.3, 0.9, 1.4], p=[0.7, 0.1, 0.1, 0.1])
                said.append(
                    RecordedMessage(
                        int(PERIOD * (r + 1 + late)) + i, f"/{name}/ratings", messages.RATINGS, raw
                    )
                )
    said.sort()
    live, published, now = manager(tmp_path / "live", model=model), [], said[0].time
    for message in said:
        while now < message.time:
            published += live.tick(now)
            now += PERIOD // 20
        now = message.time
        published += receive_raw(live, message.topic[1:5], message.raw, message.time)
    published += live.tick(now + 2 * PERIOD)
    write(tmp_path / "bag", said)
    again = manager(tmp_path / "again", model=model)
    replayed = list(replay_recording(read_recording(tmp_path / "bag"), again, PERIOD))
    assert replayed == published
    assert len(published) > 35
    assert any(entry.missing for entry in published)


def damaged(folder, seed):
    """Write a complete recording and change some of its bytes."""
    write(folder, SOME)
    (path,) = folder.glob("*.mcap")
    data, random = bytearray(path.read_bytes()), np.random.default_rng(seed)
    for at in random.integers(8, len(data), random.integers(1, 20)):
        data[at] = random.integers(256)
    path.write_bytes(data)
    return folder


def test_a_damaged_recording_is_read_or_refused_in_one_line(tmp_path):
    for seed in range(60):
        bag, said = damaged(tmp_path / f"bag {seed}", seed), None
        try:
            list(read_recording(bag))
        except ValueError as error:
            said = str(error)
        assert said is None or (f"{bag} cannot be read: " in said and "\n" not in said), seed


def test_a_file_is_refused_as_a_recording(tmp_path):
    (tmp_path / "some.mcap").write_bytes(b"\x89MCAP0\r\n")
    with refuses(ValueError, "some.mcap"):
        list(read_recording(tmp_path / "some.mcap"))


def test_a_long_silence_is_skipped(tmp_path, monkeypatch):
    keeper, asked = manager(tmp_path / "journal"), []
    monkeypatch.setattr(keeper, "tick", lambda moment: asked.append(moment) or [])
    list(replay_recording([SOME[0]._replace(time=0), SOME[1]], keeper, PERIOD))
    assert len(asked) < 1000


def test_a_replay_after_a_pause_gives_the_trust_that_was_published(tmp_path):
    """Raters fall silent one by one before the pause, and return one by one after it."""
    recorded, published, live = [], [], manager(tmp_path / "live")
    for r, raters in [(1, "012"), (2, "01"), (3, "0"), (12, "01"), (13, "01"), (14, "012")]:
        for k in map(int, raters):
            raw = messages.encode(
                messages.ratings_message(f"sr_{k}", PERIOD * r, {"sp_0": 0.5 + k / 10})
            )
            recorded.append(RecordedMessage(PERIOD * r, f"/sr_{k}/ratings", messages.RATINGS, raw))
    for before, message in zip([recorded[0], *recorded], recorded, strict=False):
        for moment in range(before.time, message.time, PERIOD // 20):
            published += live.tick(moment)
        published += receive_raw(live, message.topic[1:5], message.raw, message.time)
    published += live.tick(recorded[-1].time + 2 * PERIOD)
    assert [sorted(entry.ratings) for entry in published[:3]] == [
        ["sr_0", "sr_1", "sr_2"],
        ["sr_0", "sr_1"],
        ["sr_0"],
    ]
    assert list(replay_recording(recorded, manager(tmp_path / "again"), PERIOD)) == published


def test_a_replay_accepts_ratings_of_the_cameras_that_it_has_seen(tmp_path):
    raw = messages.encode(messages.ratings_message("sr_0", PERIOD, {"sp_7": 0.5}))
    rated = RecordedMessage(PERIOD, "/sr_0/ratings", messages.RATINGS, raw)
    picture = RecordedMessage(PERIOD - 1, "/sp_7/image_raw/compressed", messages.IMAGE, b"")
    assert list(replay_recording([rated], manager(tmp_path / "unseen"), PERIOD)) == []
    (entry,) = replay_recording([picture, rated], manager(tmp_path / "seen"), PERIOD)
    assert entry.team.providers[-1] == "sp_7"
