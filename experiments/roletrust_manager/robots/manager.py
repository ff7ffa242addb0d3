"""The manager of a team, and its trust on a recording."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from roletrust_env import make_scenario
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.storage.files import replacing
from roletrust_manager.admission.keys import PublicKeys
from roletrust_manager.admission.validation import RefusalReason
from roletrust_manager.dds.manager import Manager
from roletrust_manager.dds.nodes.manager_node import replay_recording, run_manager_node
from roletrust_manager.dds.nodes.run_loop import round_period
from roletrust_manager.dds.rounds import RoundTiming
from roletrust_manager.team import Team


def run_manager(
    journal: Path,
    *,
    model: str = "role-trust",
    keys: Path | None = None,
    scenario: str = "paper-3x3",
    speed: float = 1.0,
    network: bool = False,
) -> None:
    """Run the manager of a team until a signal ends the process.

    Args:
        journal: Path of the journal; an existing one is continued.
        model: Trust model, `NAME[:key=value,...]`.
        keys: Folder with the manager's private key and all public keys; None for no signatures.
        scenario: Name or file of the scenario, which sets the agents that are expected.
        speed: Speed relative to the scenario's clock, from 0.1 to 20.
        network: Whether to communicate with other machines, too.

    Raises:
        ValueError: An argument is not allowed, another manager is active, or the journal does not
            fit, see `Manager`.
    """
    rules = make_scenario(scenario)
    run_manager_node(
        parse_trust_model(model, rules),
        journal,
        period=round_period(rules.period_s, speed),
        team=Team.of(rules),
        keys=keys,
        network=network,
    )


class Replayed(NamedTuple):
    """What a replay has given.

    Attributes:
        rounds: Number of rounds in the journal.
        refusals: Number of refused messages by rater and reason.
    """

    rounds: int
    refusals: Counter[tuple[str, RefusalReason]]


def replay(
    recording: Path,
    journal: Path,
    *,
    model: str = "role-trust",
    keys: Path | None = None,
    scenario: str = "paper-3x3",
    speed: float = 1.0,
    progress: Callable[[int, int], object] = lambda done, total: None,
) -> Replayed:
    """Play a recording through a manager. With the model and the keys of the team, its trust is the
    same to the last bit.

    Args:
        recording: Folder of the recording.
        journal: Path of the journal, a new file.
        model: Trust model, see `run_manager`.
        keys: Folder with the public keys of the team; None accepts ratings in any name.
        scenario: Name or file of the scenario of the team.
        speed: Speed of the team relative to the scenario's clock, from 0.1 to 20.
        progress: Function that is called with the number of messages so far, and with that of all.

    Raises:
        ValueError: An argument is not allowed, or the recording cannot be read.
        OSError: The journal exists already, or cannot be written.
    """
    from roletrust_manager.dds.wire.recording import read_recording  # a manager needs none

    rules = make_scenario(scenario)
    period = round_period(rules.period_s, speed)
    if journal.exists():
        raise FileExistsError(f"{journal} exists already; a replay needs a new file")
    with replacing(journal) as path:
        manager = Manager(
            parse_trust_model(model, rules),
            path,
            timing=RoundTiming(period),
            team=Team.of(rules),
            keyring=None if keys is None else PublicKeys(keys),
        )
        messages = read_recording(recording, progress)
        rounds = sum(1 for _ in replay_recording(messages, manager, period))
        manager.close()
    return Replayed(rounds, manager.admission.refusals)
