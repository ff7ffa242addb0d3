"""A team that grows, and a manager that is started again, without replaying all rounds."""

import gc
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
import tracemalloc
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from domains import own_dds_domain
from fake_wire import FixedSigner
from manager_cases import (
    MODELS,
    PERIOD,
    TEAM,
    feed,
    manager,
    random_ratings,
    rating_message,
    replay_journal,
)
from process_load import cpu_s
from refusals import refuses
from test_state_growth import BY_REPLAY, close

from roletrust_env import make_scenario
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.storage.arrays import load_arrays, save_arrays
from roletrust_env.trust import make_trust_model
from roletrust_manager.admission.validation import RefusalReason
from roletrust_manager.dds import team_trust
from roletrust_manager.dds.rounds import MatchedRound
from roletrust_manager.dds.team_run import TeamRun
from roletrust_manager.dds.team_trust import CountedRatings
from roletrust_manager.dds.wire import messages
from roletrust_manager.journal import lines as journals
from roletrust_manager.journal.lines import (
    JournalPosition,
    read_journal,
    read_snapshot,
    snapshot_path,
    write_snapshot,
)
from roletrust_manager.team import Team

SLOW = pytest.mark.slow
FLAT, OF_A_NEWCOMER = (
    50_000,
    1_000,
)  # bytes: in 10,000 rounds, a leak of 6 bytes a round is too much
MANY = Team((*TEAM.raters, "new", "both"), (*TEAM.providers, "both"))


@pytest.fixture
def often(monkeypatch):
    """Write a snapshot every ten rounds, and replay no more than these at once."""
    monkeypatch.setattr(team_trust, "_AT_ONCE", 10)


@pytest.fixture
def replays(monkeypatch):
    """Return a list with the name of each reading of a journal."""
    read, seen = journals.read_journal, []

    def noted(path, after=None):
        for entry in read(path, after):
            seen.append(entry.round)
            yield entry

    for module in (journals, team_trust):
        monkeypatch.setattr(module, "read_journal", noted)
    return seen


def grown(path, model, rounds=40):
    """Return a manager after some rounds in which two raters and a provider have joined, and the
    rounds.

    The snapshot of before, if there is one, is kept beside the journal as `early`.
    """
    keeper = manager(path, model=model)
    published = feed(keeper, *random_ratings(12))
    if snapshot_path(path).exists():
        shutil.copy(snapshot_path(path), path.with_name("early"))
    keeper.add_provider("both", 13 * PERIOD)
    ratings, mask = random_ratings(rounds, seed=1, team=MANY, lost=0.1)
    for r in range(rounds):
        published += feed(
            keeper, ratings[r : r + 1], mask[r : r + 1] & ~MANY.peers, team=MANY, first=13 + r
        )
    return keeper, published


@pytest.mark.parametrize("model", ["fire", "qor"])
def test_a_model_that_cannot_grow_takes_no_newcomers_before_the_next_start(model, tmp_path):
    keeper, published = grown(tmp_path / "journal", model)
    assert published[-1].team == TEAM
    crowded = {name for name, why in keeper.admission.refusals if why is RefusalReason.CROWDED}
    assert crowded == {""}
    keeper.close()
    again = manager(tmp_path / "journal", model=model, team=MANY)
    whole = TeamRun(make_trust_model(model), MANY, [entry.ratings for entry in published])
    assert again.trust == whole.trust


@pytest.mark.parametrize("model", [one for one in MODELS if one.values[0] not in BY_REPLAY])
def test_newcomers_join_with_the_trust_of_a_replay(model, often, tmp_path):
    keeper, published = grown(tmp_path / "journal", model)
    assert len(published) == 52
    last = published[-1]
    assert (set(last.team.raters), set(last.team.providers)) == (
        set(MANY.raters),
        set(MANY.providers),
    )
    whole = TeamRun(make_trust_model(model), last.team, [entry.ratings for entry in published])
    close(last.trust, whole.trust)
    keeper.close()
    assert replay_journal(make_trust_model(model), tmp_path / "journal").trust == last.trust
    for _ in range(2):
        again = manager(tmp_path / "journal", model=model)
        assert again.trust == last.trust
        assert again.next_round == 52
        again.close()
        shutil.copy(tmp_path / "early", snapshot_path(tmp_path / "journal"))


