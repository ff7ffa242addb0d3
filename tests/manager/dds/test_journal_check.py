"""The check of a journal with public keys accepts what a manager wrote, and names each change."""

import base64
import json

import pytest
from manager_cases import PERIOD, TEAM, feed, manager, random_ratings
from refusals import refuses

from roletrust_env.trust import make_trust_model
from roletrust_manager.admission.keys import PublicKeys, Signer, make_keys
from roletrust_manager.admission.validation import MANAGER, KeysOfOthers, RefusalReason
from roletrust_manager.dds import journal_check, team_trust
from roletrust_manager.dds.journal_check import CheckedJournal, check_journal
from roletrust_manager.dds.wire import messages
from roletrust_manager.journal.lines import read_journal, snapshot_path
from roletrust_manager.team import Team

ROUNDS = 6
MANY = Team((*TEAM.raters, "sr_3"), (*TEAM.providers, "sp_3"))
ROLE_TRUST = "RoleTrust(lam=0.5, initial=0.5)"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the keys of a team, of its newcomers and of its manager."""
    path = tmp_path_factory.mktemp("keys")
    make_keys(path, [MANAGER, *MANY.raters, *MANY.providers])
    return path


@pytest.fixture
def keys(folder):
    return PublicKeys(folder)


@pytest.fixture
def signed(folder):
    """Return a function that makes a rater's signed message of a round."""

    def make(rater, round, ratings):
        return messages.read_ratings_message(raw_message(folder, rater, round, ratings))

    return make


@pytest.fixture
def path(tmp_path, keys, signed):
    """Return the journal of a manager with keys, which has all ratings of a few rounds."""
    keeper = manager(tmp_path / "journal", keyring=keys)
    assert len(feed(keeper, *random_ratings(ROUNDS, lost=0.0), message=signed)) == ROUNDS
    keeper.close()
    return tmp_path / "journal"


def raw_message(folder, rater, round, ratings, signer=None):
    key = Signer(folder, signer or rater)
    return messages.encode(messages.ratings_message(rater, PERIOD * round, ratings, key))


def check(path, keys, model="role-trust", report=lambda line: None):
    return check_journal(path, keys, make_trust_model(model), report)


def rounds_of(path):
    """Return the rounds of a journal as JSON, in order."""
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    return [line for line in lines if "round" in line]


def rewrite(path, change):
    """Change the lines of a journal, as JSON, in place."""
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    change(lines)
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))


def alter(path, round, change):
    """Change a round of a journal in place, as JSON."""
    rewrite(path, lambda lines: change(next(x for x in lines if x.get("round") == round)))


def encoded(raw):
    return base64.b64encode(raw).decode()


def test_a_journal_of_a_manager_with_keys_is_checked(path, keys):
    entries = list(read_journal(path))
    assert check(path, keys) == CheckedJournal(ROUNDS, 3 * ROUNDS, TEAM, entries[-1].trust)
    assert [set(entry.signed) for entry in entries] == [set(TEAM.raters)] * ROUNDS


def test_missing_ratings_are_no_fault(tmp_path, keys, signed):
    keeper = manager(tmp_path / "journal", keyring=keys)
    published = feed(keeper, *random_ratings(30, lost=0.5), message=signed)
    counted = sum(len(entry.ratings) for entry in published)
    assert check(tmp_path / "journal", keys)[:2] == (len(published), counted)
    assert counted < 3 * len(published)


def test_a_message_may_have_refused_ratings(tmp_path, keys, signed):
    keeper = manager(tmp_path / "journal", keyring=keys, team=Team(("sr_0",), ("sp_0", "sp_1")))
    (entry,) = keeper.receive(signed("sr_0", 1, {"sp_0": 0.5, "sp_1": 1.5, "x": 0.5}), PERIOD)
    assert entry.ratings == {"sr_0": [0.5, None]}
    assert check(tmp_path / "journal", keys).messages == 1


