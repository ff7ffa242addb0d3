"""The joint policy: policies seated at the agents of a game, in one game or a batch."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from roletrust_env.arrays import Array, namespace, within
from roletrust_env.frozen import Frozen
from roletrust_env.game.brief import game_facts, players
from roletrust_env.game.game import Game
from roletrust_env.game.policy import Channel, Policy, policy_name
from roletrust_env.game.state import Actions, State
from roletrust_env.game.views import AgentView, IdentityView, ProviderView, RaterView, ViewLayout
from roletrust_env.parameters import check_instance
from roletrust_env.randomness import Random, generator
from roletrust_env.world.group import Role
from roletrust_env.world.presence import PRESENT
from roletrust_env.world.roster import role_in_name, shown

Memory = TypeVar("Memory")
Places = (
    Any  # indices of agents: a slice or an array on NumPy, which are quicker, and a list on torch
)

_CHANNELS: dict[Role, frozenset[Channel]] = {
    "SR": frozenset({"ratings"}),
    "SP": frozenset({"quality"}),
    "SR+SP": frozenset({"quality", "ratings"}),
}
"""Channels of an action in PettingZoo, by role."""

_NONE: frozenset[Channel] = frozenset()
_TREATMENT: frozenset[Channel] = frozenset({"treatment"})
_REPORTS: frozenset[Channel] = frozenset({"silence", "claims"})
_PRESENCE: frozenset[Channel] = frozenset({"presence"})


class Player:
    """A policy seated at one agent of a PettingZoo game: a function from its observation to its
    action.

    It holds the memory of its policy, so make a new one for each episode.

    Args:
        policy: Behaviour of the agent.
        agent: Name of the agent, such as `sr_0`, with its role.
        layout: Layout of the observations, see `RoleTrustParallelEnv.layout`.
        seed: Random seed.

    Raises:
        ValueError: The policy attacks on no channel of the agent, or it needs identities in
            reserve, which PettingZoo does not have.
    """

    def __init__(
        self, policy: Policy, agent: str, layout: ViewLayout, seed: int | None = None
    ) -> None:
        self._role = role_in_name(agent)
        _check_channels(agent, self._role, policy)
        self.policy, self.agent = policy, agent
        self._layout = layout
        self._random = Random(generator(seed))
        self._memory = policy.begin(self._random, ())

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.agent!r}, {self.policy!r})"

    def __call__(self, observation: Array) -> Array:
        """Return the action for an observation: quality, then ratings, as far as the role has
        them.
        """
        policy, memory, random = self.policy, self._memory, self._random
        if self._role == "SR+SP":
            quality, ratings, self._memory = policy.both(
                self._layout.both(observation), memory, random
            )
            action = [np.reshape(quality, 1), ratings]
        elif self._role == "SP":
            quality, self._memory = policy.quality(
                self._layout.provider(observation), memory, random
            )
            action = [np.reshape(quality, 1)]
        else:
            ratings, self._memory = policy.ratings(self._layout.rater(observation), memory, random)
            action = [ratings]
        return np.concatenate(action, dtype=np.float32)


class _Group(NamedTuple):
    """Agents that share a policy and a role, by their indices on the provider, the rater and the
    agent axis.
    """

    policy: Policy
    size: int
    provider: Places | None
    rater: Places | None
    agent: Places


class _GroupActions(NamedTuple):
    """Actions of agents that share a policy and a role, as fields of `Actions`, with the axis of
    these agents first.
    """

    quality: Array | None = None
    treatment: Array | None = None
    ratings: Array | None = None
    withheld: Array | None = None
    claims: Array | None = None


class JointPolicy(Frozen):
    """The policies of all agents of a game, in one game or a batch.

    Agents with the same role and equal policies decide together.

    Args:
        game: Game to play.
        policies: Policies by the name of the agent; a policy plays the agent's identities in
            reserve, too. Agents that are not named play honestly.

    Raises:
        ValueError: A name is no agent of the scenario or an identity in reserve, a policy attacks
            on no channel of its agent, or it needs more identities than the agent has in reserve.
    """

    def __init__(self, game: Game, policies: Mapping[str, Policy]) -> None:
        check_instance("game", game, Game, "a Game")
        check_instance("policies", policies, Mapping, "a mapping from names of agents to policies")
        self.game = game
        self.policies = dict(policies)
        honest, roster = Policy(), game.roster
        identities = Counter(roster.owners.values())
        for name, policy in policies.items():
            _check_seat(game, name, policy, identities[name] - 1)
        seated = roster.with_reserves(policies)
        groups: dict[tuple[Role, Policy], tuple[list[int], list[int], list[int]]] = {}
        for place, name in enumerate(roster.names):
            policy = seated.get(name, honest)
            providers, raters, agents = groups.setdefault(
                (roster.roles[name], policy), ([], [], [])
            )
            agents.append(place)
            if name in roster.provider_places:
                providers.append(roster.provider_places[name])
            if name in roster.rater_places:
                raters.append(roster.rater_places[name])
        self._groups = tuple(
            _Group(policy, len(axes[2]), *(_places(axis, game.like) for axis in axes))
            for (_, policy), axes in groups.items()
        )
        self._orders = tuple(_order(list(axis)) for axis in zip(*groups.values(), strict=True))
        self._has_reserve = any(roster.identity_index)
        self._open = game.scenario.ratings.open is not None
        self._before = list(roster.previous_identity)
        self._turn = namespace(game.like).asarray(
            roster.identity_index, dtype=game.like.dtype, device=game.like.device
        )

    def __repr__(self) -> str:
        seated = players(self.policies) or "all play honestly"
        return f"{type(self).__name__}({game_facts(self.game)}; {seated})"

    @property
    def attackers(self) -> tuple[str, ...]:
        """Names of the agents that do not play honestly, with their identities in reserve."""
        policies = self.game.roster.with_reserves(self.policies)
        return tuple(name for name, policy in policies.items() if policy.attacks)

    def begin(self, random: Random, batch: tuple[int, ...] = ()) -> tuple[Any, ...]:
        """Return the memories of the policies before the first round.

        Raises:
            ValueError: The game cannot seat a policy, see `Game.check_policy`.
        """
        memories = tuple(group.policy.begin(random, (group.size, *batch)) for group in self._groups)
        for group, memory in zip(self._groups, memories, strict=True):
            self.game.check_policy(group.policy, None if group.rater is None else memory)
        return memories

    def act(
        self, state: State, memories: tuple[Any, ...], random: Random
    ) -> tuple[Actions, tuple[Any, ...]]:
        """Return the actions of all agents in a state, and the new memories."""
        views = self.game.views(state)
        identities = self._identities(state) if self._has_reserve else None
        providing, rating, wanted, after = [], [], [], []
        for group, memory in zip(self._groups, memories, strict=True):
            chosen, remembered = self._ask(group, state, *views, memory, random)
            providing += [] if group.provider is None else [chosen]
            rating += [] if group.rater is None else [chosen]
            if identities is not None:
                mine = IdentityView(*(field[group.agent, ...] for field in identities))
                present, remembered = group.policy.presence(mine, remembered, random)
                wanted.append(present)
            after.append(remembered)
        providers, raters, agents = self._orders
        qualities, ratings = (
            [action.quality for action in providing],
            [action.ratings for action in rating],
        )
        treatment = _unusual(
            [action.treatment for action in providing], qualities, self._alike, providers
        )
        actions = Actions(
            quality=_arrange(qualities, providers),
            ratings=_arrange(ratings, raters),
            presence=_arrange(wanted, agents) if wanted else None,
            withheld=_unusual(
                [action.withheld for action in rating], ratings, lambda rates: rates < 0, raters
            ),
            treatment=None if treatment is None else treatment.swapaxes(0, 1),
            claims=_unusual(
                [action.claims for action in rating], ratings, lambda rates: 0 * rates, raters
            ),
        )
        return actions, tuple(after)

    def checked_act(
        self, state: State, memories: tuple[Any, ...], random: Random
    ) -> tuple[Actions, tuple[Any, ...]]:
        """Return what `act` returns, once it is checked: the policies may come from other packages.

        Raises:
            ValueError: A policy fails, or an action is NaN or outside [0, 1]. The message names the
                round.
        """
        names = dict.fromkeys(map(policy_name, self.policies.values()))
        return checked_actions(
            self.game, state, f"a policy ({', '.join(names)})", self.act, memories, random
        )

    def _alike(self, quality: Array) -> Array:
        """Return the treatment, (n, S, ...), by providers of this quality, (n, ...), that serve all
        raters alike.
        """
        shape = (quality.shape[0], self.game.roster.n_raters, *quality.shape[1:])
        return namespace(quality).broadcast_to((0 * quality + 1)[:, None, ...], shape)

    def _identities(self, state: State) -> IdentityView:
        """Return the view of all identities, with one further axis, (N, ...)."""
        assert state.population is not None  # somebody has a reserve
        trust, phase = self.game.agent_trust(state), state.population.phase
        broadcast = namespace(trust).broadcast_to
        turn = broadcast(self._turn.reshape(-1, *[1] * (trust.ndim - 1)), trust.shape)
        return IdentityView(
            broadcast(state.round, trust.shape),
            trust,
            turn,
            phase == PRESENT,
            phase[self._before, ...] > PRESENT,
        )

    def _ask(
        self,
        group: _Group,
        state: State,
        providers: ProviderView,
        raters: RaterView,
        memory: Any,
        random: Random,
    ) -> tuple[_GroupActions, Any]:
        """Return the actions of agents that share a policy, and their new memory."""
        provider = (
            None if group.provider is None else ProviderView(*_take(providers, group.provider))
        )
        rater = None if group.rater is None else type(raters)(*_take(raters, group.rater))
        quality = treatment = given = withheld = claims = None
        if provider is not None and rater is not None:
            trust = self.game.agent_trust(state)[group.agent, ...]
            quality, given, memory = group.policy.both(
                AgentView(trust, provider, rater), memory, random
            )
        elif provider is not None:
            quality, memory = group.policy.quality(provider, memory, random)
        elif rater is not None:
            given, memory = group.policy.ratings(rater, memory, random)
        if provider is not None:
            treatment, memory = group.policy.treats(provider, memory, random)
        if rater is not None:
            withheld, memory = group.policy.withholds(rater, memory, random)
        if rater is not None and self._open:
            claims, memory = group.policy.claims(rater, memory, random)
        of_others = map(_own_axis_first, (treatment, given, withheld, claims))
        return _GroupActions(quality, *of_others), memory


def checked_actions(
    game: Game,
    state: State,
    name: str,
    act: Callable[[State, Memory, Random], tuple[Actions, Memory]],
    memory: Memory,
    random: Random,
) -> tuple[Actions, Memory]:
    """Return the actions that `act` chooses, and the new memory.

    Args:
        game: Game that is played.
        state: State before the round.
        name: Name of the players in error messages.
        act: Choice of the actions of all agents.
        memory: Memory of the players.
        random: Random numbers of the players.

    Raises:
        ValueError: `act` fails, or an action is NaN or outside [0, 1]. The message names the round.
    """
    where = f"round {int(state.round.reshape(-1)[0])}"
    try:
        actions, memory = act(state, memory, random)
    except MemoryError:
        raise
    except Exception as error:  # whatever a foreign policy raises
        what = error if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
        raise ValueError(f"{where}: {name} fails: {what}") from error
    _check_actions(actions, game, where)
    return actions, memory


def _check_actions(actions: Actions, game: Game, where: str) -> None:
    """Refuse actions that are NaN or outside [0, 1]; the error names an agent and the channel."""
    raters, providers = game.roster.rater_names, game.roster.provider_names
    treatment = None if actions.treatment is None else actions.treatment.swapaxes(0, 1)
    for channel, chosen, names in (
        ("quality", actions.quality, providers),
        ("ratings", actions.ratings, raters),
        ("treatment", treatment, providers),
        ("claims", actions.claims, raters),
    ):
        if chosen is not None and not within(chosen):
            wrong = ~((chosen >= 0) & (chosen <= 1)).reshape(len(names), -1)
            agent = names[int(np.argwhere(np.asarray(wrong.any(axis=1)))[0, 0])]
            raise ValueError(
                f"{where}: the policy of {agent!r} chose {channel} that are NaN or outside [0, 1]"
            )


def _order(parts: Sequence[list[int]]) -> list[int] | None:
    """Return the order that brings the rows of all groups to their places; None if they are
    there.
    """
    places = [place for part in parts for place in part]
    return None if places == sorted(places) else np.argsort(places).tolist()


def _check_seat(game: Game, name: str, policy: Policy, reserve: int) -> None:
    names, owners = game.roster.names, game.roster.owners
    if name in owners and owners[name] != name:
        raise ValueError(
            f"agent {name!r} is an identity in reserve of {owners[name]!r}; name the policy of that"
        )
    if name not in owners:
        raise ValueError(f"there is no agent {name!r}; the scenario has {shown(names)}")
    further = _TREATMENT if name in game.roster.provider_places else _NONE
    further |= (_REPORTS if name in game.roster.rater_places else _NONE) | (
        _PRESENCE if reserve else _NONE
    )
    _check_channels(name, game.roster.role(name), policy, further, reserve)


def _check_channels(
    name: str, role: Role, policy: Policy, further: frozenset[Channel] = _NONE, reserve: int = 0
) -> None:
    """Refuse a policy that an agent with these further channels and this reserve cannot play."""
    if not isinstance(policy, Policy):
        raise ValueError(f"the policy of {name!r} is {policy!r}; it must be a Policy")
    if not isinstance(policy.attacks, frozenset):
        raise ValueError(
            f"{policy_name(policy)} attacks by {policy.attacks!r}; attacks must be a frozenset of "
            "channels"
        )
    if type(policy).__hash__ is None:
        raise ValueError(
            f"{policy_name(policy)} cannot be hashed; a policy is immutable, such as a frozen "
            "dataclass"
        )
    channels = _CHANNELS[role] | further
    if policy.attacks and not policy.attacks & channels:
        raise ValueError(
            f"agent {name!r} cannot play {policy_name(policy)}: that attacks by "
            f"{_words(policy.attacks)}, "
            f"and the agent only decides on {_words(channels)}"
        )
    if policy.reserve > reserve:
        raise ValueError(
            f"agent {name!r} cannot play {policy_name(policy)}: that needs a reserve of "
            f"{policy.reserve}, and the "
            f"agent has {reserve} here; its group in the scenario gives it identities, by reserve "
            f"= {policy.reserve}, "
            "and PettingZoo leaves them out"
        )


def _words(channels: frozenset[Channel]) -> str:
    return " and ".join(sorted(channels))


def _places(indices: list[int], like: Array) -> Places | None:
    """Return ascending indices of agents as they are looked up fastest; None of nobody."""
    if not indices or not isinstance(like, np.ndarray):
        return indices or None
    if indices[-1] - indices[0] == len(indices) - 1:
        return slice(indices[0], indices[-1] + 1)
    return np.asarray(indices)


def _take(view: ProviderView | RaterView, places: Places) -> list[Array]:
    """Return the fields of a view of all agents for some of them."""
    at = (..., places, *[slice(None)] * (view.trust.ndim - 1))
    if isinstance(places, slice):
        return [
            field[at].copy("K") for field in view
        ]  # a policy may write to it, and not to the state
    return [field[at] for field in view]


def _own_axis_first(of_others: Array | None) -> Array | None:
    """Swap the axes of actions towards other agents, (others, n, ...), to (n, others, ...)."""
    return None if of_others is None else of_others.swapaxes(0, 1)


def _unusual(
    parts: Sequence[Array | None],
    actions: Sequence[Array],
    usual: Callable[[Array], Array],
    order: list[int] | None,
) -> Array | None:
    """Arrange actions on a channel that few policies use. None stands for the usual action; all
    None stay None.
    """
    if all(part is None for part in parts):
        return None
    whole = [
        usual(action) if part is None else part for part, action in zip(parts, actions, strict=True)
    ]
    return _arrange(whole, order)


def _arrange(parts: Sequence[Array], order: list[int] | None) -> Array:
    """Concatenate the parts and put their rows in order; None where they are."""
    rows = namespace(parts[0]).concat(parts) if len(parts) > 1 else parts[0]
    return rows if order is None else rows[order]
