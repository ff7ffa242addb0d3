"""Attacks that do not depend on the number of agents: they play every world of a distribution.

Scripts that all agents of a role play alike are such attacks, and so is a coalition whose network
treats providers alike.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from roletrust_env.evaluation.attackers import (
    Attacker,
    Scripted,
    Stackable,
    read_record,
    recorded_attackers,
    side_by_side,
)
from roletrust_env.evaluation.scripts import Scripts, describe_attack
from roletrust_env.evaluation.specs import check_installed, parse_kinds
from roletrust_env.game.attack_task import AttackTask, TaskState
from roletrust_env.game.policy import Policy
from roletrust_env.game.policy import registry as attackers
from roletrust_env.game.state import Actions
from roletrust_env.randomness import Random

DIGITS = 6
"""Number of decimal digits of a point in a record."""

_MOST = 2
"""Number of scripted attacks that are played together at most: one by services, one by ratings."""


@dataclass(frozen=True)
class AgreedScripts:
    """Scripted attacks that all agents of a role play alike, in a task with any number of agents.

    Attributes:
        attacks: Specs of the attacks, such as `on-off:period=4`. An empty tuple is honest play.
        point: Point in the cube of the parameters that the specs leave open, see `Scripts`; None
            takes their defaults.
    """

    attacks: tuple[str, ...] = ()
    point: tuple[float, ...] | None = None

    def scripts(self, task: AttackTask) -> Scripts:
        """Return the attacks in a task.

        Raises:
            ValueError: No compromised agent can play one of them, see `Scripts.of`.
        """
        return Scripts.of(task, parse_kinds(self.attacks, task.game.scenario), alike=True)

    def policies(self, task: AttackTask) -> dict[str, Policy]:
        """Return the policies of the compromised agents by name. Raises as `scripts`."""
        scripts = self.scripts(task)
        return scripts.default if self.point is None else scripts.decode(self.point)

    def begin(self, task: AttackTask, random: Random, batch: tuple[int, ...]) -> Any:
        """See `roletrust_env.evaluation.attackers.Attacker`."""
        return Scripted(self.policies(task)).begin(task, random, batch)

    def act(
        self, task: AttackTask, state: TaskState, memory: Any, random: Random
    ) -> tuple[Actions, Any]:
        """See `roletrust_env.evaluation.attackers.Attacker`."""
        return Scripted({}).act(task, state, memory, random)

    def stacks_with(self, other: Attacker) -> bool:
        """See `roletrust_env.evaluation.attackers.Stackable`."""
        return isinstance(other, AgreedScripts)

    def stack(self, task: AttackTask, others: Sequence["AgreedScripts"]) -> Scripted:
        """See `roletrust_env.evaluation.attackers.Stackable`."""
        return Scripted(side_by_side([attack.policies(task) for attack in (self, *others)]))

    def describe(self, task: AttackTask) -> str:
        """Return the attack in a few words."""
        return describe_attack(self.policies(task))

    def record(self) -> dict[str, Any]:
        """Return the kind and the fields. See `roletrust_env.evaluation.attackers.Recordable`."""
        point = None if self.point is None else [round(x, DIGITS) for x in self.point]
        return {"kind": "agreed-scripts", "attacks": list(self.attacks), "point": point}


def agreed_scripts(attacks: Sequence[str], point: Sequence[float] | None = None) -> AgreedScripts:
    """Return the scripts of a record.

    Raises:
        ValueError: The fields have other types.
    """
    names = tuple(attacks)
    if len(names) > _MOST or not all(isinstance(name, str) for name in names):
        raise ValueError(f"attacks must be at most {_MOST} specs, got {attacks!r:.100}")
    if point is not None and not all(isinstance(x, int | float) and 0 <= x <= 1 for x in point):
        raise ValueError(f"point must be numbers in [0, 1], got {point!r:.100}")
    return AgreedScripts(names, None if point is None else tuple(map(float, point)))


recorded_attackers.register("agreed-scripts", agreed_scripts)


def check_recorded(records: Iterable[str]) -> None:
    """Refuse records of a file that name scripts which are not installed, or which read files.

    Raises:
        ValueError: A record does so, or is not valid.
    """
    for record in records:
        attacker = read_record(record) if record else None
        if isinstance(attacker, AgreedScripts):
            check_installed(attackers, attacker.attacks)
            for text in attacker.attacks:
                if not isinstance(attackers.factory(text.partition(":")[0]), type):
                    raise ValueError(f"a record may not name {text!r}, which may read files")


def seat(
    task: AttackTask, attacks: Sequence[Attacker], rows: int
) -> Iterator[tuple[list[int], Attacker]]:
    """Yield attackers that play several attacks side by side in a task, with their indices.

    Args:
        task: Task of a world.
        attacks: Attacks.
        rows: Number of attacks that play side by side at most.
    """
    groups: list[list[int]] = []
    for k, attack in enumerate(attacks):
        fitting = (
            group
            for group in groups
            if len(group) < rows
            and isinstance(first := attacks[group[0]], Stackable)
            and first.stacks_with(attack)
        )
        group = next(fitting, None)
        if group is None:
            groups.append([k])
        else:
            group.append(k)
    for group in groups:
        first, *others = [attacks[k] for k in group]
        yield group, first.stack(task, others) if isinstance(first, Stackable) else first


def with_missing_roles(task: AttackTask, attack: str, usual: Mapping[Any, str]) -> tuple[str, ...]:
    """Return a scripted attack, and the usual attack of each compromised role that it leaves out.

    Args:
        task: Task with the compromised agents.
        attack: Spec of the attack.
        usual: Spec of the usual attack by role, `"SP"` and `"SR"`.

    Raises:
        ValueError: No compromised agent can play the attack.
    """
    covered = AgreedScripts((attack,)).scripts(task).roles
    compromised = Scripts.of(task).roles
    roles: Iterable[tuple[str, bool, bool]] = zip(("SP", "SR"), compromised, covered, strict=True)
    return (attack, *(usual[role] for role, plays, done in roles if plays and not done))
