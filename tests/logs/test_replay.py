"""Attacks at the end of a log."""

import shlex
import sys

import numpy as np
import pytest
from refusals import refuses
from small_logs import small_log, synthetic_log

from roletrust_env.logs.log import Log
from roletrust_env.logs.replay import Attack, Replay, Shift, replay_attacks
from roletrust_env.trust import make_trust_model
from roletrust_env.trust.remote import RemoteModel

NO_COPIES = """
from roletrust_env.trust import remote
answer = remote.TrustService.answer
def plain(service, line):
    return (answer(service, line) or "").replace(', "copies": true', "") or None
remote.TrustService.answer = plain
remote.main("beta")
"""
MONTH = 2_592_000


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return synthetic_log(tmp_path_factory.mktemp("log"))


@pytest.mark.parametrize("same_agents", [True, False])
def test_hostile_accounts_move_their_targets(log: Log, same_agents: bool) -> None:
    attacks = [Attack("sink", 3, "new"), Attack("sink", 10, "hijacked"), Attack("lift", 3, "new")]

    def play(name: str) -> dict[Attack, Shift]:
        return replay_attacks(
            Replay(make_trust_model(name), log, MONTH, same_agents=same_agents), attacks
        )

    moved = play("mean")
    assert moved[attacks[0]].before.value > 0.7 > 0.3 > moved[attacks[0]].after.value
    assert moved[attacks[2]].after.value > moved[attacks[2]].before.value
    still = play("constant")
    assert all(found.before == found.after for found in still.values())


@pytest.mark.parametrize(
    "command", [["-m", "roletrust_env.trust.remote", "beta"], ["-c", NO_COPIES]]
)
def test_a_model_in_another_process_is_moved_as_one_inside(log: Log, command: list[str]) -> None:
    attacks = [Attack("sink", 3, "new"), Attack("lift", 3, "hijacked")]
    remote = RemoteModel(f"exec:{shlex.join([sys.executable, *command])}")
    inside, apart = (
        replay_attacks(Replay(model, log, MONTH, same_agents=True), attacks)
        for model in (make_trust_model("beta"), remote)
    )
    for attack in attacks:
        np.testing.assert_array_equal(inside[attack].targets, apart[attack].targets)


def test_a_log_without_enough_rounds_or_agents_is_refused(log: Log) -> None:
    model = make_trust_model("mean")
    with refuses(ValueError, "4", "6"):
        Replay(model, log, 6 * MONTH, same_agents=True)
    few = small_log([(n % 3, 3, 1.0, n * 10) for n in range(20)])
    with refuses(ValueError, "20", "10", "5"):
        Replay(model, few, 10, same_agents=True)
