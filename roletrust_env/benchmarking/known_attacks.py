"""Known attacks: attackers that somebody found, and that play again without a search."""

from collections.abc import Iterable
from itertools import chain, count
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import FailFast, Field, model_validator

from roletrust_env.benchmarking.schema import Label, Name
from roletrust_env.evaluation.attackers import MAX_RECORD, read_record
from roletrust_env.storage.untrusted import UntrustedModel, read_untrusted

MAX_BYTES = 64_000_000
"""Maximum size of a file of known attacks."""


class KnownAttack(UntrustedModel):
    """Attacker of a condition of a suite."""

    name: Name
    """Name in tables, which says how it was found and against which trust model."""
    scenario: Label
    """Name of the scenario in the suite."""
    track: Label
    """Name of the track in the suite."""
    share: Annotated[float, Field(gt=0, lt=1)]
    """Share of compromised agents."""
    finder: Annotated[str, Field(max_length=300, pattern=r"^[^\x00-\x1f\x7f]*$")] = ""
    """Who found the attack. Empty for the project."""
    record: Annotated[str, Field(min_length=1, max_length=MAX_RECORD)]
    """Record of the attacker, see `roletrust_env.evaluation.attackers`."""

    @property
    def words(self) -> str:
        """Short description."""
        return f"known attack, found by {self.finder}" if self.finder else "known attack"

    @property
    def condition(self) -> tuple[str, str, float]:
        """Scenario, track and share."""
        return self.scenario, self.track, self.share


class KnownAttacks(UntrustedModel):
    """Content of a file of known attacks."""

    format: Literal["roletrust-attacks"] = "roletrust-attacks"
    format_version: Literal[1] = 1
    attacks: Annotated[tuple[KnownAttack, ...], Field(min_length=1), FailFast()]

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_names(self.attacks)
        return self


def check_names(attacks: Iterable[KnownAttack]) -> None:
    """Check that no two attacks of a condition have the same name.

    Raises:
        ValueError: Two have the same name.
    """
    seen = set()
    for attack in attacks:
        key = attack.name, attack.condition
        if key in seen:
            raise ValueError(
                f"there are two known attacks {attack.name!r} in {attack.scenario}, {attack.track} "
                f"{attack.share:.0%}"
            )
        seen.add(key)


def merge_attacks(*lists: Iterable[KnownAttack]) -> tuple[KnownAttack, ...]:
    """Return the attacks of several lists as one list.

    An attack is listed once in a condition, under the name of the first list that has it. An attack
    with the name of another one of its condition gets a number: searches of different people find
    attacks of the same name.

    Args:
        *lists: Lists of known attacks.
    """
    by_record: dict[tuple[str, tuple[str, str, float]], KnownAttack] = {}  # and condition
    taken: set[tuple[str, tuple[str, str, float]]] = set()
    for attack in chain(*lists):
        if (attack.record, attack.condition) in by_record:
            continue
        names = (attack.name if k == 1 else f"{attack.name} ({k})" for k in count(1))
        name = next(name for name in names if (name, attack.condition) not in taken)
        taken.add((name, attack.condition))
        by_record[attack.record, attack.condition] = attack.model_copy(update={"name": name})
    return tuple(by_record.values())


def check_records(attacks: Iterable[KnownAttack]) -> None:
    """Check that the attackers of known attacks can be made.

    Raises:
        ValueError: A record is not valid, or names what is not installed.
    """
    for attack in attacks:
        try:
            read_record(attack.record)
        except ValueError as error:
            raise ValueError(f"known attack {attack.name!r}: {error}") from None


def read_known_attacks(path: Path) -> tuple[KnownAttack, ...]:
    """Read a file of known attacks. This executes no code, and makes no attacker.

    Raises:
        ValueError: The file does not exist, or its content is not allowed.
        OSError: The file cannot be read.
    """
    command = "roletrust submit --attacks"
    return read_untrusted(
        KnownAttacks, path, MAX_BYTES, what="known attacks", command=command
    ).attacks