def test_only_the_first_rating_of_a_provider_in_a_message_counts(path, keys, folder):
    message = messages.ratings_message("sr_1", 3 * PERIOD, {"sp_0": 0.25, "sp_1": 0.75})
    message.providers = ["sp_0", "sp_0"]
    raw = messages.encode(messages.sign_message(message, Signer(folder, "sr_1")))

    def change(line):
        line["signed"]["sr_1"] = encoded(raw)
        line["ratings"]["sr_1"] = [0.75, None, None]

    alter(path, 2, change)
    with refuses(ValueError, 2, "sr_1", "sp_0", 0.25, 0.75):
        check(path, keys)


def test_a_changed_rating_is_found(path, keys):
    alter(path, 2, lambda line: line["ratings"]["sr_1"].__setitem__(0, 0.125))
    with refuses(ValueError, path, 2, "sr_1", "sp_0", 0.125):
        check(path, keys)


def test_a_rating_of_another_provider_is_found(path, keys, folder):
    raw = raw_message(folder, "sr_1", 3, {"sp_0": 0.25})

    def change(line):
        line["signed"]["sr_1"] = encoded(raw)
        line["ratings"]["sr_1"] = [0.25, 0.75, None]

    alter(path, 2, change)
    with refuses(ValueError, 2, "sr_1", "sp_1", 0.75):
        check(path, keys)


@pytest.mark.parametrize("at", [-1, -64, -70, 0, 1, 20], ids=str)
def test_a_changed_byte_of_a_message_is_found(at, path, keys):
    raw = bytearray(base64.b64decode(rounds_of(path)[2]["signed"]["sr_1"]))
    raw[at] ^= 1
    alter(path, 2, lambda line: line["signed"].update(sr_1=encoded(raw)))
    with refuses(ValueError, path, 2, "sr_1"):
        check(path, keys)


def test_a_changed_signature_is_named(path, keys):
    raw = bytearray(base64.b64decode(rounds_of(path)[2]["signed"]["sr_1"]))
    raw[-1] ^= 1
    alter(path, 2, lambda line: line["signed"].update(sr_1=encoded(raw)))
    with refuses(ValueError, 2, "sr_1", raw[-64:].hex()):
        check(path, keys)


@pytest.mark.parametrize("end", [b"\0", b"text"])
def test_bytes_behind_a_message_are_found(end, path, keys):
    raw = base64.b64decode(rounds_of(path)[2]["signed"]["sr_1"]) + end
    alter(path, 2, lambda line: line["signed"].update(sr_1=encoded(raw)))
    with refuses(ValueError, 2, "sr_1"):
        check(path, keys)


def swap(row):
    row["sr_0"], row["sr_1"] = row["sr_1"], row["sr_0"]


def test_ratings_of_another_rater_are_found(path, keys):
    rating = rounds_of(path)[2]["ratings"]["sr_1"][0]
    alter(path, 2, lambda line: swap(line["ratings"]))
    with refuses(ValueError, 2, "sr_0", "sp_0", rating):
        check(path, keys)


def test_the_message_of_another_rater_is_found(path, keys):
    alter(path, 2, lambda line: (swap(line["ratings"]), swap(line["signed"])))
    with refuses(ValueError, 2, "sr_0", "sr_1"):
        check(path, keys)


def test_a_message_signed_by_another_rater_is_found(path, keys, folder):
    raw = raw_message(folder, "sr_1", 3, {"sp_0": 0.25}, signer="sr_0")
    alter(path, 2, lambda line: line["signed"].update(sr_1=encoded(raw)))
    with refuses(ValueError, 2, "sr_1", raw[-64:].hex()):
        check(path, keys)


def test_a_removed_rater_is_found_by_the_trust(path, keys):
    alter(path, 2, lambda line: (line["ratings"].pop("sr_1"), line["signed"].pop("sr_1")))
    with refuses(ValueError, path, 2, rounds_of(path)[2]["tor"][1]):
        check(path, keys)


@pytest.mark.parametrize("field", ["ratings", "signed"])
def test_ratings_without_their_message_are_found(field, path, keys):
    alter(path, 2, lambda line: line[field].pop("sr_1"))
    with refuses(ValueError, path, 2, "sr_1"):
        check(path, keys)


