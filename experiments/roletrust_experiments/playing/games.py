"""Many games of one scenario under some trust models: what they would take, what came of them, and that as a table."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from rich.progress import Progress

from roletrust_env import Game, JointPolicy, Policy
from roletrust_env.evaluation.attacked_games import HELD_OUT, AttackedRound, judged_rollout, random_sources
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.evaluation.curves import Curves, kept_bytes
from roletrust_env.evaluation.resources import Cost, some, try_out
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.rollout import rollout
from roletrust_env.metrics.confidence import Estimate, over_games
from roletrust_experiments.playing.group_measures import Group, damage, measure, measured_since, under_attack
from roletrust_experiments.playing.tracked import track_curves

HEADER = ("trust_model", "time_s", "agent", "trust", "mean", "low", "high", "games")


class Played(NamedTuple):
    """One trust model's games.

    Attributes:
        model: its name, as it was given.
        game: that was played.
        curves: that it left behind.
        groups: how the agents fared.
        damage: that an attack did, by whom it befell.
        metrics: of an attack, by their names, see `measures.under_attack`.
    """

    model: str
    game: Game
    curves: Curves
    groups: list[Group]
    damage: dict[str, Estimate]
    metrics: dict[str, Estimate]


def has_twin(game: Game, attackers: Mapping[str, Policy]) -> bool:
    """Whether the games are played again with everyone honest: a live camera shows nothing twice."""
    return bool(attackers) and not isinstance(game.scenario.frames, int)


def all_kept_bytes(joint_policies: Sequence[JointPolicy], attackers: Mapping[str, Policy]) -> int:
    """The memory that the curves of every game take at the worst moment, see `foresee`."""
    return kept_bytes(joint_policies[0]) * (len(joint_policies) + has_twin(joint_policies[0].game, attackers) + 1)


def foresee(joint_policies: Sequence[JointPolicy], attackers: Mapping[str, Policy]) -> Cost:
    """What every game takes, under all the models: bytes at the worst moment, and seconds to the end.

    The curves of all models are kept to the end. Besides there are those of the games without the attack, and while
    the last games are recorded, their rows, of which the curves are made.
    """
    game, twin = joint_policies[0].game, has_twin(joint_policies[0].game, attackers)
    trial = try_out(lambda games: rollout(joint_policies[0], game.random(0), game.random(0), (games,)), some(game))
    memory = all_kept_bytes(joint_policies, attackers) + trial.memory
    return Cost(memory, trial.seconds * game.scenario.max_cycles * len(joint_policies) * (1 + twin))


def task_memory(task: AttackTask, attacker: Attacker) -> float:
    """The memory that each game takes in which an attacker is measured, bytes."""

    def played(games: int) -> Iterator[AttackedRound]:
        return judged_rollout(task, attacker, (1, games), *random_sources(task, 0, HELD_OUT))

    return try_out(played, some(task.game)).memory


def play_games(
    model: str, joint_policy: JointPolicy, attackers: Mapping[str, Policy], *, games: int, seed: int, progress: Progress
) -> Played:
    """Play under one trust model, with the attack and once more without, and measure it."""
    game, twin, rates_raters = joint_policy.game, None, joint_policy.game.model.rates_raters
    attackers = game.roster.with_reserves(attackers)
    curves = track_curves(joint_policy, seed, progress, f"Playing, {model}", games=games)
    if has_twin(game, attackers):
        twin = track_curves(JointPolicy(game, {}), seed, progress, f"Playing, {model}, all honest", games=games)
    lost = damage(game.roster, curves, twin, attackers, rates_raters) if twin else {}
    metrics = under_attack(game.roster, curves, twin, attackers, rates_raters) if attackers else {}
    since = measured_since(attackers, game.scenario.max_cycles)
    groups = measure(game.roster, curves, attackers, since, rates_raters)
    return Played(model, game, curves, groups, lost, metrics)


def rows(played: Played) -> list[tuple[Any, ...]]:
    """One row for each agent, trust and round: the mean over the games in which it was present, and its interval."""
    roster, curves, found = played.game.roster, played.curves, []
    tables = [("ToR", roster.rater_names, curves.tor), ("ToP", roster.provider_names, curves.top)]
    if roster.n_both:
        first = roster.n_agents - roster.n_both
        tables.append(("ToA", roster.names[first:], curves.trust[:, first:]))
    for trust, names, values in tables:
        mean, half, games = over_games(values)
        for i, name in enumerate(names):
            columns = (mean[:, i], (mean - half)[:, i], (mean + half)[:, i], games[:, i])
            table = zip(curves.time_s.tolist(), *(column.tolist() for column in columns), strict=True)
            found += [(played.model, time_s, name, trust, *rest) for time_s, *rest in table]
    return found
