"""The scripted attacks of a task as points to search through: defaults, a grid, and a cube of all their parameters."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from roletrust_env.arrays import Array
from roletrust_env.evaluation.attack_space import HONEST, Kind, Mixture, Space, words
from roletrust_env.evaluation.composite import Both
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.policy import Channel, Policy
from roletrust_env.game.policy_registry import registry as attackers

_PAPER_ATTACKS = ("on-off", "bad-mouthing")

_SERVING: frozenset[Channel] = frozenset({"quality", "treatment"})
_RATING: frozenset[Channel] = frozenset({"ratings", "silence"})


def paper_attacks() -> tuple[Kind, ...]:
    """Return the paper's attacks: a provider attacks on and off, a rater by bad-mouthing, an SR+SP agent by both."""
    return tuple(attackers.factory(name) for name in _PAPER_ATTACKS)


@dataclass(frozen=True)
class Scripts:
    """The scripted attacks that a task's compromised agents can play.

    Who has no attack for its role plays honestly; one with both roles serves by one attack and rates by another.

    Attributes:
        agents: the compromised agents; for each whether it attacks by its services, and whether by its ratings.
        serving: the attacks on the quality of services.
        rating: the attacks by ratings.
    """

    agents: tuple[tuple[str, bool, bool], ...]
    serving: Mixture
    rating: Mixture

    @classmethod
    def of(cls, task: AttackTask, attacks: Sequence[Kind] | None = None) -> "Scripts":
        """The scripts of a task: the honest providers are victims, the compromised ones are accomplices.

        Args:
            task: whose compromised agents play.
            attacks: the kinds of attack; several for one role are a mixture. None are the usual ones that fit.

        Raises:
            ValueError: no compromised agent can play one of the kinds, one of them has not the identities in reserve
                that a kind needs, or a kind cannot be searched, see `Space`.
        """
        roster, bad = task.game.roster, {*task.identities, *task.joint_policy.attackers}
        providers = list(enumerate(roster.provider_names))
        victims = tuple(place for place, name in providers if name not in bad)
        accomplices = tuple(place for place, name in providers if name in task.identities)
        owners = list(roster.owners.values())
        reserve = min(owners.count(name) - 1 for name in task.compromised)
        facts = victims, accomplices, task.game.scenario.max_cycles, reserve
        spaces = [Space(kind, *facts) for kind in (paper_attacks() if attacks is None else attacks)]
        roles = ((_SERVING, roster.provider_names), (_RATING, roster.rater_names))
        decided = {channel for by, names in roles if not set(names).isdisjoint(task.compromised) for channel in by}
        for space in spaces if attacks is not None else ():
            if space.default.reserve > reserve:
                raise ValueError(
                    f"{words(space.default)} needs a reserve of {space.default.reserve}, and of "
                    f"{', '.join(task.compromised)} one has {reserve}; a group's reserve gives it identities"
                )
            if not space.channels & decided:
                by, who = " and ".join(sorted(space.channels)) or "nothing", ", ".join(task.compromised)
                raise ValueError(
                    f"{words(space.default)} attacks by {by}, on which no compromised agent decides: {who}"
                )
        serving, rating = ([space for space in spaces if space.channels & by] for by, _ in roles)
        agents = tuple(
            (name, bool(serving) and name in roster.provider_names, bool(rating) and name in roster.rater_names)
            for name in task.compromised
        )
        return cls(agents, Mixture(serving), Mixture(rating))

    @property
    def size(self) -> int:
        """Number of parameters: each agent has its own."""
        return sum(self.serving.size * serves + self.rating.size * rates for _, serves, rates in self.agents)

    @property
    def default(self) -> dict[str, Policy]:
        """The first attack of each role with its default parameters."""
        return self._all(self.serving.default, self.rating.default)

    @property
    def grid(self) -> list[dict[str, Policy]]:
        """A few parameters of each attack, all in combination, the same for all agents of a role.

        Where both roles attack, one of them may also play honestly.
        """
        serves, rates = any(agent[1] for agent in self.agents), any(agent[2] for agent in self.agents)
        serving, rating = self.serving.grid if serves else [HONEST], self.rating.grid if rates else [HONEST]
        if serves and rates:
            serving, rating = [*serving, HONEST], [*rating, HONEST]
        return [self._all(*pair) for pair in itertools.product(serving, rating)]

    def decode(self, point: Sequence[float] | Array) -> dict[str, Policy]:
        """The attack at a point of the cube [0, 1] ** size."""
        policies, at = {}, 0
        for name, *channels in self.agents:
            roles = []
            for mixture, attacks in zip((self.serving, self.rating), channels, strict=True):
                if attacks:
                    roles.append(mixture.decode(point[at : at + mixture.size]))
                    at += mixture.size
            policies[name] = Both(*roles) if len(roles) == 2 else roles[0] if roles else HONEST
        return policies

    def _all(self, serving: Policy, rating: Policy) -> dict[str, Policy]:
        both = Both(serving, rating)
        return {
            name: both if serves and rates else serving if serves else rating if rates else HONEST
            for name, serves, rates in self.agents
        }


def describe(attack: Mapping[str, Policy]) -> str:
    """An attack in a few words, agents that do the same together."""
    agents: dict[str, list[str]] = {}
    for name, policy in attack.items():
        roles = (policy.serves, policy.rates) if isinstance(policy, Both) else (policy,)
        agents.setdefault(" and ".join(map(words, roles)), []).append(name)
    return "; ".join(f"{', '.join(names)}: {said}" for said, names in agents.items())
