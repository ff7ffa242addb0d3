"""Videos of games."""

from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
from rich.progress import Progress

from roletrust_env import Game, JointPolicy
from roletrust_env.envs.spectator import Spectator
from roletrust_env.game.rollout import rollout
from roletrust_env.game.state import State
from roletrust_env.randomness import Random
from roletrust_env.storage.files import replacing

_FRAMES_PER_S = 8


def write_video(path: Path, joint_policy: JointPolicy, seed: int, progress: Progress) -> None:
    """Play one game, and write a video with one frame for each round, and its last frame as an
    image.

    A single game of `record_curves` with the same seed has the same random numbers.

    Args:
        path: Path of the file, ending in .mp4.
        joint_policy: Game and policies of the attackers; all other agents are honest.
        seed: Random seed.
        progress: Progress display.

    Raises:
        OSError: A file cannot be written.
    """
    game = joint_policy.game
    noise, chance = Random(np.random.default_rng(seed)), Random(np.random.default_rng([seed, 1]))
    states = (round.state for round in rollout(joint_policy, noise, chance, (1,)))
    write_video_of_states(
        path, game, states, list(game.roster.with_reserves(joint_policy.policies)), progress
    )


def write_video_of_states(
    path: Path, game: Game, states: Iterable[State], marked: Sequence[str], progress: Progress
) -> None:
    """Write a video of a game that is played elsewhere, and its last frame as an image.

    An error of ffmpeg becomes one message with the file name.

    Args:
        path: Path of the file, ending in .mp4.
        game: The game.
        states: State after each round.
        marked: Names of the agents to mark as attackers.
        progress: Progress display.

    Raises:
        OSError: A file cannot be written.
    """
    import imageio.v2 as imageio

    spectator = Spectator(game, "rgb_array")
    spectator.attackers = tuple(marked)
    with closing(spectator), replacing(path) as temporary:
        film = imageio.get_writer(
            temporary, fps=_FRAMES_PER_S, macro_block_size=1, quality=8, ffmpeg_log_level="quiet"
        )
        try:
            for state in progress.track(
                states, total=game.scenario.max_cycles, description="Filming"
            ):
                spectator.follow(state)
                picture = np.asarray(spectator.render(), np.uint8)
                even = picture[
                    : len(picture) // 2 * 2, : picture.shape[1] // 2 * 2
                ]  # as H.264 wants it
                try:
                    film.append_data(even)
                except (OSError, RuntimeError) as error:  # ffmpeg stopped or is missing
                    message = str(error).partition("\n")[0]
                    raise OSError(f"{path} cannot be written, ffmpeg failed: {message}") from None
        finally:
            film.close()
    with replacing(path.with_suffix(".png")) as temporary:
        imageio.imwrite(temporary, picture)
