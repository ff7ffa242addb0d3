"""Camera frames that are shorter than the game."""

from pathlib import Path

from roletrust_env import Game


def loop_length_s(game: Game) -> float | None:
    """Return the length of repeated footage in seconds; None if the footage was not repeated."""
    if game.scenario.playback == "once":
        return None
    from roletrust_env.world.vision import HogService

    return game.service.loop_length_s if isinstance(game.service, HogService) else None


def loop_note(game: Game) -> str | None:
    """Return a caption on repeated footage; None if the footage was not repeated."""
    length = loop_length_s(game)
    return (
        None if length is None else f"the frames of {Path(str(game.scenario.frames)).name}, {length:.3g} s, are looped"
    )
