"""What is kept of each step of a game, and the check of a file that an interrupted game has left."""

from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeInt

from roletrust_agents.learned.cards import Number
from roletrust_agents.training.defence_learners import learner_of
from roletrust_env.benchmarking.known_attacks import KnownAttack, check_records
from roletrust_env.storage.untrusted import UntrustedModel, check_plain
from studies.attackers.runs import Check, Run
from studies.defence.double_oracle import Setup

Numbers = tuple[Number, ...]


class _Begun(UntrustedModel):
    """Attackers of the beginning."""

    attackers: Annotated[tuple[KnownAttack, ...], Field(min_length=1)]


class _Response(UntrustedModel):
    """Attacker that was trained."""

    attacker: KnownAttack
    rounds: NonNegativeInt


class _Trained(UntrustedModel):
    """Defence that was trained."""

    spec: str
    vector: Numbers
    score: float
    start: float
    rounds: NonNegativeInt


class _Met(UntrustedModel):
    """Skill under each attack, in the games that choose and in those that measure."""

    attacks: Annotated[dict[str, tuple[Numbers, Numbers]], Field(min_length=1)]


class _Clean(UntrustedModel):
    """Skill where nobody attacks."""

    skill: Numbers


def check_of(setup: Setup, fresh: int) -> Check:
    """Return the check of the runs of a game and of the comparison behind it.

    Args:
        setup: Settings of the game.
        fresh: Number of games of the comparison.
    """

    def check(key: str, run: Run) -> None:
        kind, _, rest = key.partition("|")
        if kind == "start":
            check_records(check_plain(_Begun, run).attackers)
        elif kind in ("attack", "own"):
            check_records([check_plain(_Response, run).attacker])
        elif kind == "defence":
            _check_trained(rest.partition("|")[2], check_plain(_Trained, run))
        elif kind == "clean":
            _check_games(fresh, check_plain(_Clean, run).skill)
        elif kind in ("payoff", "seen", "held out"):
            for halves in check_plain(_Met, {"attacks": run}).attacks.values():
                _check_games(setup.games if kind == "payoff" else fresh, *halves)
        else:
            raise ValueError("there is no step of this name")

    return check


def _check_trained(name: str, trained: _Trained) -> None:
    learner = learner_of(name)
    if len(trained.vector) != (wanted := len(learner.start())):
        raise ValueError(f"vector has {len(trained.vector)} numbers; {name} has {wanted}")
    if learner.spec(np.array(trained.vector)) != trained.spec:
        raise ValueError("spec and vector are not of one model")


def _check_games(games: int, *parts: Numbers) -> None:
    for part in parts:
        if len(part) != games:
            raise ValueError(f"it has {len(part)} games; the settings have {games}")
