"""Scripted attacks of a task as a search space: defaults, a grid, and a cube of all parameters."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from roletrust_env.arrays import Array
from roletrust_env.evaluation.attack_space import HONEST, AttackKind, Mixture, Space, as_spec
from roletrust_env.evaluation.composite import Both
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.policy import Channel, Policy
from roletrust_env.game.policy_registry import registry as attackers

_PAPER_ATTACKS = ("on-off", "bad-mouthing")

SERVING_CHANNELS: frozenset[Channel] = frozenset({"quality", "treatment"})
RATING_CHANNELS: frozenset[Channel] = frozenset({"ratings", "silence"})


def paper_attacks() -> tuple[AttackKind, ...]:
    """Return the paper's attacks: a provider attacks on and off, a rater by bad-mouthing, an SR+SP agent by both."""
    return tuple(attackers.factory(name) for name in _PAPER_ATTACKS)


@dataclass(frozen=True)
class Scripts:
    """The scripted attacks that the compromised agents of a task can play.

    An agent without an attack for its role plays honestly. An SR+SP agent serves by one attack and rates by another.

    Attributes:
        agents: Compromised agents: the name, whether it attacks by its services, and whether by its ratings.
        serving: Attacks by services.
        rating: Attacks by ratings.
        alike: Whether all agents of a role play the same attack.
    """

    agents: tuple[tuple[str, bool, bool], ...]
    serving: Mixture
    rating: Mixture
    alike: bool = False

    @classmethod
    def of(cls, task: AttackTask, attacks: Sequence[AttackKind] | None = None, alike: bool = False) -> "Scripts":
        """Return the scripts of a task: honest providers are the victims, compromised ones the accomplices.

        Args:
            task: Task with the compromised agents.
            attacks: Kinds of attack; several for one role are a mixture. None are the attacks of the paper that fit.
            alike: Whether all agents of a role play the same attack.

        Raises:
            ValueError: No compromised agent can play a kind, a compromised agent has fewer identities in reserve than a
                kind needs, or a kind cannot be searched, see `Space`.
        """
        roster, bad = task.game.roster, {*task.identities, *task.joint_policy.attackers}
        providers = list(enumerate(roster.provider_names))
        victims = tuple(place for place, name in providers if name not in bad)
        accomplices = tuple(place for place, name in providers if name in task.identities)
        owners = list(roster.owners.values())
        reserve = min(owners.count(name) - 1 for name in task.compromised)
        facts = victims, accomplices, task.game.scenario.max_cycles, reserve
        spaces = [Space(kind, *facts) for kind in (paper_attacks() if attacks is None else attacks)]
        roles = ((SERVING_CHANNELS, roster.provider_names), (RATING_CHANNELS, roster.rater_names))
        decided = {channel for by, names in roles if not set(names).isdisjoint(task.compromised) for channel in by}
        for space in spaces if attacks is not None else ():
            if space.default.reserve > reserve:
                raise ValueError(
                    f"{as_spec(space.default)} needs a reserve of {space.default.reserve}, and of "
                    f"{', '.join(task.compromised)} one has {reserve}; a group's reserve gives it identities"
                )
            if not space.channels & decided:
                by, who = " and ".join(sorted(space.channels)) or "nothing", ", ".join(task.compromised)
                raise ValueError(
                    f"{as_spec(space.default)} attacks by {by}, on which no compromised agent decides: {who}"
                )
        serving, rating = ([space for space in spaces if space.channels & by] for by, _ in roles)
        agents = tuple(
            (name, bool(serving) and name in roster.provider_names, bool(rating) and name in roster.rater_names)
            for name in task.compromised
        )
        return cls(agents, Mixture(serving), Mixture(rating), alike)

    @property
    def size(self) -> int:
        """Number of parameters; each agent has its own, unless all play alike."""
        if self.alike:
            return self.serving.size + self.rating.size
        return sum(self.serving.size * serves + self.rating.size * rates for _, serves, rates in self.agents)

    @property
    def roles(self) -> tuple[bool, bool]:
        """Whether any agent attacks by its services, and whether any by its ratings."""
        return any(serves for _, serves, _ in self.agents), any(rates for _, _, rates in self.agents)

    @property
    def default(self) -> dict[str, Policy]:
        """First attack of each role with its default parameters."""
        return self._all(self.serving.default, self.rating.default)

    @property
    def grid(self) -> list[dict[str, Policy]]:
        """All combinations of a few parameters of each attack, the same for all agents of a role.

        Where both roles attack, the grid also has attacks in which one of them plays honestly.
        """
        serves, rates = self.roles
        serving, rating = self.serving.grid if serves else [HONEST], self.rating.grid if rates else [HONEST]
        if serves and rates:
            serving, rating = [*serving, HONEST], [*rating, HONEST]
        return [self._all(*pair) for pair in itertools.product(serving, rating)]

    def decode(self, point: Sequence[float] | Array) -> dict[str, Policy]:
        """Return the attack at a point of the cube [0, 1] ** size."""
        if self.alike:
            return self._all(self.serving.decode(point), self.rating.decode(point[self.serving.size :]))
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


def with_paper(task: AttackTask, kind: AttackKind) -> tuple[AttackKind, ...]:
    """Return a kind of attack, and the attack of the paper for a compromised role that it leaves out.

    Args:
        task: Task with the compromised agents.
        kind: Kind of attack that one of them can play.
    """
    roles = zip(paper_attacks(), Scripts.of(task).roles, Scripts.of(task, [kind]).roles, strict=True)
    return (kind, *(paper for paper, compromised, covered in roles if compromised and not covered))


def describe(attack: Mapping[str, Policy]) -> str:
    """Return an attack in a few words. Agents with the same policy stand together."""
    agents: dict[str, list[str]] = {}
    for name, policy in attack.items():
        roles = (policy.serves, policy.rates) if isinstance(policy, Both) else (policy,)
        agents.setdefault(" and ".join(map(as_spec, roles)), []).append(name)
    return "; ".join(f"{', '.join(names)}: {text}" for text, names in agents.items())
