import json
from pathlib import Path

import numpy as np
import pytest
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
from refusals import refuses

from roletrust_env import Game, JointPolicy, make_scenario
from roletrust_env.trust import Ratings, make_trust_model
from roletrust_manager.admission.validation import RefusalReason
from roletrust_manager.dds.team_run import TeamRun
from roletrust_manager.journal.lines import Journal, read_journal
from roletrust_manager.team import Team


@pytest.mark.parametrize("model", ["role-trust", "mean", "beta", "fire"])
def test_the_trust_is_that_of_the_simulated_game_with_the_same_losses(model, tmp_path):
    scenario = make_scenario("paper-3x3").change(max_cycles=60, ratings={"lost": 0.3}, noise=0.1)
    game = Game(scenario, model)
    joint_policy, random = JointPolicy(game, {}), game.random(seed=1)
    state, memories = game.start(game.draw(random, start=True)), joint_policy.begin(random)
    states = []
    for _ in range(scenario.max_cycles):
        actions, memories = joint_policy.act(state, memories, random)
        state, _ = game.step(state, actions, game.draw(random))
        states.append(state)
    heard = [state for state in states if state.rated.any()]  # none is rated in the first round
    keeper = manager(tmp_path / "journal", model=model, silence=1000)
    published = feed(keeper, [state.ratings for state in heard], [state.rated for state in heard])
    assert len(published) == len(heard) > 50
    trust = game.model.start(heard[0].ratings)
    for entry, state in zip(published, heard, strict=True):
        trust = game.model.update(trust, Ratings(state.ratings, state.rated))
        mask = [
            [rating is not None for rating in entry.ratings.get(name, [None] * 3)]
            for name in TEAM.raters
        ]
        np.testing.assert_array_equal(mask, state.rated)
        np.testing.assert_array_equal(entry.trust.tor, game.model.rater_trust(trust))
        np.testing.assert_array_equal(entry.trust.top, game.model.provider_trust(trust))
        if model != "fire":  # a judge of the game remembers lost ratings of its own, too
            np.testing.assert_array_equal(entry.trust.top, game.published(state)[1])
        waited = [name for name, row in zip(TEAM.raters, state.rated, strict=True) if not row.any()]
        assert list(entry.missing) == waited


def test_a_restarted_manager_continues_with_the_next_round(tmp_path):
    ratings, mask = random_ratings(40)
    whole = feed(manager(tmp_path / "whole"), ratings, mask)
    first = manager(tmp_path / "journal")
    published = feed(first, ratings[:23], mask[:23])
    first.close()
    second = manager(tmp_path / "journal")
    assert second.next_round == 23
    assert second.trust == published[-1].trust
    assert published + feed(second, ratings[23:], mask[23:], first=24) == whole
    assert list(read_journal(tmp_path / "journal")) == whole


def test_earlier_messages_do_not_count_again(tmp_path):
    ratings, mask = random_ratings(5)
    first = manager(tmp_path / "journal")
    feed(first, ratings, mask)
    first.close()
    second = manager(tmp_path / "journal")
    assert feed(second, ratings, mask) == []
    assert second.next_round == 5


@pytest.mark.parametrize("kept", [1, 30, 300])
def test_a_journal_cut_off_anywhere_loses_the_last_line_at_most(kept, tmp_path):
    path = tmp_path / "journal"
    first = manager(path)
    published = feed(first, *random_ratings(6))
    first.close()
    path.write_bytes(path.read_bytes()[:-kept])
    second = manager(path)
    assert second.next_round == (5 if kept < 300 else len(list(read_journal(path))))
    assert list(read_journal(path)) == published[: second.next_round]
    assert path.read_bytes().endswith(b"\n")


