"""The models that a game has trained, as files."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from roletrust_agents.learned.saved import digest
from roletrust_agents.learned.saved_defence import DefenceCard, save_defence, weights_bytes
from roletrust_agents.training.defence_learners import NetworkLearner
from roletrust_agents.training.runs import write_bytes
from roletrust_env import __version__
from roletrust_env.storage.files import write_text
from studies.defence.double_oracle import Game


def save_models(out: Path, game: Game, learned: Mapping[str, int]) -> list[str]:
    """Write the best model of each learner: its spec, or the files of a network.

    Args:
        out: Folder.
        game: Game that is played to its end.
        learned: Iteration, from 0, of the best model of each learner.

    Returns:
        The names of the files.
    """
    names = [name for name in learned if name != NetworkLearner.name]
    for name in names:
        write_text(out / _file(name), game.runs[f"defence|{learned[name]}|{name}"]["spec"] + "\n")
    files = [_file(name) for name in names]
    return files + _save_network(out, game, learned[NetworkLearner.name]) if NetworkLearner.name in learned else files


def _file(name: str) -> str:
    """Return the name of the file of a learner; not all systems allow the colon of an own class in it."""
    return f"{name.replace(':', '.')}.txt"


def _save_network(out: Path, game: Game, k: int) -> list[str]:
    name, setup, learner = NetworkLearner.name, game.setup, NetworkLearner()
    vector = np.array(game.runs[f"defence|{k}|{name}"]["vector"])
    weights = np.array(learner.weights(vector))
    card = DefenceCard(
        package_version=__version__,
        parameters=learner.parameters(vector),
        conditions=tuple(str(front.condition) for front in game.fronts),
        iteration=k + 1,
        seed=setup.seed,
        settings={"steps": setup.climb.steps, "budget": setup.budget, "explored": setup.explored},
        weights_sha256=digest(weights_bytes(weights)),
    )
    save_defence(weights, card, out / name, write_bytes)
    return [f"{name}.safetensors", f"{name}.json"]
