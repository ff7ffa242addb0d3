"""Games of one scenario under several trust models: their cost, their results, and a table of
these.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from rich.progress import Progress

from roletrust_env import Game, JointPolicy, Policy
from roletrust_env.evaluation.curves import Curves, curve_bytes, record_curves
from roletrust_env.evaluation.resources import Cost, trial_size, try_out
from roletrust_env.game.policy import policy_name
from roletrust_env.game.rollout import rollout
from roletrust_env.game.state import State
from roletrust_env.metrics.confidence import Estimate, over_games
from roletrust_experiments.playing.group_measures import (
    Group,
    damage,
    measure,
    measured_since,
    under_attack,
)

HEADER = ("trust_model", "time_s", "agent", "trust", "mean", "low", "high", "games")


class Played(NamedTuple):
    """The games of one trust model.

    Attributes:
        model: Name of the model, as the user gave it.
        game: Game that was played.
        curves: Curves of the games.
        groups: Results of each group of agents.
        damage: Damage of the attack, by group of victims.
        metrics: Metrics of the attack by name, see `group_measures.under_attack`.
    """

    model: str
    game: Game
    curves: Curves
    groups: list[Group]
    damage: dict[str, Estimate]
    metrics: dict[str, Estimate]


def has_twin(game: Game, attackers: Mapping[str, Policy]) -> bool:
    """Return whether the games are played again with all agents honest. A live camera shows nothing
    twice.
    """
    return bool(attackers) and not isinstance(game.scenario.frames, int)


def all_curve_bytes(joint_policies: Sequence[JointPolicy], attackers: Mapping[str, Policy]) -> int:
    """Return the peak memory of the curves of each game in bytes, see `foresee`."""
    return curve_bytes(joint_policies[0]) * (
        len(joint_policies) + has_twin(joint_policies[0].game, attackers) + 1
    )


def foresee(joint_policies: Sequence[JointPolicy], attackers: Mapping[str, Policy]) -> Cost:
    """Return the peak memory in bytes and the time in seconds of each game, over all models.

    The curves of all models stay in memory to the end. In addition there are the curves without the
    attack and, while the last games are recorded, the rows of their curves.
    """
    game, twin = joint_policies[0].game, has_twin(joint_policies[0].game, attackers)
    trial = try_out(
        lambda games: rollout(joint_policies[0], game.random(0), game.random(0), (games,)),
        trial_size(game),
    )
    memory = all_curve_bytes(joint_policies, attackers) + trial.memory
    return Cost(memory, trial.seconds * game.scenario.max_cycles * len(joint_policies) * (1 + twin))


def play_games(
    model: str,
    joint_policy: JointPolicy,
    attackers: Mapping[str, Policy],
    *,
    games: int,
    seed: int,
    progress: Progress,
) -> Played:
    """Play and measure the games of one trust model, with the attack and without it."""
    game, twin, rates_raters = joint_policy.game, None, joint_policy.game.model.rates_raters
    attackers = game.roster.with_reserves(attackers)
    curves = track_curves(joint_policy, seed, progress, f"Playing, {model}", games=games)
    if has_twin(game, attackers):
        twin = track_curves(
            JointPolicy(game, {}), seed, progress, f"Playing, {model}, all honest", games=games
        )
    lost = damage(game.roster, curves, twin, attackers, rates_raters) if twin else {}
    metrics = under_attack(game.roster, curves, twin, attackers, rates_raters) if attackers else {}
    since = measured_since(attackers, game.scenario.max_cycles)
    groups = measure(game.roster, curves, attackers, since, rates_raters)
    return Played(model, game, curves, groups, lost, metrics)


def rows(played: Played) -> list[tuple[Any, ...]]:
    """Return a row for each agent, trust and round: the mean over games with the agent present, and
    its interval.
    """
    roster, curves, lines = played.game.roster, played.curves, []
    tables = [("ToR", roster.rater_names, curves.tor), ("ToP", roster.provider_names, curves.top)]
    if roster.n_both:
        first = roster.n_agents - roster.n_both
        tables.append(("ToA", roster.names[first:], curves.trust[:, first:]))
    for trust, names, values in tables:
        mean, half, games = over_games(values)
        for i, name in enumerate(names):
            columns = (mean[:, i], (mean - half)[:, i], (mean + half)[:, i], games[:, i])
            table = zip(
                curves.time_s.tolist(), *(column.tolist() for column in columns), strict=True
            )
            lines += [(played.model, time_s, name, trust, *rest) for time_s, *rest in table]
    return lines


def track_curves(
    joint_policy: JointPolicy,
    seed: int,
    progress: Progress,
    label: str,
    *,
    games: int = 1,
    on_round: Callable[[State], None] = lambda state: None,
) -> Curves:
    """Return the curves of games and show the progress. Other arguments as for `record_curves`.

    Args:
        joint_policy: Game and policies of its agents.
        seed: Random seed.
        progress: Progress display.
        label: Name of the work in the display.
        games: Number of games.
        on_round: Called with the state after each round.
    """
    job = progress.add_task(label, total=joint_policy.game.scenario.max_cycles)

    def advance(state: State) -> None:
        on_round(state)
        progress.advance(job)

    return record_curves(joint_policy, seed, games=games, on_round=advance)


def attacks_in_words(attackers: Mapping[str, Policy]) -> str:
    """Return the attacks and the number of agents that play each, such as `bad-mouthing x3,
    on-off`.
    """
    counts = Counter(policy_name(policy) for policy in attackers.values())
    return (
        ", ".join(f"{name} x{n}" if n > 1 else name for name, n in counts.items())
        or "everyone honest"
    )
