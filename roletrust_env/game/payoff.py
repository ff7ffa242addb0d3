"""The reward of an agent: the trust of its role, less the cost of its service."""

import numpy as np

from roletrust_env.arrays import Array, cast, namespace, whole_dtype
from roletrust_env.game.state import Counts
from roletrust_env.trust import agent_trust
from roletrust_env.world.roster import Roster
from roletrust_env.world.scenario import Scenario


class Payoff:
    """The values of services, and the rewards of agents.

    Args:
        scenario: Scenario with the values and the weights.
        roster: Agents of the scenario.
        like: Array of the library, dtype and device to work with.
    """

    def __init__(self, scenario: Scenario, roster: Roster, like: Array) -> None:
        self._weights, self._initial, self._roster = (
            scenario.rewards,
            scenario.initial_trust,
            roster,
        )
        self._values = None
        if len(set(scenario.values)) > 1:
            shares = np.asarray(scenario.values) / max(scenario.values)
            self._values = namespace(like).asarray(shares, dtype=like.dtype, device=like.device)
        self._cost = scenario.rewards.quality_cost * max(scenario.values)

    def next_value(self, value: Array, noise: Array | None) -> Array:
        """Return the value of the next service of each provider, shape (P, ...), relative to the
        highest value.
        """
        if self._values is None or noise is None:
            return value
        return self._values[cast(noise * len(self._values), whole_dtype(noise))]

    def rewards(
        self, tor: Array, top: Array, counts: Counts | None, quality: Array, value: Array
    ) -> Array:
        """Return the rewards, shape (N, ...).

        Args:
            tor: Trust of the raters, shape (S, ...).
            top: Trust of the providers, shape (P, ...).
            counts: Services that SR+SP agents rated and provided; None without such agents.
            quality: Delivered quality, shape (P, ...).
            value: Value of the services, shape (P, ...).
        """
        costs = self._cost * quality if self._values is None else self._cost * value * quality
        weights, roster = self._weights, self._roster
        of_both = None
        if counts is not None:
            of_both = weights.agent_trust * self._both_trust(tor, top, counts) - roster.both(costs)
        of_raters = tor if weights.rater_trust == 1 else weights.rater_trust * tor
        of_providers = top if weights.provider_trust == 1 else weights.provider_trust * top
        return roster.agents(of_raters, of_providers - costs, of_both)

    def agent_trust(self, tor: Array, top: Array, counts: Counts | None) -> Array:
        """Return the trust of every agent by its role, shape (N, ...)."""
        toa = None if counts is None else self._both_trust(tor, top, counts)
        return self._roster.agents(tor, top, toa)

    def _both_trust(self, tor: Array, top: Array, counts: Counts) -> Array:
        both = self._roster.both
        return agent_trust(
            both(tor),
            both(top),
            rated=counts.rated,
            provided=counts.provided,
            initial=self._initial,
        )
