"""Videos of games."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from rich.progress import Progress

from roletrust_env import Game, Player, Policy, parallel_env
from roletrust_env.envs.spectator import Spectator
from roletrust_env.game.state import State
from roletrust_env.storage.files import replacing

_FRAMES_PER_S = 8


def write_video(path: Path, game: Game, attackers: Mapping[str, Policy], seed: int, progress: Progress) -> None:
    """Play one game through the PettingZoo environment, and write a video with one frame for each round.

    The last frame is also saved as an image. A single game of `record_curves` with the same seed has the same random
    numbers.

    Args:
        path: Path of the file, ending in .mp4.
        game: Game to play.
        attackers: Policies of the attackers by agent; all other agents are honest.
        seed: Random seed.
        progress: Progress display.

    Raises:
        OSError: A file cannot be written.
    """
    environment = parallel_env(game.scenario, game.model, render_mode="rgb_array")
    seen, _ = environment.reset(seed=seed, options={"attackers": list(attackers)})
    seeds = np.random.SeedSequence(seed).generate_state(len(environment.possible_agents)).tolist()
    players = {
        agent: Player(attackers.get(agent, Policy()), agent, game.layout, one)
        for agent, one in zip(environment.possible_agents, seeds, strict=True)
    }
    with closing(environment), _filming(path) as film:
        for _ in progress.track(range(game.scenario.max_cycles), description="Filming"):
            if not environment.agents:
                break
            seen, *_ = environment.step({agent: players[agent](seen[agent]) for agent in environment.agents})
            film(environment.render())


def write_video_of_states(
    path: Path, game: Game, states: Iterable[State], marked: Sequence[str], progress: Progress
) -> None:
    """Write a video of a game that is played elsewhere, and its last frame as an image.

    Args:
        path: Path of the file, ending in .mp4.
        game: The game.
        states: State after each round.
        marked: Names of the agents to mark as attackers.
        progress: Progress display.

    Raises:
        OSError: A file cannot be written.
    """
    spectator = Spectator(game, "rgb_array")
    spectator.attackers = tuple(marked)
    with closing(spectator), _filming(path) as film:
        for state in progress.track(states, total=game.scenario.max_cycles, description="Filming"):
            spectator.follow(state)
            film(spectator.render())


@contextmanager
def _filming(path: Path) -> Iterator[Callable[[Any], None]]:
    """Yield a function that adds frames to a video, and write the last one as an image, too.

    An error of ffmpeg becomes one message with the file name.
    """
    import imageio.v2 as imageio

    last: list[npt.NDArray[np.uint8]] = []

    def add(frame: Any) -> None:
        picture = np.asarray(frame, np.uint8)
        last[:] = [picture]
        try:
            film.append_data(picture[: len(picture) // 2 * 2, : picture.shape[1] // 2 * 2])  # H.264 wants it even
        except (OSError, RuntimeError) as error:  # ffmpeg stopped or is missing
            raise OSError(f"{path} cannot be written, ffmpeg failed: {str(error).partition(chr(10))[0]}") from None

    with replacing(path) as temporary:
        film = imageio.get_writer(temporary, fps=_FRAMES_PER_S, macro_block_size=1, quality=8, ffmpeg_log_level="quiet")
        try:
            yield add
        finally:
            film.close()
    with replacing(path.with_suffix(".png")) as temporary:
        imageio.imwrite(temporary, last[0])