def test_a_newcomer_costs_no_replay(replays, tmp_path):
    keeper, _ = grown(tmp_path / "journal", "beta")
    assert replays == []
    assert keeper.next_round == 52


@pytest.mark.parametrize("model", ["role-trust", "fire", pytest.param("travos", marks=SLOW)])
def test_a_restart_replays_the_rounds_after_the_snapshot_only(model, often, replays, tmp_path):
    first, published = grown(tmp_path / "journal", model, rounds=43)
    first.close()
    replays.clear()
    second = manager(tmp_path / "journal", model=model)
    assert set(replays) == {50, 51, 52, 53, 54}
    assert second.trust == published[-1].trust
    rest = random_ratings(5, seed=2)
    more = feed(second, *rest, first=56)
    second.close()
    snapshot_path(tmp_path / "journal").unlink()
    third = manager(tmp_path / "journal", model=model)
    assert third.trust == more[-1].trust
    assert list(read_journal(tmp_path / "journal")) == published + more


def test_replayed_messages_are_refused_after_a_restart_from_a_snapshot(often, tmp_path):
    ratings, mask = random_ratings(10, lost=0.0)
    first = manager(tmp_path / "journal")
    feed(first, ratings, mask)
    first.close()
    assert read_snapshot(tmp_path / "journal").position.round == 10
    second = manager(tmp_path / "journal")
    assert feed(second, ratings, mask) == []
    assert second.admission.refusals.total() == 30


def spoiled(path, *, others=(), **changes):
    """Give a snapshot another header, or other arrays, and a valid checksum."""
    arrays = load_arrays(path)
    header = json.loads(arrays["header"].tobytes())
    header |= {name: change(header[name]) for name, change in changes.items()}
    arrays |= {"header": np.frombuffer(json.dumps(header).encode(), np.uint8), **dict(others)}
    save_arrays(path, {name: array for name, array in arrays.items() if array is not None})


def cut(change):
    return lambda path: path.write_bytes(change(path.read_bytes()))


UNUSABLE = "its snapshot cannot be used: "


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (cut(lambda data: b""), UNUSABLE + "it is no complete file of arrays: it is no zip file"),
        (cut(lambda data: data[:-100]), UNUSABLE + "it is no complete file of arrays"),
        (
            cut(lambda data: data[:200] + bytes([data[200] ^ 1]) + data[201:]),
            UNUSABLE + "it is no complete file",
        ),
        (
            cut(lambda data: b"\x80\x04\x95cposix\nsystem\n"),
            UNUSABLE + "it is no complete file of arrays",
        ),
        (
            lambda path: spoiled(path, snapshot=lambda _: 1),
            UNUSABLE + "snapshot is 1: it must be 3",
        ),
        (
            lambda path: spoiled(path, position=lambda at: [7, *at[1:]]),
            UNUSABLE + "it is of another journal",
        ),
        (
            lambda path: spoiled(path, position=lambda at: [at[0], "0" * 64, 20]),
            UNUSABLE + "it is of another journal",
        ),
        (lambda path: spoiled(path, others={"state_0": None}), UNUSABLE + "state_0 is missing"),
        (
            lambda path: spoiled(path, others={"state_0": np.zeros(7)}),
            UNUSABLE + "state_0 has shape (7,)",
        ),
        (
            lambda path: spoiled(path, others={"state_5": np.zeros(7)}),
            UNUSABLE + "state_5 is of no part of a state",
        ),
        (
            lambda path: spoiled(path, others={"rated": np.zeros(7)}),
            UNUSABLE + "the counts are of another team",
        ),
        (
            lambda path: spoiled(path, others={"header": np.array([{}])}),
            UNUSABLE + "it is no complete file of arrays",
        ),
        (
            lambda path: spoiled(path, others={"header": np.zeros(3)}),
            UNUSABLE + "header has shape (3,)",
        ),
        (Path.unlink, "it has no snapshot"),
    ],
)
def test_without_a_usable_snapshot_a_line_says_so_and_the_journal_is_replayed(
    spoil, why, often, replays, tmp_path
):
    first = manager(tmp_path / "journal")
    published = feed(first, *random_ratings(25))
    first.close()
    path = snapshot_path(tmp_path / "journal")
    spoil(path)
    replays.clear()
    lines = []
    second = manager(tmp_path / "journal", report=lines.append)
    assert second.trust == published[-1].trust
    assert set(replays) == set(range(25))
    assert [line.partition(why)[0] for line in lines] == [
        f"{tmp_path / 'journal'}: 25 rounds are replayed, since "
    ]
    second.close()
    replays.clear()
    third = manager(tmp_path / "journal", report=lines.append)  # the second has written a snapshot
    assert (third.trust, len(lines), replays) == (second.trust, 1, [])


