"""Games of one scenario under some trust models as one call: curves, and results of each group of
agents.
"""

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.evaluation.curves import Curves, curve_bytes, record_curves
from roletrust_env.evaluation.groups import (
    AUC_FINALLY,
    AUC_MEANWHILE,
    MEASURES,
    UTILITY_WITHOUT,
    Group,
    damage,
    measure,
    measured_since,
    under_attack,
)
from roletrust_env.evaluation.resources import Cost, in_time, trial_size, try_out
from roletrust_env.evaluation.specs import parse_attacks, parse_trust_model
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.policy import Policy, policy_name
from roletrust_env.game.rollout import rollout
from roletrust_env.game.state import State
from roletrust_env.memory import check_memory
from roletrust_env.metrics.confidence import Estimate, over_games
from roletrust_env.parameters import whole_number
from roletrust_env.storage.files import prepare_folder, write_csv, write_json
from roletrust_env.storage.markdown import ShownAsMarkdown, markdown_table, plain
from roletrust_env.storage.provenance import describe, describe_policies, provenance
from roletrust_env.world import Scenario, make_scenario

Advance = Callable[[str, float], None]
"""Called with what is being done, and the share of it that is done, in [0, 1]."""

_CURVES = ("trust_model", "time_s", "agent", "trust", "mean", "low", "high", "games")


class Played(NamedTuple):
    """The games of one trust model.

    Attributes:
        model: Name of the model, as the user gave it.
        joint_policy: Game that was played, with its attackers.
        curves: Curves of the games.
        groups: Results of each group of agents.
        damage: Damage of the attack, by group of victims.
        metrics: Metrics of the attack by name, see `under_attack`.
    """

    model: str
    joint_policy: JointPolicy
    curves: Curves
    groups: list[Group]
    damage: dict[str, Estimate]
    metrics: dict[str, Estimate]


@dataclass(frozen=True, repr=False)
class Results(ShownAsMarkdown):
    """Results of `play`.

    Attributes:
        scenario: Scenario of the games.
        attackers: Policies of the attackers by agent.
        games: Number of games of each trust model.
        seed: Random seed.
        played: Results of each trust model.
    """

    scenario: Scenario
    attackers: Mapping[str, Policy]
    games: int
    seed: int
    played: Sequence[Played]

    @property
    def title(self) -> str:
        """The scenario, the trust models and the attacks."""
        models = ", ".join(each.model for each in self.played)
        return f"{self.scenario.name}, {models}, {attacks_in_words(self.attackers)}"

    def data(self) -> dict[str, Any]:
        """Return all measurements with what determines them, as JSON has it; an undefined value is
        None, with the reason.
        """
        game = self.played[0].joint_policy.game
        about = {k: v for k, v in provenance(game, self.seed).items() if k != "trust_model"}
        models = {each.model: describe(each.joint_policy.game.model) for each in self.played}
        data = {
            "command": "roletrust play",
            "games": self.games,
            **about,
            "attackers": describe_policies(self.attackers),
            "trust_models": models,
            "measured": {each.model: _measured(each) for each in self.played},
        }
        plain: dict[str, Any] = json.loads(json.dumps(data))
        return plain

    def table(self) -> tuple[list[str], list[list[str]]]:
        """Return the headings and the rows of a table: groups of agents, and effects of the
        attack.
        """
        rows = []
        for each in self.played:
            if len(self.played) > 1:
                rows.append([each.model])
            for group in each.groups:
                here = f"{group.present.mean:.{0 if self.games == 1 else 1}f}".removesuffix(".0")
                cells = [_shown(estimate) for estimate in group.measures.values()]
                rows.append([group.label, f"{here}/{group.size}", *cells])
            rows += [[f"damage, {who}", "", _shown(lost)] for who, lost in each.damage.items()]
            for name, score in each.metrics.items():
                if name.startswith(AUC_MEANWHILE):
                    role = name.removeprefix(AUC_MEANWHILE)
                    end = _shown(each.metrics[AUC_FINALLY + role])
                    rows.append([f"AUC{role}", "", _shown(score), "", end])
                elif not name.startswith(AUC_FINALLY) and not np.isnan(score.mean):
                    rows.append([name, "", _shown(score)])
        headings = ["agents", "at end", *MEASURES]
        return headings, [[*row, *[""] * (len(headings) - len(row))] for row in rows]

    def notes(self) -> list[str]:
        """Return explanations of the numbers in the table, and what the attack does in words."""
        since = measured_since(self.attackers, self.scenario.max_cycles)
        many = "one game"
        if self.games > 1:
            many = f"mean of {self.games} games ± half the 95% confidence interval, rounded up"
        lines = [f"{many}; lowest trust: the least mean trust of the group from round {since} on"]
        models = [each for each in self.played if not each.joint_policy.game.model.rates_raters]
        if unrated := ", ".join(each.model for each in models):
            lines.append(
                f"no trust in raters: {unrated}: false alarms and recovery are of providers only"
            )
        undefined: dict[str, list[str]] = {}
        for each in self.played:
            for name, score in each.metrics.items():
                if score.why:
                    undefined.setdefault(f"{name}: undefined: {score.why}", []).append(each.model)
        several = len(self.played) > 1
        lines += [f"{why} ({', '.join(who)})" if several else why for why, who in undefined.items()]
        return lines + [f"{each.model}: {_verdict(each)}" for each in self.played if each.damage]

    def write(self, folder: str | Path) -> list[str]:
        """Write `curves.csv` and `results.json`, and return their names.

        Raises:
            OSError: The folder cannot be written.
        """
        prepare_folder(Path(folder))
        rows = [row for each in self.played for row in _rows(each)]
        write_csv(Path(folder) / "curves.csv", _CURVES, rows)
        write_json(Path(folder) / "results.json", self.data())
        return ["curves.csv", "results.json"]

    def _repr_markdown_(self) -> str:
        headings, rows = self.table()
        table = markdown_table(headings, [list(map(plain, row)) for row in rows], 1)
        return "\n\n".join([plain(self.title), table, *map(plain, self.notes())])


