"""`roletrust manager`: backups and checks of the journals of managers."""

from dataclasses import replace
from pathlib import Path

import pytest
from command_line import printed
from manager_cases import feed, manager, random_ratings
from refusals import assert_names
from signing_agents import QUICK, Agent, Clock, managed


@pytest.fixture
def store(tmp_path: Path) -> Path:
    clock = Clock()
    with managed(tmp_path / "store", clock, replace(QUICK, scale=(1.0, 5.0))) as manager:
        ann, bob = Agent("ann", clock), Agent("bob", clock)
        for agent in (ann, bob):
            manager.register(agent.registration())
        manager.rate([ann.rating("bob", 5)])
        printed("manager", "backup", tmp_path / "store", tmp_path / "copy")
    return tmp_path / "copy"


def test_a_backup_of_a_store_is_checked(store: Path):
    said = printed("manager", "check", store, "--model", "mean", "--set", "scale=[1, 5]")
    assert_names(said, "3", "bob", "0.7500")
    said = printed("manager", "check", store, "--set", "every=0.5", code=2)
    assert_names(said, "every", "0.5")


def test_a_journal_of_robots_needs_keys(tmp_path: Path):
    keeper = manager(tmp_path / "journal")
    feed(keeper, *random_ratings(5))
    keeper.close()
    printed("manager", "backup", tmp_path / "journal", tmp_path / "copy")
    assert (tmp_path / "copy").read_bytes() == (tmp_path / "journal").read_bytes()
    assert_names(printed("manager", "check", tmp_path / "copy", code=2), "--keys")
    assert_names(printed("manager", "check", tmp_path / "nowhere", code=2), "nowhere")
