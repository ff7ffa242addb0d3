"""Actions of environments: checked, and as the arrays that a game takes."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from roletrust_env.arrays import Array, check_within, namespace, numpy_array, within
from roletrust_env.errors import short
from roletrust_env.game.state import Actions, CheckedActions
from roletrust_env.world.roster import Roster, shown

NUMBERS = "fiub"
"""Kinds of dtype that an action may have: floats, integers and booleans."""

Joint = npt.NDArray[np.float64]

_ARRAYS = {np.ndarray}


def is_plain(action: Any, shape: tuple[int, ...], low: float = 0.0) -> bool:
    """Return whether an action is a valid array of NumPy, of this shape; others may be valid, too,
    after a closer look.
    """
    plain = type(action) is np.ndarray and action.shape == shape and action.dtype.kind in NUMBERS
    return plain and within(action, low)


def check_action(action: Any, shape: tuple[int, ...], low: float = 0.0) -> npt.NDArray[np.float32]:
    """Return an action as an array of float32.

    Args:
        action: Action of one game, or of a batch.
        shape: Shape that it must have.
        low: Lower bound of its entries; the upper bound is 1.

    Raises:
        ValueError: The action has the wrong shape, or holds NaN or a value outside [low, 1].
    """
    if not is_plain(action, shape, low):
        action = numpy_array("the action", action, f"numbers, of shape {shape}")
        if action.shape != shape or action.dtype.kind not in NUMBERS:
            raise ValueError(
                f"the action has shape {action.shape} and dtype {action.dtype}; it must be "
                f"numbers, of shape {shape}"
            )
        check_within("the action", action, low)
    checked: npt.NDArray[np.float32] = action.astype(np.float32, copy=False)
    return checked


class JointAction:
    """The actions of the agents of a PettingZoo game, as one vector in the order of the agents.

    Args:
        roster: Agents of the game.
    """

    def __init__(self, roster: Roster) -> None:
        self._roster = roster
        sizes = list(map(roster.action_size, roster.names))
        ends = np.cumsum(sizes).tolist()
        self._sizes = dict(zip(roster.names, sizes, strict=True))
        self._shapes = [(size,) for size in sizes]
        self._size = sum(sizes)
        self._slots = {
            agent: slice(end - size, end)
            for (agent, size), end in zip(self._sizes.items(), ends, strict=True)
        }

    def read(self, actions: Mapping[str, Any], agents: Sequence[str]) -> Joint:
        """Return the actions in one vector; those of absent agents are 0.

        Args:
            actions: An action for each of the agents, and for no other agent.
            agents: Agents that act.

        Raises:
            ValueError: An action is missing, belongs to an absent agent, has the wrong size, or
                holds NaN or a value outside [0, 1].
        """
        joint = self._joined(actions, agents)
        if joint is None:  # it is not plain arrays, or not valid
            self._check_agents(actions, agents)
            joint = self.place({agent: self.check(agent, actions[agent]) for agent in agents})
        return joint

    def check(self, agent: str, action: Any) -> Joint:
        """Return the action of an agent, a new vector.

        Raises:
            ValueError: There is no such agent, or the action has the wrong size, or holds NaN or a
                value outside [0, 1].
        """
        if agent not in self._sizes:
            raise ValueError(f"there is no agent {agent!r}; there are {shown(list(self._sizes))}")
        shape = (self._sizes[agent],)
        if is_plain(action, shape):
            return np.array(action, np.float64)
        what = f"the action of {agent!r}"
        action = numpy_array(what, action, f"numbers, of shape {shape}")
        if action.dtype.kind not in NUMBERS:
            raise ValueError(
                f"{what} is {short(repr(action))}; it must be numbers, of shape {shape}"
            )
        if action.size != shape[0]:
            raise ValueError(
                f"{what} has shape {action.shape}; it must have the size of shape {shape}"
            )
        check_within(what, action)
        return np.array(action, np.float64).reshape(-1)

    def place(self, actions: Mapping[str, Joint]) -> Joint:
        """Return the checked actions of some agents in one vector, with 0 for the others."""
        joint = np.zeros(self._size)
        for agent, action in actions.items():
            joint[self._slots[agent]] = action
        return joint

    def split(self, joint: Array) -> Actions:
        """Return the qualities and the ratings in the vector of all actions."""
        roster, p = self._roster, self._roster.n_providers
        n_sr, n_sp = roster.n_raters - roster.n_both, p - roster.n_both
        quality = joint[n_sr * p : n_sr * p + n_sp]
        ratings = joint[: n_sr * p].reshape(n_sr, p)
        if not roster.n_both:
            return CheckedActions(quality, ratings)
        both = joint[n_sr * p + n_sp :].reshape(roster.n_both, 1 + p)
        concat = namespace(joint).concat
        return CheckedActions(concat([quality, both[:, 0]]), concat([ratings, both[:, 1:]]))

    def _joined(self, actions: Mapping[str, Any], agents: Sequence[str]) -> Joint | None:
        """Return valid actions of all agents in one vector; None if they are something else."""
        if type(actions) is not dict or not len(actions) == len(agents) == len(self._sizes):
            return None
        try:
            parts = [actions[agent] for agent in agents]
        except KeyError:
            return None
        if {*map(type, parts)} != _ARRAYS or [part.shape for part in parts] != self._shapes:
            return None
        try:
            joint = np.concatenate(parts, dtype=np.float64)
        except TypeError:  # they are not numbers
            return None
        return joint if within(joint) else None

    def _check_agents(self, actions: Any, agents: Sequence[str]) -> None:
        """Refuse actions that are not those of the agents that act."""
        if not isinstance(actions, Mapping):
            raise ValueError(
                f"actions are {type(actions).__name__}; they must be a dict from agent to action"
            )
        for agent in agents:
            if agent not in actions:
                raise ValueError(
                    f"the action of {agent!r} is missing; needed are those of {', '.join(agents)}"
                )
        strangers = ", ".join(repr(agent) for agent in actions if agent not in agents)
        if strangers:
            raise ValueError(
                f"there are actions of {strangers}, which take no part now; the agents that act: "
                f"{', '.join(agents)}"
            )