def test_a_changed_journal_is_found_in_spite_of_a_snapshot(often, tmp_path):
    first = manager(tmp_path / "journal")
    feed(first, *random_ratings(12, lost=0.0))
    first.close()
    path = tmp_path / "journal"
    lines = path.read_text().splitlines(keepends=True)
    changed = json.loads(lines[4])
    changed["ratings"]["sr_0"] = [1.0, 1.0, 1.0]
    path.write_text("".join([*lines[:4], json.dumps(changed) + "\n", *lines[5:]]))
    with refuses(ValueError, "journal", "2"):
        manager(path)


@pytest.mark.parametrize(
    ("rounds", "newcomers"),
    [
        (240, True),
        pytest.param(2_000, True, marks=SLOW),
        pytest.param(10_000, True, marks=pytest.mark.soak),
        pytest.param(10_000, False, marks=pytest.mark.soak),
    ],
)
def test_ten_newcomers_a_minute_delay_no_round(rounds, newcomers, tmp_path):
    """Ten raters and ten providers at two rounds a second; a newcomer rates for a minute and
    leaves.

    Each newcomer has rows in the arrays of the model, and its name in a few tables, for good.
    Nothing else may grow: all memory is traced from the first round on, and measured after the
    first tenth and at the end.
    """
    team = Team(tuple(f"sr_{k}" for k in range(10)), tuple(f"sp_{k}" for k in range(10)))
    keeper = manager(tmp_path / "journal", team=team, keyring=FixedAgents())
    random, spent, published, memory = np.random.default_rng(0), np.zeros(rounds), 0, []
    tracemalloc.start()
    for r in range(1, rounds + 1):
        fresh = [f"x{k}" for k in range(max(0, r - 120) // 12, r // 12)] if newcomers else []
        sent = {name: random.random(10).tolist() for name in (*team.raters, *fresh)}
        began = time.process_time()
        for name, row in sent.items():
            message = rating_message(name, r, dict(zip(team.providers, row, strict=True)))
            message = message._replace(envelope=message.envelope._replace(signature=b"-"))
            published += len(keeper.receive(message, PERIOD * r + 20_000_000))
        published += len(keeper.tick(int(PERIOD * (r + 0.8))))
        spent[r - 1] = time.process_time() - began
        if r in (rounds // 10, rounds):
            gc.collect()
            memory.append((tracemalloc.get_traced_memory()[0], len(keeper._trust.team.raters)))
    tracemalloc.stop()
    (first, few), (last, many) = memory
    each = (
        f"; {(last - first) / (many - few):.0f} bytes for each of {many - few} newcomers"
        if many > few
        else ""
    )
    print(
        f"{rounds} rounds, {many} raters: median {np.median(spent):.4f} s, longest "
        f"{spent.max():.3f} s, traced"
    )
    print(
        f"memory grew by {(last - first) / 1e3:.0f} kB in the last {rounds - rounds // 10} "
        f"rounds{each}"
    )
    assert published == rounds
    assert many == 10 + newcomers * rounds // 12
    assert sorted(spent)[-3] < 0.7 * PERIOD / 1e9
    assert last - first < FLAT + OF_A_NEWCOMER * (many - few)
    trust = keeper.trust
    keeper.close()
    assert replay_journal(make_trust_model("role-trust"), tmp_path / "journal").trust == trust


class FixedAgents:
    """A keyring with all names."""

    def __contains__(self, name):
        return True

    def verifies(self, name, signed, signature):
        return True


@pytest.mark.slow
@pytest.mark.parametrize("rounds", [828, 100_099])
def test_a_manager_listens_again_in_the_time_of_a_few_imports(rounds, monkeypatch, tmp_path):
    """Ten raters and ten providers. The unit is the CPU time to import NumPy and hash the journal;
    best of three."""
    monkeypatch.setenv("PYTHONPYCACHEPREFIX", str(tmp_path / "bytecode"))
    monkeypatch.delenv("PYTHONDONTWRITEBYTECODE", raising=False)
    rules, path = make_scenario("crowd-10x10"), tmp_path / "journal"
    lengthen(path, rules, 100)
    last, earlier = path.read_text().splitlines(keepends=True)[-1], rounds // 100 * 100
    with path.open("a") as file:  # rounds before the snapshot are read, and not played
        file.writelines(last.replace('"round": 99,', f'"round": {r},') for r in range(100, earlier))
    data, snapshot = path.read_bytes(), read_snapshot(path)
    place = JournalPosition(len(data), hashlib.sha256(data).hexdigest(), earlier, Team.of(rules))
    write_snapshot(path, snapshot._replace(position=place))
    lengthen(path, rules, rounds - earlier)
    command = [sys.executable, "-c", "from roletrust_experiments import main; main()"]
    command += ["robots", "manager", str(path), "--set", "scenario=crowd-10x10"]
    with own_dds_domain():
        runs = partial(import_s, path), partial(listening_s, command)
        bare, listening = (min(run() for _ in range(3)) for run in runs)
    print(
        f"{rounds} rounds, {len(data) / 1e6:.0f} MB: {listening:.2f} s, as long as "
        f"{listening / bare:.1f} imports"
    )
    assert listening < 9 * bare  # it is 2 to 4 times as long


def lengthen(path, rules, rounds):
    """Play further rounds into a journal, with messages that are as long as signed ones."""
    team, period, random = Team.of(rules), round(rules.period_s * 1e9), np.random.default_rng(0)
    keeper = team_trust.TeamTrust(parse_trust_model("role-trust", rules), path, period, team)
    for r in range(keeper.next_round, keeper.next_round + rounds):
        items = {}
        for name, row in zip(team.raters, random.random(team.peers.shape).tolist(), strict=True):
            ratings = dict(zip(team.providers, row, strict=True))
            message = messages.ratings_message(name, period * r, ratings, FixedSigner(bytes(64)))
            items[name] = CountedRatings(ratings, messages.encode(message))
        keeper.close_round(MatchedRound(period * r, items, ()), period * r, {})
    keeper.close()


def import_s(path):
    """Return the CPU time of a process that imports the middleware and NumPy and hashes a file,
    seconds."""
    code = "import cyclonedds.domain, cyclonedds.sub, hashlib, numpy, sys"
    code += "; hashlib.file_digest(open(sys.argv[1], 'rb'), 'sha256')"
    before = os.times()
    subprocess.run([sys.executable, "-c", code, path], check=True)
    after = os.times()
    return (
        after.children_user + after.children_system - before.children_user - before.children_system
    )


def listening_s(command):
    """Return the CPU time of a manager until it waits for ratings, seconds."""
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert any("waits for ratings" in line for line in process.stderr)
        spent = cpu_s(process.pid)
        process.terminate()
    return spent
