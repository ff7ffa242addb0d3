"""Games with a progress bar."""

from collections.abc import Callable

from rich.progress import Progress

from roletrust_env.evaluation.curves import Curves, record_curves
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.state import State


def track_curves(
    joint_policy: JointPolicy,
    seed: int,
    progress: Progress,
    label: str,
    *,
    games: int = 1,
    on_round: Callable[[State], None] = lambda state: None,
) -> Curves:
    """Return the curves of games and show the progress. Other arguments as for `record_curves`.

    Args:
        joint_policy: Game and policies of its agents.
        seed: Random seed.
        progress: Progress display.
        label: Name of the work in the display.
        games: Number of games.
        on_round: Called with the state after each round.
    """
    job = progress.add_task(label, total=joint_policy.game.scenario.max_cycles)

    def advance(state: State) -> None:
        on_round(state)
        progress.advance(job)

    return record_curves(joint_policy, seed, games=games, on_round=advance)
