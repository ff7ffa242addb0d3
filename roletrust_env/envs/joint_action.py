"""The joint action of a PettingZoo game: what each agent does, checked, as what providers and raters do."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from roletrust_env.game.state import Actions
from roletrust_env.world.roster import Roster

_NUMBERS = "fiub"
"""Kinds of dtype that an action may have: floats, integers and booleans."""

_least, _greatest = np.minimum.reduce, np.maximum.reduce  # the methods take longer


class JointAction:
    """Reads the actions of a game's agents, or says what is wrong with them.

    Args:
        roster: whose agents act.
    """

    def __init__(self, roster: Roster) -> None:
        self._roster = roster
        rates, provides = set(roster.rater_names), set(roster.provider_names)
        self._slots: dict[str, tuple[tuple[int], slice]] = {}  # an action's shape, and its place among all
        self._size = 0
        for agent in roster.names:
            size = (agent in provides) + roster.n_providers * (agent in rates)
            self._slots[agent] = ((size,), slice(self._size, self._size + size))
            self._size += size
        self._sizes = [shape[0] for shape, _ in self._slots.values()]

    def read(self, actions: Mapping[str, Any], agents: Sequence[str]) -> Actions:
        """The joint action; that of absent agents is 0.

        Args:
            actions: an action for each of the agents, and for nobody else.
            agents: who acts.

        Raises:
            ValueError: an action is missing, of an absent agent, of the wrong size, NaN or outside [0, 1].
        """
        try:
            joint = self._joined(actions, agents)
        except (KeyError, AttributeError, ValueError, TypeError, RuntimeError):
            if complaint := self._complaint(actions, agents):
                raise ValueError(complaint) from None
            joint = self._placed({agent: np.asarray(actions[agent]).reshape(-1) for agent in agents})
        if len(actions) != len(agents) or not (_least(joint) >= 0 and _greatest(joint) <= 1):
            raise ValueError(self._complaint(actions, agents))
        return self._split(joint)

    def _joined(self, actions: Mapping[str, Any], agents: Sequence[str]) -> npt.NDArray[np.float64]:
        """The actions in one vector, without a look at each as long as all is well."""
        if len(agents) < len(self._sizes):
            return self._placed({agent: actions[agent] for agent in agents})
        parts = [actions[agent] for agent in agents]
        if [len(part) for part in parts] != self._sizes:
            raise ValueError
        joint = np.concatenate(parts, dtype=np.float64)  # refuses what is no number
        if joint.ndim > 1:
            raise ValueError
        return joint

    def _placed(self, actions: Mapping[str, Any]) -> npt.NDArray[np.float64]:
        """The actions of some agents, and 0 for the others."""
        joint = np.zeros(self._size)
        for agent, action in actions.items():
            shape, place = self._slots[agent]
            if action.shape != shape or action.dtype.kind not in _NUMBERS:
                raise ValueError
            joint[place] = action
        return joint

    def _complaint(self, actions: Any, agents: Sequence[str]) -> str | None:
        """What is wrong with the actions, and what is allowed; None if nothing is."""
        if not isinstance(actions, Mapping):
            return f"actions are {type(actions).__name__}; they must be a dict from agent to action"
        for agent in agents:
            if agent not in actions:
                return f"the action of {agent!r} is missing; needed are those of {', '.join(agents)}"
            if complaint := self.complaint(agent, actions[agent]):
                return complaint
        strangers = ", ".join(repr(agent) for agent in actions if agent not in agents)
        if not strangers:
            return None
        return f"there are actions of {strangers}, who take no part now; those who do: {', '.join(agents)}"

    def complaint(self, agent: str, action: Any) -> str | None:
        """What is wrong with an agent's action, and what is allowed; None if nothing is."""
        shape = self._slots[agent][0]
        try:
            action = np.asarray(action)
        except (
            ValueError,
            TypeError,
            RuntimeError,
        ) as error:  # ragged, or a tensor of no use to NumPy
            return f"the action of {agent!r} is no array: {error}; it must be numbers, of shape {shape}"
        if action.dtype.kind not in _NUMBERS:
            return f"the action of {agent!r} is no array of numbers but {action!r}; it must be one, of shape {shape}"
        if action.size != shape[0]:
            return f"the action of {agent!r} is of shape {action.shape}; it must have the size of shape {shape}"
        wrong = action[~((action >= 0) & (action <= 1))]
        return f"the action of {agent!r} holds {wrong[0]}; every entry must lie in [0, 1]" if wrong.size else None

    def _split(self, joint: npt.NDArray[np.float64]) -> Actions:
        """The vector of all actions as what providers and what raters do."""
        roster, p = self._roster, self._roster.n_providers
        n_sr, n_sp = roster.n_raters - roster.n_both, roster.n_providers - roster.n_both
        ratings, quality = joint[: n_sr * p].reshape(n_sr, p), joint[n_sr * p : n_sr * p + n_sp]
        if not roster.n_both:
            return Actions(quality, ratings)
        both = joint[n_sr * p + n_sp :].reshape(roster.n_both, 1 + p)
        return Actions(np.concatenate([quality, both[:, 0]]), np.concatenate([ratings, both[:, 1:]]))
