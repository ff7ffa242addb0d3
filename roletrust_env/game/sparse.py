"""The game of a city: each rater meets few of many providers, and only pairs that meet take time
and memory.
"""

from typing import Annotated, Any, cast

import numpy as np

from roletrust_env.arrays import Array
from roletrust_env.game.cells import Cells, MetCells
from roletrust_env.game.consumer import Bought, buy
from roletrust_env.game.game import Game
from roletrust_env.game.policy import Policy, policy_name
from roletrust_env.game.state import Actions, Noise, State
from roletrust_env.game.views import ProviderView, RaterView, SparseRaterView
from roletrust_env.shapes import PerAgent, Shape
from roletrust_env.trees import leaves
from roletrust_env.trust import TrustModel
from roletrust_env.world.scenario import Encounters, Scenario


class SparseGame(Game):
    """The rules of `Game` for a scenario with encounters, on the pairs that meet: one game on
    NumPy, in float64.

    It is `Game` on other cells: where an array of `Game` has shape (S, P), that of this game has
    shape (S, K), with K the `providers` that a rater meets in a round, and `State.met` has the
    index of the provider of each cell. With the same noise for each pair, trust, quality and
    rewards are those of `Game`. A round takes time and memory in proportion to S K + P. A model
    with a memory of pairs keeps every pair that ever met.

    What differs:

    - The trust model runs on edges, see `roletrust_env.trust.edges.runs_on_edges`.
    - The trust of a game goes on in place, so `step` takes the newest state only; an older one can
      still be read.
    - A rater sees the providers that it met, see `SparseRaterView`; its last `ratings` are in the
      cells of the round before. A provider does not see single ratings.
    - Ratings are of services of the last round, and arrive at once or are lost. Providers serve
      all raters alike.

    Args:
        scenario: Scenario with access of kind `encounters`.
        trust_model: Name of a trust model, or a trust model, see `Game`.

    Raises:
        ValueError: The scenario has another access, late ratings, open reports, a deadline above
            1, or cameras; the model does not run on edges.

    Example:
        >>> from roletrust_env import JointPolicy, Scenario, SparseGame
        >>> from roletrust_env.game.rollout import rollout
        >>> agents = [{"role": "SR", "count": 4000}, {"role": "SP", "count": 1000, "ability": [0.3, 1.0]}]
        >>> access = {"kind": "encounters", "providers": 5}
        >>> game = SparseGame(Scenario(agents=agents, access=access, max_cycles=20), "mean")
        >>> random = game.random(seed=0)
        >>> rounds = list(rollout(JointPolicy(game, {}), random, random))
        >>> rounds[-1].state.service.shape
        (4000, 5)
        >>> bought = game.bought(*rounds[-1][:3])
        >>> bool(bought.got > 0.95 * bought.best)
        True
    """  # noqa: E501

    def __init__(
        self, scenario: Scenario, trust_model: str | TrustModel[Any] = "role-trust"
    ) -> None:
        if isinstance(scenario, Scenario):
            _check(scenario)
        super().__init__(scenario, trust_model)

    def _make_cells(self) -> Cells:
        """Return the pairs that meet."""
        assert isinstance(self.scenario.access, Encounters)
        return MetCells(self.scenario.access, self.roster, self.model)

    def check_policy(self, policy: Policy, memory: Any) -> None:
        """Refuse a policy that remembers each provider, or that treats raters differently. See
        `Game.check_policy`.

        Raises:
            ValueError: The policy is one of these.
        """
        if "treatment" in policy.attacks:
            raise ValueError(
                f"{policy_name(policy)} treats raters differently; in a sparse game providers "
                "serve all alike"
            )
        if any(leaf is not None for leaf in leaves(memory)):
            raise ValueError(
                f"{policy_name(policy)} remembers what it saw of each provider; in a sparse game a "
                "rater meets others "
                "in each round, so only policies without such a memory can rate"
            )

    def start(self, noise: Noise) -> State:
        """Return the state before the first round. See `Game.start`.

        Raises:
            ValueError: The noise is for another shape, such as that of a batch.
        """
        shape = self.roster.n_raters, self._cells.width
        if noise.perception.shape != shape:
            raise ValueError(
                f"the noise has shape {noise.perception.shape}; a sparse game has no batch, and "
                f"needs {shape}"
            )
        return super().start(noise)

    def step(self, state: State, actions: Actions, noise: Noise) -> tuple[State, PerAgent]:
        """Play one round from the newest state. See `Game.step`.

        Raises:
            ValueError: A later round has been played, the shapes of the actions are not those of
                the state, or a provider treats raters differently.
        """
        if actions.treatment is not None:
            raise ValueError(
                "a provider treats raters differently; in a sparse game it serves all alike"
            )
        for name in ("quality", "ratings"):
            if not np.isfinite(np.asarray(getattr(actions, name))).all():
                raise ValueError(
                    f"{name} of the actions are not all numbers; the trust of a city goes on in "
                    "place"
                )
        return super().step(state, actions, noise)

    def known_trust(self, state: State) -> Annotated[Array, Shape("S K")]:
        """Return the trust of the provider of each cell, shape (S, K)."""
        return self._cells.of_providers(self.published(state)[1], state.met)

    def views(self, state: State) -> tuple[ProviderView, RaterView]:
        """Return the views of all providers, fields of shape (P,), and of all raters, (S,) and (K,
        S). See `Game`.
        """
        tor, top = self.published(state)
        clock = np.asarray(self._clock(state))
        none = np.zeros((0, len(top)))
        provider = ProviderView(
            np.broadcast_to(clock, top.shape),
            top,
            state.value,
            state.quality,
            none,
            none.astype(bool),
        )
        met: Array = state.met
        cells = (
            self.known_trust(state),
            state.service,
            state.awaiting,
            state.ratings,
            state.rated,
            met,
        )
        rater = SparseRaterView(np.broadcast_to(clock, tor.shape), tor, *(cell.T for cell in cells))
        return provider, cast(RaterView, rater)  # policies read it as one

    def observations(self, state: State) -> tuple[Array, Array, Array | None]:
        """Refuse: an observation has an entry for every provider, or every rater.

        Raises:
            ValueError: Always.
        """
        raise ValueError("a sparse game has no observation vectors; policies play it by `views`")

    def bought(self, before: State, actions: Actions, after: State) -> Bought:
        """Return the qualities that consumers got in a round by the trust before it, means over the
        raters.

        Each rater is a consumer that goes to the most trusted of the providers that serve it in the
        round. A rater that nobody serves counts as 0 in all three.
        """
        cells, top = self._cells, self.published(before)[1]
        offered = cells.of_providers(self.offered(before, actions, after), after.met)
        offered = np.where(after.awaiting, offered, np.nan)
        of_each = buy(cells.of_providers(top, after.met), offered, axis=1)
        return Bought(*(part.mean() for part in of_each))


def _check(scenario: Scenario) -> None:
    """Refuse what a sparse game does not play."""
    if not isinstance(scenario.access, Encounters):
        raise ValueError(
            f"access is of kind {scenario.access.kind!r}; a sparse game needs 'encounters', in "
            "which a rater meets few "
            "providers"
        )
    if scenario.ratings.late > 0:
        raise ValueError(f"ratings.late is {scenario.ratings.late}; it must be 0 in a sparse game")
    if scenario.ratings.open is not None or scenario.ratings.deadline > 1:
        raise ValueError(
            f"ratings.open is {scenario.ratings.open} and ratings.deadline is "
            f"{scenario.ratings.deadline}; they must be None and 1 in a sparse game"
        )
    if scenario.service != "synthetic":
        raise ValueError(
            f"service is {scenario.service!r}; it must be 'synthetic' in a sparse game"
        )