@pytest.mark.parametrize("older", [1, 2])
def test_a_replayed_message_is_found(older, path, keys):
    """It is that of the round before, or of one before that."""
    source = rounds_of(path)[3 - older]

    def change(line):
        for field in ("ratings", "signed"):
            line[field]["sr_1"] = source[field]["sr_1"]

    alter(path, 3, change)
    with refuses(ValueError, path, 3, "sr_1", (4 - older) * PERIOD, 3 * PERIOD):
        check(path, keys)


@pytest.mark.parametrize("field", ["tor", "top"])
@pytest.mark.parametrize("round", [0, 2, ROUNDS - 1])
def test_changed_trust_is_found(round, field, path, keys):
    alter(path, round, lambda line: line[field].__setitem__(1, 0.0625))
    with refuses(ValueError, path, round, 0.0625):
        check(path, keys)


def test_a_missing_round_is_found(path, keys):
    rewrite(path, lambda lines: lines.pop(4))
    with refuses(ValueError, path, 2, 3):
        check(path, keys)


def test_a_missing_round_is_found_if_the_others_have_new_numbers(path, keys):
    def change(lines):
        lines.pop(4)
        for number, line in enumerate(lines[2:]):
            line["round"] = number

    trust = rounds_of(path)[3]["tor"][0]
    rewrite(path, change)
    with refuses(ValueError, path, 2, trust):
        check(path, keys)


def test_a_rater_without_a_key_is_named(path, keys):
    signature = base64.b64decode(rounds_of(path)[0]["signed"]["sr_1"])[-64:]
    with refuses(ValueError, path, 0, "sr_1") as error:
        check(path, KeysOfOthers(keys, ["sr_1"]))
    assert signature.hex() not in str(error.value)


def test_the_manager_is_no_rater(path, keys, folder):
    def change(lines):
        lines[1]["raters"].append(MANAGER)
        lines[2]["ratings"][MANAGER] = [0.5]
        raw = raw_message(folder, MANAGER, 1, {"sp_0": 0.5})
        lines[2]["signed"][MANAGER] = encoded(raw)
        for line in lines[2:]:
            line["tor"].append(0.5)

    rewrite(path, change)
    with refuses(ValueError, path, 0, MANAGER):
        check(path, keys)


@pytest.mark.parametrize("field", ["raters", "providers"])
def test_an_agent_that_is_no_longer_in_the_team_is_found(field, path, keys):
    def change(lines):
        lines.insert(4, {**lines[1], field: [*lines[1][field][:2], "z0"]})
        for line in lines[5:]:
            for rows in (line["ratings"], line["signed"]):
                rows.pop("sr_2")

    rewrite(path, change)
    with refuses(ValueError, path, 2, "z0"):
        check(path, keys)


def test_a_journal_without_signed_messages_is_refused(tmp_path, keys, signed):
    """The raters sign, but the manager has no keys."""
    keeper = manager(tmp_path / "journal")
    feed(keeper, *random_ratings(2), message=signed)
    assert "signed" not in rounds_of(tmp_path / "journal")[0]
    with refuses(ValueError, tmp_path / "journal", 0, "--keys"):
        check(tmp_path / "journal", keys)


def test_a_journal_without_rounds_is_refused(tmp_path, keys):
    manager(tmp_path / "journal", keyring=keys).close()
    with refuses(ValueError, tmp_path / "journal"):
        check(tmp_path / "journal", keys)


def test_the_journal_of_another_model_is_refused(path, keys):
    with refuses(ValueError, path, "trust_model", ROLE_TRUST, repr(make_trust_model("mean"))):
        check(path, keys, model="mean")


def test_a_journal_is_checked_while_its_last_line_is_being_written(path, keys):
    path.write_bytes(path.read_bytes()[:-20])
    assert check(path, keys)[:2] == (ROUNDS - 1, 3 * (ROUNDS - 1))


def test_rounds_that_a_manager_writes_during_the_check_wait(tmp_path, keys, signed):
    path, ratings = tmp_path / "journal", random_ratings(4, lost=0.0)
    keeper = manager(path, keyring=keys)
    feed(keeper, *ratings, message=signed)
    more = random_ratings(2, team=MANY, lost=0.0)
    keeper.add_provider("sp_3", 5 * PERIOD)

    def write(line):
        feed(keeper, *more, team=MANY, first=5 + keeper.next_round, message=signed)

    checked = check(path, keys, report=write)
    assert checked[:3] == (4, 12, TEAM)
    assert keeper.next_round > 4
    assert check(path, keys).team == MANY


