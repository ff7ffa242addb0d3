"""The joint action of a PettingZoo game: the actions of all agents, checked, as qualities and
ratings.
"""

from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.ma import MaskedArray

from roletrust_env.arrays import Array, numpy_array
from roletrust_env.envs.arguments import NUMBERS, singles_within
from roletrust_env.errors import short
from roletrust_env.game.state import Actions
from roletrust_env.world.roster import Roster, shown

_least, _greatest = np.minimum.reduce, np.maximum.reduce  # the methods take longer

_dtype, _n_bytes = attrgetter("dtype"), attrgetter("nbytes")

_SINGLE = np.dtype(np.float32)


class JointAction:
    """Reads the actions of the agents of a game, and reports the errors in them."""

    def __init__(self, roster: Roster) -> None:
        self._roster = roster
        self._slots: dict[
            str, tuple[tuple[int], slice]
        ] = {}  # an action's shape, and its place among all
        self._size = 0
        for agent in roster.names:
            size = roster.action_size(agent)
            self._slots[agent] = ((size,), slice(self._size, self._size + size))
            self._size += size
        self._sizes = [shape[0] for shape, _ in self._slots.values()]
        self._dtypes, self._types = [_SINGLE] * len(self._sizes), [np.ndarray] * len(self._sizes)
        self._n_bytes = [_SINGLE.itemsize * size for size in self._sizes]

    def read(self, actions: Mapping[str, Any], agents: Sequence[str]) -> npt.NDArray[np.float64]:
        """Return the actions in one vector, in the order of the agents; those of absent agents are
        0.

        Args:
            actions: An action for each of the agents, and for no other agent.
            agents: Agents that act.

        Raises:
            ValueError: An action is missing, belongs to an absent agent, has the wrong size, or
                holds NaN or a value outside [0, 1].
        """
        if len(agents) == len(self._dtypes):
            joint = self._singles(actions, agents)
            if joint is not None:
                return joint
        try:
            if MaskedArray in map(type, map(actions.__getitem__, agents)):
                raise ValueError  # NumPy joins arrays without their masks
            joint = self._joined(actions, agents)
        except (LookupError, AttributeError, ValueError, TypeError, RuntimeError):
            if complaint := self._complaint(actions, agents):
                raise ValueError(complaint) from None
            joint = self._placed(
                {agent: np.asarray(actions[agent]).reshape(-1) for agent in agents}
            )
        if len(actions) != len(agents) or not (_least(joint) >= 0 and _greatest(joint) <= 1):
            raise ValueError(self._complaint(actions, agents))
        return joint

    def _singles(
        self, actions: Mapping[str, Any], agents: Sequence[str]
    ) -> npt.NDArray[np.float64] | None:
        """Return the actions of all agents in one vector; None if they are not valid arrays of
        float32.
        """
        try:
            parts = [*map(actions.__getitem__, agents)]
            if len(actions) != len(parts) or [*map(_dtype, parts)] != self._dtypes:
                return None
            if [*map(_n_bytes, parts)] != self._n_bytes or [*map(type, parts)] != self._types:
                return None
            singles = b"".join(parts)
        except (LookupError, AttributeError, TypeError, RuntimeError, ValueError, BufferError):
            return None
        return self.joined([singles]) if singles_within(singles) else None

    def single(self, agent: str, action: Any) -> bytes | None:
        """Return the action of an agent as bytes of float32; None if it is no array of these, or
        not valid.
        """
        if (
            type(action) is np.ndarray
            and action.dtype is _SINGLE
            and action.shape == self._slots[agent][0]
        ):
            floats = action.tobytes()
            return floats if singles_within(floats) else None
        return None

    def joined(self, singles: Sequence[bytes]) -> npt.NDArray[np.float64]:
        """Return the actions of all agents in one vector, see `single`."""
        return np.frombuffer(b"".join(singles), np.float32).astype(np.float64)

    def _joined(self, actions: Mapping[str, Any], agents: Sequence[str]) -> npt.NDArray[np.float64]:
        """Return the actions in one vector; a quick path without a check of single actions."""
        if len(agents) < len(self._sizes):
            return self._placed({agent: actions[agent] for agent in agents})
        parts = [actions[agent] for agent in agents]
        if [len(part) for part in parts] != self._sizes:
            raise ValueError
        joint = np.concatenate(parts, dtype=np.float64)  # raises where an entry is no number
        if joint.ndim > 1:
            raise ValueError
        return joint

    def _placed(self, actions: Mapping[str, Any]) -> npt.NDArray[np.float64]:
        """Return the actions of some agents in one vector, with 0 for the others."""
        joint = np.zeros(self._size)
        for agent, action in actions.items():
            shape, place = self._slots[agent]
            if action.shape != shape or action.dtype.kind not in NUMBERS:
                raise ValueError
            joint[place] = action
        return joint

    def _complaint(self, actions: Any, agents: Sequence[str]) -> str | None:
        """Return the error in the actions, with what is allowed; None for valid actions."""
        if not isinstance(actions, Mapping):
            return f"actions are {type(actions).__name__}; they must be a dict from agent to action"
        for agent in agents:
            if agent not in actions:
                return (
                    f"the action of {agent!r} is missing; needed are those of {', '.join(agents)}"
                )
            if complaint := self.complaint(agent, actions[agent]):
                return complaint
        strangers = ", ".join(repr(agent) for agent in actions if agent not in agents)
        if not strangers:
            return None
        return (
            f"there are actions of {strangers}, which take no part now; the agents that act: "
            f"{', '.join(agents)}"
        )

    def complaint(self, agent: str, action: Any) -> str | None:
        """Return the error in an agent's action, with what is allowed; None for a valid action."""
        if agent not in self._slots:
            return f"there is no agent {agent!r}; there are {shown(list(self._slots))}"
        if self.single(agent, action) is not None:
            return None
        shape = self._slots[agent][0]
        try:
            action = numpy_array(f"the action of {agent!r}", action, f"numbers, of shape {shape}")
        except ValueError as error:
            return str(error)
        if action.dtype.kind not in NUMBERS:
            what = short(repr(action))
            return (
                f"the action of {agent!r} is no array of numbers but {what}; it must be one, of "
                f"shape {shape}"
            )
        if action.size != shape[0]:
            return (
                f"the action of {agent!r} is of shape {action.shape}; it must have the size of "
                f"shape {shape}"
            )
        wrong = action[~((action >= 0) & (action <= 1))]
        return (
            f"the action of {agent!r} holds {wrong[0]}; every entry must lie in [0, 1]"
            if wrong.size
            else None
        )

    def split(self, joint: Array) -> Actions:
        """Return the qualities and the ratings in the vector of all actions, see `read`."""
        roster, p = self._roster, self._roster.n_providers
        n_sr, n_sp = roster.n_raters - roster.n_both, roster.n_providers - roster.n_both
        ratings, quality = joint[: n_sr * p].reshape(n_sr, p), joint[n_sr * p : n_sr * p + n_sp]
        if not roster.n_both:
            return Actions(quality, ratings)
        both = joint[n_sr * p + n_sp :].reshape(roster.n_both, 1 + p)
        return Actions(
            np.concatenate([quality, both[:, 0]]), np.concatenate([ratings, both[:, 1:]])
        )
