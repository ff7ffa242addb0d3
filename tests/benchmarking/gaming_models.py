"""Models that a process of their own keeps from cheating."""

import sys
from typing import Any

from roletrust_env.trust.models.central.means import Mean


class OffTheStack(Mean):
    """A model that reads the abilities of providers off the state of the game, on the stack of its callers."""

    def provider_trust(self, state: Any) -> Any:
        """The abilities, if they can be found."""
        frame = sys._getframe()
        while frame := frame.f_back:  # type: ignore[assignment]
            for value in list(frame.f_locals.values()):
                ability = getattr(getattr(value, "properties", None), "ability", None)
                if ability is not None:
                    batch = [1] * (state.top.ndim - ability.ndim)
                    return ability.reshape(len(ability), *batch, *ability.shape[1:]) + 0 * state.top
        return super().provider_trust(state)
