"""Figures 3 and 4 of Su and Saint-Jore (2023): their attacks, their windows and their claims."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal, NamedTuple

from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import Game, Policy
from roletrust_experiments.paper import claims

COLUMNS = ("time_s", "ToR_1", "ToR_2", "ToR_3", "ToP_1", "ToP_2", "ToP_3")
ON_OFF, BAD_MOUTHING = claims.Window(50.0, 90.0), claims.Window(20.0, 45.0)

Attack = Literal["on-off", "bad-mouthing"]


class Paper(NamedTuple):
    """One of the paper's figures.

    Attributes:
        number: Number in the paper.
        title: Title of the figure.
        attacker: Curve of the attacker, such as `ToP_3`.
        label: Label of the attack.
        attack: Window of the attack.
        policies: Policies of the attackers.
        levels: Levels of ToR under the attack that the paper names.
        check: Function of curves, a scenario and the window that returns the claims.
    """

    number: int
    title: str
    attacker: str
    label: str
    attack: claims.Window
    policies: Mapping[str, Policy]
    levels: tuple[float, ...]
    check: Callable[..., list[claims.Claim]]


def papers(period_s: float) -> tuple[Paper, Paper]:
    """Return Figure 3 and Figure 4 for rounds of a given length in seconds."""

    def rounds(window: claims.Window) -> tuple[int, int]:
        return round(window.start_s / period_s), round(window.stop_s / period_s)

    (off, on), (mouth, hush) = rounds(ON_OFF), rounds(BAD_MOUTHING)
    on_off: dict[str, Policy] = {"sp_2": OnOff(start=off, stop=on)}
    liar: dict[str, Policy] = {"sr_2": BadMouthing(start=mouth, stop=hush)}
    labels = "on-off attack by SP_3", "bad-mouthing by SR_3"
    titles = "Figure 3: on-off attack by provider 3", "Figure 4: bad-mouthing attack by rater 3"
    return (
        Paper(3, titles[0], "ToP_3", labels[0], ON_OFF, on_off, (), claims.check_on_off),
        Paper(
            4,
            titles[1],
            "ToR_3",
            labels[1],
            BAD_MOUTHING,
            liar,
            (0.6, 0.4),
            claims.check_bad_mouthing,
        ),
    )


def loop_length_s(game: Game) -> float | None:
    """Return the length of repeated footage in seconds; None if the footage was not repeated."""
    if game.scenario.playback == "once":
        return None
    from roletrust_env.world.vision.service import HogService

    return game.service.loop_length_s if isinstance(game.service, HogService) else None


def loop_note(game: Game) -> str | None:
    """Return a caption on repeated footage; None if the footage was not repeated."""
    length = loop_length_s(game)
    return (
        None
        if length is None
        else f"the frames of {Path(str(game.scenario.frames)).name}, {length:.3g} s, are looped"
    )
