"""The conditions of a game between defences and attackers: who attacks there, and what a trust
model is worth.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.training.defence import Floats
from roletrust_agents.training.universal import universal_coalitions
from roletrust_env.benchmarking.cells import known_batches, scripted_batches
from roletrust_env.benchmarking.known_attacks import KnownAttack
from roletrust_env.evaluation.attackers import Attacker, Scripted, record_of
from roletrust_env.evaluation.measurement import exact_task, measure, measure_honest
from roletrust_env.metrics.consumers import skill
from studies.condition import Condition

_DIGITS = 5

_ANY = "mean"  # trust model of a task that is asked for what does not depend on it


class Skills(NamedTuple):
    """Skill of a trust model under one attack.

    Attributes:
        chosen: Skill in the games that choose, shape (G,).
        measured: Skill in the games that measure, shape (G,).
    """

    chosen: Floats
    measured: Floats


class Front(Condition):
    """A condition of a suite in which defences and attackers meet."""

    @classmethod
    def parse(cls, suite: str, name: str) -> Self:
        """Return a condition by its name.

        Args:
            suite: Name of a suite, or path of its TOML file.
            name: `SCENARIO/TRACK/SHARE`.

        Raises:
            ValueError: The name has another form, or see `Condition.of`.
        """
        try:
            scenario, track, share = name.split("/")
            return cls.of(suite, scenario, track, float(share))
        except ValueError as error:
            raise ValueError(f"{name} is no front such as crowd/raters/0.3: {error}") from None

    def known(self, name: str, attacker: Attacker) -> KnownAttack:
        """Return an attacker as data.

        Raises:
            ValueError: The attacker cannot be recorded.
        """
        record = record_of(attacker)
        if not record:
            raise ValueError(
                f"the attack {name!r} cannot be recorded; choose attacks of installed packages"
            )
        return KnownAttack(
            name=name, scenario=self.scenario, track=self.track, share=self.share, record=record
        )

    def beginners(self, models: Sequence[str], seed: int, games: int) -> list[KnownAttack]:
        """Return the attackers of the beginning: the worst script and the worst universal coalition
        of each model.

        Args:
            models: Specs of trust models.
            seed: Random seed.
            games: Number of games for each attack and model.
        """
        ready = [
            self.known(name, CoalitionAttacker(network))
            for name, network in universal_coalitions(wide=False).items()
        ]
        scripts, beginners = self._scripts(), dict[str, KnownAttack]()
        for model in models:
            task, worth = exact_task(self.arguments(model)), dict[str, float]()
            for batch in scripted_batches(task, self.kinds(model), games):
                seen = measure(task, batch.attacker, seed, (len(batch.names), games)).chosen
                for k, name in enumerate(batch.names):
                    worth[name] = float(self._skill(seen["utility"][k], seen["blind"][k]).mean())
            beginners |= {
                attack.name: attack
                for attack in [min(scripts, key=lambda attack: worth[attack.name])]
            }
            coalitions = self.skills(model, ready, seed, games)
            beginners |= {
                attack.name: attack
                for attack in [min(ready, key=lambda attack: coalitions[attack.name].chosen.mean())]
            }
        return list(beginners.values())

    def strangers(self, met: Sequence[KnownAttack]) -> list[KnownAttack]:
        """Return attackers that no training has met: those that the suite knows in this condition.

        A suite that knows none there gives its scripts at their defaults, as far as no training has
        met them.

        Args:
            met: Attackers that a training has met; scripts of these names are left out.
        """
        known = self.suite.known_in((self.scenario, self.track, self.share))
        # Those of the evolution strategy are no strangers: some were found against `first-hand` and
        # `leave-one-out`.
        if known := [
            attack for attack in known if not attack.name.startswith("evolution strategy against ")
        ]:
            return known
        names = {attack.name for attack in met}
        return [script for script in self._scripts() if script.name not in names]

    def skills(
        self, model: str, attacks: Sequence[KnownAttack], seed: int, games: int
    ) -> dict[str, Skills]:
        """Return the skill of a trust model under each attack.

        Args:
            model: Spec of the trust model.
            attacks: Attacks.
            seed: Random seed; the same one gives all attacks and models the same games.
            games: Number of games that choose, and of others that measure.
        """
        task, skills = exact_task(self.arguments(model)), {}
        for batch in known_batches(task, attacks, 2 * games):
            seen = measure(task, batch.attacker, seed, (len(batch.names), games))
            for k, name in enumerate(batch.names):
                halves = (seen.chosen, seen.measured)
                skills[name] = Skills(
                    *(self._skill(half["utility"][k], half["blind"][k]) for half in halves)
                )
        return skills

    def worst(self, model: str, attacks: Sequence[KnownAttack], seed: int, games: int) -> Floats:
        """Return the skill under the attack that is the worst one in the games that choose, shape
        (G,).
        """
        met = self.skills(model, attacks, seed, games).values()
        return min(met, key=lambda skills: float(np.mean(skills.chosen))).measured

    def clean(self, model: str, seed: int, games: int) -> Floats:
        """Return the skill where nobody attacks, shape (G,). Arguments as for `skills`."""
        seen = measure_honest(exact_task(self.arguments(model)), seed, games).measured
        return self._skill(seen["utility"][0], seen["blind"][0])

    def _scripts(self) -> list[KnownAttack]:
        """Return the scripted attacks of the suite at their defaults."""
        task = exact_task(self.arguments(_ANY))
        batches = scripted_batches(task, self.kinds(_ANY), 1)
        return [
            self.known(name, Scripted(batch.scripts(k)))
            for batch in batches
            for k, name in enumerate(batch.names)
        ]

    def _skill(self, utility: Floats, blind: Floats) -> Floats:
        skills = np.round(skill(utility, blind), _DIGITS)
        if not np.isfinite(skills).all():
            raise ValueError(
                f"the skill is undefined in {self}: in some game no choice is better than a blind "
                "one"
            )
        return skills
