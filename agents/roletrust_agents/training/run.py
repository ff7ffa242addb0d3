"""A training run: what determines its result, its progress, and the saved attacker at its end."""

import json
from collections.abc import Callable
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from roletrust_agents.learned.cards import (
    Card,
    InputCard,
    ModelCard,
    ScoreCard,
    TaskCard,
    TrainingCard,
    observation_fields,
)
from roletrust_agents.learned.deep_set import DeepSet
from roletrust_agents.learned.network import Network
from roletrust_agents.learned.policy import play_task
from roletrust_agents.learned.saved import SavedAttacker, digest
from roletrust_agents.learned.weights import weights_bytes
from roletrust_agents.training.settings import Algo
from roletrust_env import Scenario, __version__
from roletrust_env.errors import explain
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.metrics.confidence import GameMean, over_games

GAMES = 16
"""Number of held-out games for a score during training, which chooses the best network."""

_LAST_GAMES = 256  # for the last score


class Run(BaseModel):
    """Everything that determines the result of a training run, except the software."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    algo: Algo
    steps: int
    seed: int
    settings: dict[str, Any]
    task: TaskCard
    trust_model: ModelCard
    further_models: tuple[ModelCard, ...] = ()
    scenario: Scenario

    @classmethod
    def read(cls, data: Any) -> "Run":
        """Return a run from the output of `model_dump`.

        Raises:
            ValueError: A field is missing or not allowed.
        """
        try:
            return cls.model_validate_json(json.dumps(data))  # strict, but for JSON's lists
        except ValidationError as error:
            raise ValueError(f"the run folder's config.json: {explain(error)}") from None


class CurvePoint(NamedTuple):
    """A point of the learning curve.

    Attributes:
        steps: Number of rounds so far.
        seconds: Training time so far, including the time before interruptions.
        score: Mean reward per round in held-out games, without exploration.
        half_95: Half the 95% confidence interval; NaN for one game.
    """

    steps: int
    seconds: float
    score: float
    half_95: float


class TrainingReport(NamedTuple):
    """Progress of the training."""

    steps: int
    curve: list[CurvePoint]


OnReport = Callable[[TrainingReport], None]


def score_of(task: AttackTask, network: Network | DeepSet, seed: int) -> GameMean:
    """Return the score of a network during training."""
    return over_games(_play(task, network, games=GAMES, key=(seed, 1)))


def _play(task: AttackTask, network: Network | DeepSet | None, *, games: int, key: tuple[int, int]) -> Any:
    """Return the scores of games; `key` separates training, scores during training and last scores."""
    return play_task(task, network, games=games, seed=int(np.random.SeedSequence(key).generate_state(1)[0]))


def finish(
    run: Run, task: AttackTask, network: Network | DeepSet, curve: list[CurvePoint], rounds: int
) -> SavedAttacker:
    """Return the attacker with its card, measured in games that chose nothing.

    Args:
        run: Run that has ended.
        task: Task of the run.
        network: Network that was found.
        curve: Learning curve.
        rounds: Number of all rounds that were played.
    """
    key = (run.seed, 2)
    scores = over_games(_play(task, network, games=_LAST_GAMES, key=key))
    honest = over_games(_play(task, None, games=_LAST_GAMES, key=key))
    card = Card(
        package_version=__version__,
        task=run.task,
        trust_model=run.trust_model,
        further_models=run.further_models,
        scenario=run.scenario,
        observation=_input_card(run, network) if isinstance(network, Network) else None,
        architecture=network.architecture,
        training=TrainingCard(
            algorithm=run.algo,
            steps=run.steps,
            rounds=rounds,
            seed=run.seed,
            seconds=round(curve[-1].seconds, 1),
            settings={name: _plain(value) for name, value in run.settings.items()},
            versions=versions(),
        ),
        score=ScoreCard(
            mean=float(scores.mean),
            half_95=float(scores.half),
            games=_LAST_GAMES,
            seed=int(np.random.SeedSequence(key).generate_state(1)[0]),
            honest=float(honest.mean),
        ),
        weights_sha256=digest(weights_bytes(network)),
    )
    return SavedAttacker(card, network)


def _input_card(run: Run, network: Network) -> InputCard:
    fields = observation_fields(run.scenario, run.task.compromised, run.task.knowledge, network.architecture.inputs)
    return InputCard(fields=fields, mean=tuple(network.mean.tolist()), variance=tuple(network.variance.tolist()))


def _plain(value: Any) -> int | float | str:
    return value if isinstance(value, int | float) else str(value)


def versions() -> dict[str, str]:
    """Return the versions of the packages that affect training."""
    return {name: version(name) for name in ("torch", "stable-baselines3", "sb3-contrib", "gymnasium", "numpy")}
