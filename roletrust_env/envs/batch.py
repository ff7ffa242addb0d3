"""A batch of attack tasks that is played, observed and restarted: the state behind every face of a task."""

from typing import Any

from roletrust_env.arrays import Array, namespace
from roletrust_env.game.attack import AttackTask, Outcome, TaskState
from roletrust_env.randomness import Random


class TaskBatch:
    """Games of one task in progress.

    Args:
        task: what is played.
        shape: of the batch: `()` for one game, `(E,)` for E.
    """

    def __init__(self, task: AttackTask, shape: tuple[int, ...] = ()) -> None:
        self.task = task
        self.shape = shape
        self.state: TaskState | None = None

    def restart(self, random: Random, ended: Array | None = None) -> None:
        """Begin all games anew, or those that have ended, (E,); the others go on."""
        fresh = self.task.start(self.task.game.draw(random, self.shape, start=True), random)
        self.state = fresh if ended is None else _choose(ended, fresh, self.state)

    def step(self, action: Array, random: Random, waiting: Array | None = None) -> Outcome:
        """Play one round of all games but those that wait, (E,); `action` has shape (A, ...).

        What the outcome says of a game that waits means nothing.
        """
        if self.state is None:
            raise RuntimeError("call reset() before step(): there is no episode")
        noise = self.task.game.draw(random, self.shape)
        after, outcome = self.task.step(self.state, action, noise, random)
        self.state = after if waiting is None else _choose(waiting, self.state, after)
        return outcome

    def observe(self) -> Array:
        """What the attacker sees, shape (K, ...)."""
        if self.state is None:
            raise RuntimeError("call reset() before observe(): there is no episode")
        return self.task.observe(self.state)


def _choose(condition: Array, yes: Any, no: Any) -> Any:
    """Leaf by leaf of two alike trees, by game; what is a fact of all games holds if it holds of both."""
    if yes is None or isinstance(yes, bool):
        return yes and no
    if isinstance(yes, tuple):
        parts = [_choose(condition, a, b) for a, b in zip(yes, no, strict=True)]
        return type(yes)(*parts) if hasattr(yes, "_fields") else tuple(parts)
    return namespace(condition).where(condition, yes, no)
