"""Videos of games."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import numpy.typing as npt
from rich.progress import Progress

from roletrust_env import Game, Player, Policy, parallel_env
from roletrust_env.storage.files import replacing

_FRAMES_PER_S = 8

Picture = npt.NDArray[np.uint8]


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
    import imageio.v2 as imageio

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
            picture = np.asarray(environment.render(), np.uint8)
            film(picture)
    with replacing(path.with_suffix(".png")) as temporary:
        imageio.imwrite(temporary, picture)


@contextmanager
def _filming(path: Path) -> Iterator[Callable[[Picture], None]]:
    """Yield a function that adds frames to a video; an error of ffmpeg becomes one message with the file name."""
    import imageio.v2 as imageio

    def add(picture: Picture) -> None:
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