def play(
    scenario: str | Path | Scenario = "paper-3x3",
    *,
    model: str | Sequence[str] = "role-trust",
    attacks: str | Sequence[str] | Mapping[str, Policy] = (),
    games: int = 1,
    seed: int = 0,
    advance: Advance = lambda what, share: None,
    **changes: Any,
) -> Results:
    """Play games under each trust model, with the attacks and with all agents honest.

    Args:
        scenario: Name of a scenario, path of a TOML or YAML file, or a `Scenario`.
        model: Trust model `NAME[:key=value,...]`, or several.
        attacks: An attack `AGENT=NAME[:key=value,...]`, where AGENT may be like `sr_*`, or several;
            or policies by agent.
        games: Number of games, at least 1, which are played as one batch.
        seed: Random seed, at least 0; all models meet the same random numbers.
        advance: Called with the progress.
        **changes: Other values of fields of the scenario, such as `max_cycles=200`.

    Raises:
        ValueError: A name is unknown, a value is not allowed, a model is named twice, or so many
            games or rounds do not fit into the memory.

    Example:
        >>> from roletrust_env import play
        >>> results = play(attacks=["sr_2=bad-mouthing:start=4"], max_cycles=20)
        >>> round(results.data()["measured"]["role-trust"]["damage"]["3 sp"]["mean"], 3)
        0.376
    """
    whole_number("games", games, 1)
    whole_number("seed", seed)
    rules = make_scenario(scenario)
    rules = rules.change(**changes) if changes else rules
    models: list[Any] = list(model) if isinstance(model, list | tuple) else [model]
    texts = {text for text in models if isinstance(text, str)}
    if not models or len(texts) < len(models):
        raise ValueError(
            f"model is {model!r}; it must be NAME[:key=value,...], or several, each once"
        )
    if isinstance(attacks, Mapping):
        attackers = dict(attacks)
    else:
        attackers = parse_attacks([attacks] if isinstance(attacks, str) else list(attacks), rules)
    joint_policies = {
        text: JointPolicy(Game(rules, parse_trust_model(text, rules, changes)), attackers)
        for text in models
    }  # all are checked before the first is played
    _check_memory(list(joint_policies.values()), attackers, games)
    played = [
        _play_games(text, joint_policy, attackers, games=games, seed=seed, advance=advance)
        for text, joint_policy in joint_policies.items()
    ]
    return Results(rules, attackers, games, seed, played)


def _play_games(
    model: str,
    joint_policy: JointPolicy,
    attackers: Mapping[str, Policy],
    *,
    games: int,
    seed: int,
    advance: Advance,
) -> Played:
    """Play and measure the games of one trust model, with the attack and without it."""
    game, twin, rates_raters = joint_policy.game, None, joint_policy.game.model.rates_raters
    attackers = game.roster.with_reserves(attackers)
    curves = track_curves(joint_policy, seed, advance, f"Playing, {model}", games=games)
    if _has_twin(game, attackers):
        label = f"Playing, {model}, all honest"
        twin = track_curves(JointPolicy(game, {}), seed, advance, label, games=games)
    lost = damage(game.roster, curves, twin, attackers, rates_raters) if twin else {}
    metrics = under_attack(game.roster, curves, twin, attackers, rates_raters) if attackers else {}
    since = measured_since(attackers, game.scenario.max_cycles)
    groups = measure(game.roster, curves, attackers, since, rates_raters)
    return Played(model, joint_policy, curves, groups, lost, metrics)


