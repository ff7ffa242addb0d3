"""The moving picture of the README: `python docs/_ext/moving_picture.py docs/game.gif`."""

import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
from PIL import Image

from roletrust_baselines import BadMouthing
from roletrust_env import Player, Policy, make_scenario, parallel_env
from roletrust_env.storage.files import replacing

LARGEST = 1_000_000
"""Largest size of the file in bytes."""

_ROUNDS, _WIDTH, _FRAME_MS, _LAST_MS, _COLOURS = 60, 860, 160, 2500, 64


def write_moving_picture(path: Path, *, rounds: int = _ROUNDS) -> None:
    """Write a GIF of a game in which one of three raters begins to lie at a third of the rounds.

    Args:
        path: Path of the file.
        rounds: Number of rounds.

    Raises:
        ValueError: The file would be larger than `LARGEST`.
    """
    frames = [_small(picture) for picture in _pictures(rounds)]
    palette = frames[-1].quantize(_COLOURS)
    first, *others = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    times = [_FRAME_MS] * (len(frames) - 1) + [_LAST_MS]
    with replacing(path) as temporary:
        first.save(
            temporary,
            "GIF",
            save_all=True,
            append_images=others,
            duration=times,
            loop=0,
            optimize=True,
        )
        if temporary.stat().st_size > LARGEST:
            raise ValueError(
                f"{path} would have {temporary.stat().st_size:,} bytes; at most {LARGEST:,} are "
                "allowed"
            )


def _pictures(rounds: int) -> Iterator[np.ndarray]:
    scenario = make_scenario("paper-3x3").change(max_cycles=rounds, perturbations=())
    attackers = {"sr_2": BadMouthing(start=rounds // 3)}
    environment = parallel_env(scenario, render_mode="rgb_array")
    seen, _ = environment.reset(seed=0, options={"attackers": list(attackers)})
    players = {
        agent: Player(attackers.get(agent, Policy()), agent, environment.layout)
        for agent in environment.agents
    }
    with closing(environment):
        while environment.agents:
            seen, *_ = environment.step(
                {agent: players[agent](seen[agent]) for agent in environment.agents}
            )
            yield np.asarray(environment.render(), np.uint8)


def _small(picture: np.ndarray) -> Image.Image:
    image = Image.fromarray(picture)
    return image.resize(
        (_WIDTH, round(image.height * _WIDTH / image.width)), Image.Resampling.LANCZOS
    )


if __name__ == "__main__":
    write_moving_picture(Path(sys.argv[1]))
