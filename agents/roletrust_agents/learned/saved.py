"""Saved attackers that are safe to share: weights in safetensors, all other data in JSON. Loading
executes no code.

An attacker is a pair of files, `NAME.safetensors` and `NAME.json`. Names, shapes, dtypes, sizes and
values are checked, and the JSON holds a digest of the weights. Invalid files raise a `ValueError`.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from roletrust_agents.learned.cards import Card, ModelCard, TaskCard
from roletrust_agents.learned.deep_set import DeepSet, DeepSetArchitecture
from roletrust_agents.learned.network import MAX_WEIGHTS, Network
from roletrust_agents.learned.weights import read_weights, weights_bytes
from roletrust_env.benchmarking.suite_files import setting_worlds
from roletrust_env.game.attack_task import AttackTask, Stealth
from roletrust_env.game.make_task import Observation, make_task
from roletrust_env.game.views import ViewLayout
from roletrust_env.storage.untrusted import (
    check_file,
    check_scenario_size,
    parse_json,
    parse_untrusted,
    read_limited,
)
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario

ZOO = Path(__file__).parent.parent / "zoo"
"""Folder of the attackers that come with the project."""

MAX_JSON, MAX_SAFETENSORS = 1_000_000, 4 * MAX_WEIGHTS + 100_000
"""Largest sizes of the two files, in bytes."""


@dataclass(frozen=True, eq=False)
class SavedAttacker:
    """Trained attacker: its card and its network."""

    card: Card
    network: Network | DeepSet

    @property
    def layout(self) -> ViewLayout:
        """Layout of the observations in the game of the training."""
        roster = Roster.of(self.card.scenario)
        return ViewLayout(roster.n_raters, roster.n_providers, self.card.scenario.max_cycles)

    def task(self) -> AttackTask:
        """Return the task of the training, on NumPy in float32; of several worlds the first one."""
        return task_from_card(self.card.task, self.card.trust_model, self.card.scenario)

    def tasks(self) -> list[AttackTask]:
        """Return the tasks of the training, see `tasks_from_card`."""
        return tasks_from_card(self.card.task, self.card.trust_model, self.card.scenario)


def task_from_card(
    task: TaskCard, trust_model: ModelCard, scenario: Scenario, observation: Observation = "agents"
) -> AttackTask:
    """Return the task described by cards, on NumPy in float32; see `make_task` for
    `observation`.
    """
    return make_task(**arguments_from_card(task, trust_model, scenario), observation=observation)


def tasks_from_card(
    task: TaskCard, trust_model: ModelCard, scenario: Scenario, observation: Observation = "agents"
) -> list[AttackTask]:
    """Return the task described by cards, or that in each selection world of a setting of a suite.

    The id of the latter is `SUITE:SETTING`, see `setting_worlds`.

    Raises:
        ValueError: The suite has changed since the training.
    """
    if ":" not in task.id:
        return [task_from_card(task, trust_model, scenario, observation)]
    worlds = setting_worlds(task.id)
    if worlds[0].scenario != scenario:
        raise ValueError(f"the worlds of {task.id} are no longer those of the training")
    return [
        task_from_card(
            task.model_copy(update={"compromised": world.compromised}),
            trust_model,
            world.scenario,
            observation,
        )
        for world in worlds
    ]


def arguments_from_card(
    task: TaskCard, trust_model: ModelCard, scenario: Scenario
) -> dict[str, Any]:
    """Return the arguments of `make_task` for the task described by cards."""
    return {
        "scenario": scenario,
        "compromised": task.compromised,
        "trust_model": trust_model.make(),
        "objective": task.objective,
        "stealth": Stealth(task.stealth.weight, task.stealth.tolerance),
        "knowledge": task.knowledge,
        "accomplices": task.accomplices,
        "consumers": task.consumers,
    }


def digest(data: bytes) -> str:
    """Return the SHA-256 digest of bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def save_attacker(
    attacker: SavedAttacker, path: Path, write: Callable[[Path, bytes], object]
) -> None:
    """Write the pair of files.

    Args:
        attacker: Attacker, with the digest of its weights in its card.
        path: Path of either file, or without a suffix.
        write: Function that writes bytes to a path, such as `Path.write_bytes` or an atomic one.

    Raises:
        ValueError: The digest in the card belongs to other weights.
    """
    data = weights_bytes(attacker.network)
    if digest(data) != attacker.card.weights_sha256:
        raise ValueError("the digest in the card belongs to other weights")
    path = _stem(path)
    write(path.with_name(path.name + ".safetensors"), data)
    write(
        path.with_name(path.name + ".json"),
        (attacker.card.model_dump_json(indent=1) + "\n").encode(),
    )


def zoo(folder: Path = ZOO) -> list[str]:
    """Return the names of the attackers in a folder, by default those that come with the
    project.
    """
    return sorted(
        path.stem for path in folder.glob("*.json") if path.with_suffix(".safetensors").exists()
    )


def load_attacker(path: str | Path) -> SavedAttacker:
    """Read a saved attacker. This executes no code of the files and imports nothing.

    Args:
        path: Path of either file, or without a suffix, or of a folder with `attacker.json`; or the
            name of an attacker that comes with the project, such as `provider-3x3`.

    Raises:
        ValueError: A file is missing, too large or not valid.
    """
    path = Path(path)
    path = path / "attacker" if path.is_dir() else _stem(path)
    if (
        len(path.parts) == 1
        and not path.with_name(path.name + ".json").exists()
        and path.name in zoo()
    ):
        path = ZOO / path.name
    text = _read(path.with_name(path.name + ".json"), MAX_JSON)
    data = _read(path.with_name(path.name + ".safetensors"), MAX_SAFETENSORS)
    try:
        return parse_attacker(text, data)
    except ValueError as error:
        raise ValueError(f"saved attacker {path}: {error}") from None


def parse_attacker(text: bytes, data: bytes) -> SavedAttacker:
    """Return the saved attacker in the contents of its two files.

    Raises:
        ValueError: The files are not valid.
    """
    if len(text) > MAX_JSON or len(data) > MAX_SAFETENSORS:
        raise ValueError(
            f"the files have {len(text)} and {len(data)} bytes; the limits are {MAX_JSON} and "
            f"{MAX_SAFETENSORS}"
        )
    fields = parse_json(text)
    if isinstance(fields, dict) and isinstance(fields.get("scenario"), dict):
        check_scenario_size(fields["scenario"])
    card = parse_untrusted(Card, text)
    if digest(data) != card.weights_sha256:
        raise ValueError("the digest of the weights differs from the one in the JSON file")
    weights = read_weights(data)
    if isinstance(card.architecture, DeepSetArchitecture):
        return SavedAttacker(card, DeepSet(card.architecture, weights))
    assert card.observation is not None  # the card has been checked
    mean, variance = (
        np.asarray(values, np.float32)
        for values in (card.observation.mean, card.observation.variance)
    )
    return SavedAttacker(card, Network(card.architecture, mean, variance, weights))


def _stem(path: Path) -> Path:
    return path.with_suffix("") if path.suffix in (".json", ".safetensors") else path


def _read(path: Path, limit: int) -> bytes:
    check_file(
        path,
        "a saved attacker is a .json and a .safetensors file with the same name, which training "
        "writes at its end",
    )
    return read_limited(path, limit)