def test_a_restarted_manager_has_the_agents_of_its_journal_and_of_its_settings(tmp_path):
    first = manager(tmp_path / "journal", team=Team(("sr_0",), ("sp_0",)))
    first.receive(rating_message("sr_0", 1, {"sp_0": 1.0}), PERIOD)
    first.close()
    second = manager(tmp_path / "journal", team=Team(("sr_1",), ("sp_1",)))
    assert second.receive(rating_message("sr_0", 2, {"sp_0": 1.0, "sp_1": 0.5}), 2 * PERIOD) == []
    (entry,) = second.tick(3 * PERIOD)
    assert entry.team == Team(("sr_0", "sr_1"), ("sp_0", "sp_1"))
    assert entry.ratings == {"sr_0": [1.0, 0.5]}
    assert entry.missing == ("sr_1",)


def test_a_message_of_the_last_round_is_refused_after_a_restart(tmp_path):
    first = manager(tmp_path / "journal", team=Team(("sr_0",), ("sp_0",)))
    first.receive(rating_message("sr_0", 1, {"sp_0": 1.0}), PERIOD)
    first.close()
    second = manager(tmp_path / "journal", team=Team(("sr_0",), ("sp_0",)))
    assert second.receive(rating_message("sr_0", 1, {"sp_0": 0.0}), PERIOD) == []
    assert second.admission.refusals == {("sr_0", RefusalReason.REPLAYED): 1}
    assert (
        second.receive(rating_message("sr_1", 1, {"sp_0": 0.0}), PERIOD) == []
    )  # a new rater, but an old round
    assert second.tick(3 * PERIOD) == []
    assert second.rounds.unused == {"sr_1": 1}


def test_a_journal_takes_the_next_round_only(tmp_path):
    keeper = manager(tmp_path / "journal", team=Team(("sr_0",), ("sp_0",)))
    (entry,) = keeper.receive(rating_message("sr_0", 1, {"sp_0": 1.0}), PERIOD)
    keeper.close()
    with Journal(tmp_path / "other", {}) as journal:
        with refuses(ValueError, "round", "journal", "1"):
            journal.append(entry._replace(round=1))
        journal.append(entry)
        assert journal.rounds == 1
        assert list(read_journal(tmp_path / "other")) == [entry]


def test_a_journal_is_read_while_its_last_line_is_being_written(tmp_path):
    keeper = manager(tmp_path / "journal")
    published = feed(keeper, *random_ratings(5, lost=0.0))
    text = (tmp_path / "journal").read_bytes()
    (tmp_path / "half").write_bytes(text[:-20])
    assert list(read_journal(tmp_path / "half")) == published[:-1]


def test_a_journal_of_another_version_is_refused(tmp_path):
    (tmp_path / "journal").write_text('{"journal": 1}\n')
    with refuses(ValueError, "journal", "2"):
        list(read_journal(tmp_path / "journal"))


def test_replay_gives_the_same_trust_to_the_last_bit(tmp_path):
    first = manager(tmp_path / "journal")
    published = feed(first, *random_ratings(30))
    assert (
        replay_journal(make_trust_model("role-trust"), tmp_path / "journal").trust
        == published[-1].trust
    )


def test_a_journal_that_was_tampered_with_is_refused(tmp_path):
    path = tmp_path / "journal"
    first = manager(path)
    feed(first, *random_ratings(6))
    first.close()
    lines = path.read_text().splitlines()
    round = json.loads(lines[4])
    round["ratings"]["sr_0"] = [1.0, 1.0, 1.0]
    path.write_text("\n".join([*lines[:4], json.dumps(round), *lines[5:]]) + "\n")
    with refuses(ValueError, "journal", "2"):
        manager(path)


def test_the_journal_of_another_model_is_refused(tmp_path):
    manager(tmp_path / "journal").close()
    with refuses(ValueError, "trust_model", "RoleTrust(lam=0.5, initial=0.5)"):
        manager(tmp_path / "journal", model="mean")


def test_two_managers_cannot_share_a_journal(tmp_path):
    first = manager(tmp_path / "journal")
    with refuses(ValueError, "journal"):
        manager(tmp_path / "journal")
    first.close()
    manager(tmp_path / "journal")


