"""Saved attackers that are safe to share: weights in safetensors, all else in JSON. Loading runs no code.

An attacker is a pair of files, `NAME.safetensors` and `NAME.json`. What does not fit is refused with a `ValueError`:
names, shapes, dtypes, sizes and values are checked, and the JSON holds a digest of the weights.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors import numpy as safetensors

from roletrust_agents.learned.cards import Card, ModelCard, TaskCard
from roletrust_agents.learned.network import MAX_WEIGHTS, Floats, Network
from roletrust_env.game.attack_task import AttackTask, make_task
from roletrust_env.game.stealth import Stealth
from roletrust_env.game.views import Layout
from roletrust_env.storage.untrusted import check_scenario_size, parse_json, parse_untrusted, read_limited
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario

ZOO = Path(__file__).parent.parent / "zoo"
"""The attackers that come with the project."""

MAX_JSON, MAX_SAFETENSORS = 1_000_000, 4 * MAX_WEIGHTS + 100_000
"""Bytes that the two files may have."""


@dataclass(frozen=True, eq=False)
class SavedAttacker:
    """A trained attacker: what is known of it, and its network."""

    card: Card
    network: Network

    @property
    def layout(self) -> Layout:
        """Of the game that it was trained in."""
        roster = Roster.of(self.card.scenario)
        return Layout(roster.n_raters, roster.n_providers, self.card.scenario.max_cycles)

    def task(self) -> AttackTask:
        """The task that it was trained for, on NumPy in float32."""
        return task_from_card(self.card.task, self.card.trust_model, self.card.scenario)


def task_from_card(task: TaskCard, trust_model: ModelCard, scenario: Scenario) -> AttackTask:
    """The task that these say, on NumPy in float32."""
    return make_task(
        scenario,
        task.compromised,
        trust_model=trust_model.make(),
        objective=task.objective,
        stealth=Stealth(task.stealth.weight, task.stealth.tolerance),
        knowledge=task.knowledge,
        accomplices=task.accomplices,
    )


def digest(data: bytes) -> str:
    """SHA-256."""
    return hashlib.sha256(data).hexdigest()


def weights_bytes(network: Network) -> bytes:
    """The weights as a safetensors file; the same weights give the same bytes."""
    return safetensors.save({name: np.ascontiguousarray(network.weights[name]) for name in sorted(network.weights)})


def save_attacker(attacker: SavedAttacker, path: Path, write: Callable[[Path, bytes], object]) -> None:
    """Write the pair of files.

    Args:
        attacker: whose card holds the digest of its weights.
        path: of either file, or without a suffix.
        write: writes bytes to a path, `Path.write_bytes` or one that is atomic.
    """
    data = weights_bytes(attacker.network)
    if digest(data) != attacker.card.weights_sha256:
        raise ValueError("the card is of other weights")
    path = _stem(path)
    write(path.with_name(path.name + ".safetensors"), data)
    write(path.with_name(path.name + ".json"), (attacker.card.model_dump_json(indent=1) + "\n").encode())


def zoo(folder: Path = ZOO) -> list[str]:
    """The names of the attackers in a folder, by default those that come with the project."""
    return sorted(path.stem for path in folder.glob("*.json") if path.with_suffix(".safetensors").exists())


def load_attacker(path: str | Path) -> SavedAttacker:
    """Read a saved attacker. No code in it is run, and nothing is imported for it.

    Args:
        path: of either file, or without a suffix, or a folder that holds `attacker.json`; or the name of an attacker
            that comes with the project, such as `provider-3x3`.

    Raises:
        ValueError: a file is missing, too large or broken, or something in it does not fit.
    """
    path = Path(path)
    path = path / "attacker" if path.is_dir() else _stem(path)
    if len(path.parts) == 1 and not path.with_name(path.name + ".json").exists() and path.name in zoo():
        path = ZOO / path.name
    text = _read(path.with_name(path.name + ".json"), MAX_JSON)
    data = _read(path.with_name(path.name + ".safetensors"), MAX_SAFETENSORS)
    try:
        return parse_attacker(text, data)
    except ValueError as error:
        raise ValueError(f"saved attacker {path}: {error}") from None


def parse_attacker(text: bytes, data: bytes) -> SavedAttacker:
    """A saved attacker of the contents of its two files.

    Raises:
        ValueError: something does not fit.
    """
    if len(text) > MAX_JSON or len(data) > MAX_SAFETENSORS:
        raise ValueError(f"the files have {len(text)} and {len(data)} bytes: too many")
    said = parse_json(text)
    if isinstance(said, dict) and isinstance(said.get("scenario"), dict):
        check_scenario_size(said["scenario"])
    card = parse_untrusted(Card, text)
    if digest(data) != card.weights_sha256:
        raise ValueError("the weights are not those that the JSON is about: their digest differs")
    seen = card.observation
    mean, variance = (np.asarray(values, np.float32) for values in (seen.mean, seen.variance))
    return SavedAttacker(card, Network(card.architecture, mean, variance, read_weights(data)))


def read_weights(data: bytes) -> dict[str, Floats]:
    """The arrays of a safetensors file.

    Raises:
        ValueError: it is none.
    """
    try:
        return safetensors.load(data)
    except (SafetensorError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"the weights are no safetensors file: {error}") from None


def _stem(path: Path) -> Path:
    return path.with_suffix("") if path.suffix in (".json", ".safetensors") else path


def _read(path: Path, limit: int) -> bytes:
    if not path.is_file():
        raise ValueError(
            f"there is no file {path}; a saved attacker is a .json and a .safetensors file of one name, "
            "which training leaves at its end"
        )
    return read_limited(path, limit)