@pytest.mark.parametrize("model", ["role-trust", "fire"])
def test_the_trust_of_each_team_is_checked(model, tmp_path, keys, signed):
    """Newcomers are in the settings of a second start; `fire` begins anew with them."""
    path = tmp_path / "journal"
    keeper = manager(path, keyring=keys, model=model)
    feed(keeper, *random_ratings(4, lost=0.0), message=signed)
    keeper.close()
    keeper = manager(path, keyring=keys, model=model, team=MANY)
    feed(keeper, *random_ratings(4, team=MANY, lost=0.0), team=MANY, first=5, message=signed)
    entries = list(read_journal(path))
    assert check(path, keys, model) == (
        len(entries),
        sum(len(entry.ratings) for entry in entries),
        MANY,
        entries[-1].trust,
    )
    for round in (1, len(entries) - 1):
        text = path.read_text()
        alter(path, round, lambda line: line["top"].__setitem__(1, 0.0625))
        with refuses(ValueError, path, round, 0.0625):
            check(path, keys, model)
        path.write_text(text)


def test_a_restart_from_a_snapshot_goes_on_with_signed_messages(
    tmp_path, keys, signed, monkeypatch
):
    monkeypatch.setattr(team_trust, "_AT_ONCE", 10)
    path, (ratings, mask) = tmp_path / "journal", random_ratings(25, lost=0.0)
    first = manager(path, keyring=keys)
    feed(first, ratings[:12], mask[:12], message=signed)
    first.close()
    assert snapshot_path(path).exists()
    lines = []
    second = manager(path, keyring=keys, report=lines.append)
    assert second.trust == first.trust
    assert feed(second, ratings[:12], mask[:12], message=signed) == []
    feed(second, ratings[12:], mask[12:], first=13, message=signed)
    assert lines == []
    assert check(path, keys) == (25, 75, TEAM, second.trust)


def test_stamps_rise_when_the_clock_of_the_manager_goes_back(tmp_path, keys, signed):
    ratings, mask = random_ratings(20, lost=0.0)
    hour = 3600 * 10**9 // PERIOD
    keeper = manager(tmp_path / "journal", keyring=keys)
    feed(keeper, ratings[:10], mask[:10], first=hour, message=signed)
    assert feed(keeper, ratings[10:15], mask[10:15], first=1, message=signed) == []
    assert keeper.admission.refusals["sr_0", RefusalReason.CLOCK] == 5
    feed(keeper, ratings[15:], mask[15:], first=hour + 10, message=signed)
    assert check(tmp_path / "journal", keys)[:2] == (15, 45)


def test_a_line_about_the_progress_comes_after_many_rounds(path, keys, monkeypatch):
    monkeypatch.setattr(journal_check, "_REPORT_ROUNDS", 2)
    lines = []
    check(path, keys, report=lines.append)
    assert len(lines) == ROUNDS // 2 + 1


MESSAGE = base64.b64encode(b"text").decode()


@pytest.mark.parametrize(
    "signed_field",
    [
        {},
        None,
        [],
        {"sr_0": 5},
        {"sr_0": None},
        {"sr_9": MESSAGE},
        {"sr_0": MESSAGE + "="},
        {"sr_0": MESSAGE + "\n"},
        {"sr_0": MESSAGE.rstrip("=")},
        {"sr_0": "dGV4dB=="},
        {"sr_0": "dGV4-A=="},
        {"sr_0": "\u00e9"},
    ],
    ids=str,
)
def test_a_damaged_field_of_signed_messages_is_refused(signed_field, path):
    alter(path, 2, lambda line: line.update(signed={"sr_0": MESSAGE}))
    assert list(read_journal(path))[2].signed == {"sr_0": b"text"}
    alter(path, 2, lambda line: line.update(signed=signed_field))
    with refuses(ValueError, path):
        list(read_journal(path))