@pytest.mark.parametrize(
    "text",
    [
        b"{}",
        b"[1, 2]",
        b"my only copy",
        b'{"journal": 1',
        b"\xff\xfe\n\xff",
        b"dear diary\nit rains",
        b"{}\n{}",
    ],
)
def test_another_file_is_refused_and_not_changed(text, tmp_path):
    (tmp_path / "mine").write_bytes(text)
    with refuses(ValueError, "mine"):
        manager(tmp_path / "mine")
    assert (tmp_path / "mine").read_bytes() == text


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda lines: [*lines[:3], *lines[4:]], ("round", "2", "1")),
        (lambda lines: [*lines[:4], lines[3], *lines[4:]], ("round", "1", "2")),
        (lambda lines: [lines[0], *lines[2:]], ()),
        (lambda lines: [*lines[:3], b"{}\n", *lines[3:]], ("{}",)),
        (lambda lines: [*lines, b"\xff\xfe\n"], ()),
        (
            lambda lines: [*lines[:3], lines[3].replace(b"ratings", b"rating_"), *lines[4:]],
            (),
        ),
        (
            lambda lines: [
                *lines[:3],
                lines[3].replace(b'"sr_1": [', b'"sr_1": [0.5, '),
                *lines[4:],
            ],
            (),
        ),
        (
            lambda lines: [*lines[:3], lines[3].replace(b"sr_1", b"sr_9"), *lines[4:]],
            (),
        ),
        (
            lambda lines: [
                *lines[:3],
                lines[3].replace(b'"missing": []', b'"missing": 7'),
                *lines[4:],
            ],
            (),
        ),
    ],
)
def test_a_damaged_journal_is_refused_in_one_line(change, words, tmp_path):
    path = tmp_path / "journal"
    with_all = manager(path)
    feed(with_all, *random_ratings(5, lost=0.0))
    with_all.close()
    path.write_bytes(b"".join(change(path.read_bytes().splitlines(keepends=True))))
    damaged = path.read_bytes()
    with refuses(ValueError, path, *words):
        manager(path)
    assert path.read_bytes() == damaged


def test_another_file_is_no_journal(tmp_path):
    path = tmp_path / "journal"
    path.write_text("dear diary\n")
    with refuses(ValueError, "journal", "dear diary"):
        manager(path)
    assert path.read_text() == "dear diary\n"
    with refuses(ValueError, "/dev/null"):
        manager(Path("/dev/null"))


@pytest.mark.parametrize("model", MODELS)
def test_a_newcomer_counts_as_a_silent_member_until_then(model, tmp_path):
    few, many = (
        Team(TEAM.raters[:2], TEAM.providers[:2]),
        Team((*TEAM.raters, "both"), (*TEAM.providers, "both")),
    )
    ratings, mask = random_ratings(20, team=few)
    later, heard = random_ratings(10, seed=1, team=many)
    heard &= ~many.peers
    heard[0] = ~many.peers
    keeper = manager(tmp_path / "journal", model=model, team=few)
    before = feed(keeper, ratings, mask, team=few)
    if not keeper._trust.grows:
        keeper.close()
        keeper = manager(tmp_path / "journal", model=model, team=many)
    for name in many.providers:
        keeper.add_provider(name, 0)
    after = feed(keeper, later, heard, team=many, first=21)
    team_run = TeamRun(
        make_trust_model(model), after[-1].team, [entry.ratings for entry in [*before, *after]]
    )
    assert set(after[-1].team.raters) == set(many.raters)
    assert after[-1].trust == team_run.trust
    keeper.close()
    again = manager(tmp_path / "journal", model=model, team=few)
    assert again.trust == after[-1].trust