def track_curves(
    joint_policy: JointPolicy,
    seed: int,
    advance: Advance,
    label: str,
    *,
    games: int = 1,
    on_round: Callable[[State], None] = lambda state: None,
) -> Curves:
    """Return the curves of games, and tell the progress. Other arguments as for `record_curves`.

    Args:
        joint_policy: Game and policies of its agents.
        seed: Random seed.
        advance: Called with the label and the share of the rounds that is played.
        label: Name of the work.
        games: Number of games.
        on_round: Called with the state after each round.
    """
    done, rounds = 0, joint_policy.game.scenario.max_cycles

    def follow(state: State) -> None:
        nonlocal done
        on_round(state)
        done += 1
        advance(label, done / rounds)

    return record_curves(joint_policy, seed, games=games, on_round=follow)


def attacks_in_words(attackers: Mapping[str, Policy]) -> str:
    """Return the attacks and the number of agents that play each, such as `bad-mouthing x3,
    on-off`.
    """
    counts = Counter(policy_name(policy) for policy in attackers.values())
    return (
        ", ".join(f"{name} x{n}" if n > 1 else name for name, n in counts.items())
        or "everyone honest"
    )


def foresee(joint_policies: Sequence[JointPolicy], attackers: Mapping[str, Policy]) -> Cost:
    """Return the peak memory in bytes and the time in seconds of each game, over all models.

    The curves of all models stay in memory to the end. In addition there are the curves without the
    attack and, while the last games are recorded, the rows of their curves.
    """
    game, twin = joint_policies[0].game, _has_twin(joint_policies[0].game, attackers)
    trial = try_out(
        lambda games: rollout(joint_policies[0], game.random(0), game.random(0), (games,)),
        trial_size(game),
    )
    memory = _all_curve_bytes(joint_policies, attackers) + trial.memory
    return Cost(memory, trial.seconds * game.scenario.max_cycles * len(joint_policies) * (1 + twin))


def _check_memory(
    joint_policies: Sequence[JointPolicy], attackers: Mapping[str, Policy], games: int
) -> None:
    """Refuse more games or rounds than the memory can hold."""
    rules = joint_policies[0].game.scenario
    if games == 1 or isinstance(rules.frames, int):
        # One game needs memory for its curves only, and a live camera allows no trial.
        each_round = games * _all_curve_bytes(joint_policies, attackers) / rules.max_cycles
        check_memory("max_cycles", rules.max_cycles, each_round)
        return
    each = foresee(joint_policies, attackers)
    check_memory("games", games, each.memory, f" and {in_time(games * each.seconds)}")


def _has_twin(game: Game, attackers: Mapping[str, Policy]) -> bool:
    """Return whether the games are played again with all agents honest. A live camera shows nothing
    twice.
    """
    return bool(attackers) and not isinstance(game.scenario.frames, int)


def _all_curve_bytes(joint_policies: Sequence[JointPolicy], attackers: Mapping[str, Policy]) -> int:
    """Return the peak memory of the curves of each game in bytes, see `foresee`."""
    return curve_bytes(joint_policies[0]) * (
        len(joint_policies) + _has_twin(joint_policies[0].game, attackers) + 1
    )


def _rows(played: Played) -> list[tuple[Any, ...]]:
    """Return a row for each agent, trust and round: the mean over games with the agent present, and
    its interval.
    """
    roster, curves, lines = played.joint_policy.game.roster, played.curves, []
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


def _measured(played: Played) -> dict[str, Any]:
    groups = {
        group.label: {"agents": group.size, "present at the end": _plain(group.present)}
        | {name: _plain(estimate) for name, estimate in group.measures.items()}
        for group in played.groups
    }
    return {
        "groups": groups,
        "damage": {who: _plain(estimate) for who, estimate in played.damage.items()},
        "metrics": {name: _plain(estimate) for name, estimate in played.metrics.items()},
    }


def _verdict(played: Played) -> str:
    """Return what an attack does under a model, in a sentence."""
    *_, harm = played.damage.values()
    under, without = played.metrics["utility"], played.metrics[UTILITY_WITHOUT]
    loss = Estimate(without.mean - under.mean, np.nan)
    costs = (
        f"the attack costs honest agents {_shown(harm)} of trust, and consumers {_shown(loss)} "
        "of utility"
    )
    apart = [
        f"with probability {_shown(auc)} an attacker ends with less trust than an honest "
        f"{name.rpartition(' ')[2]}"
        for name, auc in played.metrics.items()
        if name.startswith(AUC_FINALLY) and not np.isnan(auc.mean)
    ]
    return "; ".join([costs, *apart])


def _shown(estimate: Estimate) -> str:
    if np.isnan(estimate.mean):
        return "undefined" if estimate.why else "nobody present"
    half = math.ceil(estimate.half * 1000) / 1000 if estimate.half == estimate.half else None
    return f"{estimate.mean:.3f}" + ("" if half is None else f"±{half:.3f}")


def _plain(estimate: Estimate) -> dict[str, float | str | None]:
    """Return an estimate for JSON, which has no NaN."""
    mean, half = (None if np.isnan(value) else value for value in (estimate.mean, estimate.half))
    return {"mean": mean, "half_95": half, **({"why": estimate.why} if estimate.why else {})}
