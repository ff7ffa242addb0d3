"""One trust model under one attack in one scenario, in numbers."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import exact_task, score
from roletrust_env.evaluation.scripts import RATING_CHANNELS, SERVING_CHANNELS
from roletrust_env.evaluation.specs import named_factory, parse_attacks, parse_trust_model
from roletrust_env.game.policy import Channel, Policy
from roletrust_env.game.policy import registry as attackers
from roletrust_env.metrics import share_of_best
from roletrust_env.metrics.confidence import Estimate, estimate
from roletrust_env.parameters import whole_number
from roletrust_env.trust import TrustModel
from roletrust_env.world import Scenario, make_scenario
from roletrust_env.world.roster import Roster


class Evaluation(NamedTuple):
    """The scores of a trust model under an attack. Each is the mean over the games and half its 95%
    interval.

    Attributes:
        utility: Utility of a consumer that always goes to the most trusted provider, over the best
            there is, in [0, 1].
        clean: The same in the same games with everybody honest.
        blind: The same for a consumer that goes to any provider.
        damage: Loss of trust of the honest agents against the games with everybody honest.
        false_alarms: Share of honest agents with trust below 0.5.
        auc: Probability that an honest agent has more trust than an attacker of its role.
    """

    utility: Estimate
    clean: Estimate
    blind: Estimate
    damage: Estimate
    false_alarms: Estimate
    auc: Estimate

    def __repr__(self) -> str:
        """Return a line for each score."""
        numbers = {
            name: f"{value.mean:.3f} ± {value.half:.3f}"
            for name, value in zip(self._fields, self, strict=True)
        }
        lines = [
            f"  {name}: {text.replace('nan ± nan', 'undefined')}" for name, text in numbers.items()
        ]
        return "\n".join(["Evaluation", *lines])


def evaluate(
    model: str | TrustModel[Any],
    attack: str | Sequence[str] | Mapping[str, str | Policy],
    scenario: str | Path | Scenario = "paper-3x3",
    *,
    games: int = 20,
    seed: int = 0,
    share: float = 1 / 3,
) -> Evaluation:
    """Measure a trust model under a scripted attack.

    Args:
        model: Trust model, or its spec such as `"role-trust:lam=0.7"`.
        attack: Spec of an attack such as `"bad-mouthing:level=0"`, which the last agents of its
            role play; or one or more specs with agents, such as `"sr_2=bad-mouthing"`; or policies
            or specs by the name of the agent.
        scenario: Scenario, its name, or the path of its file.
        games: Number of games.
        seed: Random seed. All models and attacks meet the same noise with the same seed.
        share: Share of the agents of a role that play an attack without agents, rounded, at least
            one.

    Returns:
        The scores, each with its 95% interval over the games.

    Raises:
        ValueError: A name is unknown, a value is not allowed, or an agent cannot play the attack.

    Example:
        >>> evaluate("mean", "sr_2=bad-mouthing:level=0", "paper-3x3", games=2).damage.mean > 0.1
        True
    """
    games, seed = whole_number("games", games, 1), whole_number("seed", seed)
    if not isinstance(share, float | int) or not 0 < share < 1:
        raise ValueError(f"share is {share!r}; it must lie between 0 and 1")
    rules = make_scenario(scenario)
    policies = _seated(attack, rules, share)
    task = exact_task(
        {
            "scenario": rules,
            "trust_model": parse_trust_model(model, rules) if isinstance(model, str) else model,
            "compromised": tuple(policies),
            "objective": "mislead",
        }
    )
    scored = score(task, Scripted(policies), seed, (1, games))
    clean = share_of_best(scored.clean.got, scored.clean.best).value
    scores = {**scored.scores, "clean": clean}
    return Evaluation(*(estimate(scores[name][0]) for name in Evaluation._fields))


def _seated(
    attack: str | Sequence[str] | Mapping[str, str | Policy], scenario: Scenario, share: float
) -> dict[str, Policy]:
    """Return the policies by the name of the agent."""
    if isinstance(attack, Mapping):
        for name, given in attack.items():
            if not isinstance(given, str | Policy):
                raise ValueError(
                    f"attack of {name!r} is {given!r}; it must be a Policy, or the spec of an "
                    "attack"
                )
        made = {name: policy for name, policy in attack.items() if isinstance(policy, Policy)}
        parsed = parse_attacks(
            [f"{name}={spec}" for name, spec in attack.items() if isinstance(spec, str)], scenario
        )
        if twice := sorted(made.keys() & parsed.keys()):
            raise ValueError(
                f"attack gives agent {twice[0]!r} two attacks; an agent has one policy"
            )
        return {**parsed, **made}
    texts = [attack] if isinstance(attack, str) else attack
    if not isinstance(texts, Sequence) or not all(isinstance(text, str) for text in texts):
        raise ValueError(
            f"attack is {attack!r}; name the agents of a policy, such as {{'sr_2': BadMouthing()}}"
        )
    seated = [line for text in texts for line in _lines(text, scenario, share)]
    return parse_attacks(list(dict.fromkeys(seated)), scenario)


def _lines(text: str, scenario: Scenario, share: float) -> list[str]:
    """Return a spec without agents as specs with agents: the last ones of each role that the attack
    is for.
    """
    name, equals, _ = text.partition("=")
    if equals and ":" not in name:  # it begins with an agent, as in `sr_2=bad-mouthing:level=0`
        return [text]
    channels: frozenset[Channel] = getattr(named_factory(attackers, text), "attacks", frozenset())
    roster, lines = Roster.of(scenario), []
    for names, decided in (
        (roster.rater_names, RATING_CHANNELS),
        (roster.provider_names, SERVING_CHANNELS),
    ):
        first = [agent for agent in names if agent in roster.owner_names]
        if channels & decided:
            lines += [f"{agent}={text}" for agent in first[-max(1, round(share * len(first))) :]]
    if not lines:
        raise ValueError(
            f"attack {text!r} says of no role that it is for it; name its agents, such as "
            f"sr_2={text}"
        )
    return list(dict.fromkeys(lines))