def test_an_agent_with_both_roles_has_a_trust_of_its_own(tmp_path):
    team = Team(("sr_0", "srsp_0"), ("sp_0", "srsp_0"))
    keeper = manager(tmp_path / "journal", team=team)
    published = keeper.receive(rating_message("sr_0", 1, {"sp_0": 1.0, "srsp_0": 1.0}), PERIOD)
    published += keeper.receive(rating_message("srsp_0", 1, {"sp_0": 1.0}), PERIOD)
    (entry,) = published
    assert entry.trust.toa == ((entry.trust.tor[1] + entry.trust.top[1]) / 2,)


def test_a_full_disk_stops_the_manager_before_it_publishes(tmp_path, monkeypatch):
    keeper = manager(tmp_path / "journal", team=Team(("sr_0",), ("sp_0",)))

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.write", full)
    with refuses(OSError):
        keeper.receive(rating_message("sr_0", 1, {"sp_0": 1.0}), PERIOD)


@pytest.mark.parametrize("restarts", [False, True], ids=["running", "restarted"])
def test_rounds_go_on_when_the_clock_goes_back_an_hour(restarts, tmp_path):
    values, mask = random_ratings(40)
    hour = 3600 * 10**9 // PERIOD
    steady, keeper = manager(tmp_path / "steady"), manager(tmp_path / "back")
    feed(steady, values, mask, first=hour + 1)
    before = feed(keeper, values[:20], mask[:20], first=hour + 1)
    if restarts:
        keeper.close()
        keeper = manager(tmp_path / "back")
    after = feed(keeper, values[20:], mask[20:], first=1)
    assert keeper.next_round == steady.next_round == len(before) + len(after)
    assert keeper.trust == steady.trust
    assert not keeper.admission.refusals
    assert not keeper.rounds.unused
    rater, again = next(iter(after[-1].ratings)), {"sp_0": 1.0}
    assert not keeper.receive(rating_message(rater, 20, again), 21 * PERIOD)
    assert keeper.admission.refusals == {(rater, RefusalReason.REPLAYED): 1}
    keeper.close()
    assert replay_journal(keeper._trust._model, tmp_path / "back").trust == steady.trust


def test_what_a_line_holds_is_checked_like_what_is_sent(tmp_path):
    path = tmp_path / "journal"
    keeper = manager(path)
    feed(keeper, *random_ratings(2, lost=0.0))
    keeper.close()
    lines = path.read_bytes().splitlines()
    rows = (
        {"sr_0": "abc"},
        {"sr_0": [2.0]},
        {"sr_0": [True]},
        {"sr_0": [[0.5]]},
        {"sr_0": {"a": 1}},
        {"sr_0": ["0.5"]},
        [],
    )
    trusts = "abc", [True] * 3, ["0.5"] * 3, [None] * 3, [-0.5] * 3, {"a": 1, "b": 2, "c": 3}
    wrong = {
        "ratings": [*rows, []],
        **dict.fromkeys(("tor", "top", "toa"), trusts),
        **dict.fromkeys(("round", "stamp", "closed"), (float("inf"), 2**70, "1", True, None, 1.5)),
        "missing": ("abc", [1], {}),
        **dict.fromkeys(("raters", "providers"), (["a", "a", "b"], [["a"]], "abc", [1, 2, 3])),
    }
    for name, values in wrong.items():
        at = next(n for n, line in enumerate(lines) if name in json.loads(line))
        for value in values:
            damaged = json.dumps({**json.loads(lines[at]), name: value}).encode()
            path.write_bytes(b"\n".join([*lines[:at], damaged, *lines[at + 1 :]]) + b"\n")
            with refuses(ValueError, "journal"):
                list(read_journal(path))


def test_a_kill_between_the_line_of_a_team_and_its_round_is_mended(tmp_path):
    path, ratings = tmp_path / "journal", random_ratings(4, lost=0.0)
    keeper = manager(path)
    feed(keeper, *ratings)
    keeper.close()
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"raters": ["sr_0", "new"], "providers": ["sp_0"]}\n')
    again = manager(path)
    feed(again, *random_ratings(2, lost=0.0), first=6)
    again.close()
    assert manager(path).next_round == again.next_round > 4
