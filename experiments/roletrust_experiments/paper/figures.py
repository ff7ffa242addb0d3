"""Figures 3 and 4 of Su and Saint-Jore (2023): their attacks, their windows and their claims."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import Game, JointPolicy, Policy, State, make_scenario
from roletrust_env.errors import suggest
from roletrust_env.evaluation.curves import Curves
from roletrust_env.evaluation.games import Advance, track_curves
from roletrust_env.storage.markdown import ShownAsMarkdown, markdown_table
from roletrust_env.storage.provenance import describe_policies, provenance
from roletrust_experiments.paper import claims

COLUMNS = ("time_s", "ToR_1", "ToR_2", "ToR_3", "ToP_1", "ToP_2", "ToP_3")
ON_OFF, BAD_MOUTHING = claims.Window(50.0, 90.0), claims.Window(20.0, 45.0)

Attack = Literal["on-off", "bad-mouthing"]
PaperScenario = Literal["paper-3x3-hog", "paper-3x3"]


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


@dataclass(frozen=True, repr=False)
class Figures(ShownAsMarkdown):
    """The measured Figures 3 and 4.

    Attributes:
        game: Game of both figures.
        seed: Random seed.
        papers: What the paper shows.
        curves: Curves of each figure.
        claims: Claims of the paper, checked.
        footage: Of frames of the user: their length in seconds if they were repeated, the mean
            probability of a person before the attack, and whether one was in clear view; None for
            the rendered scene.
    """

    game: Game
    seed: int
    papers: tuple[Paper, Paper]
    curves: tuple[Curves, Curves]
    claims: Sequence[claims.Claim]
    footage: Mapping[str, Any] | None

    def data(self) -> dict[str, Any]:
        """Return the claims with what determines them, as JSON has it."""
        attackers = {f"figure {one.number}": describe_policies(one.policies) for one in self.papers}
        return {
            "command": "roletrust figures",
            "service": self.game.scenario.service,
            **provenance(self.game, self.seed),
            "attackers": attackers,
            "time": "the state after round r, counted from 0, stands at (r + 1) * period_s",
            **({"footage": self.footage} if self.footage else {}),
            "claims": [claim._asdict() for claim in self.claims],
        }

    def notes(self) -> list[str]:
        """Return what the words of the claims mean, and what is known of the frames."""
        scenario, note = self.game.scenario, loop_note(self.game)
        time_s = self.curves[0].time_s
        calm = claims.spans(time_s, claims.calm_before(time_s, scenario, ON_OFF))
        steady = claims.spans(time_s, claims.steady_under(time_s, scenario, BAD_MOUTHING))
        after = f"{claims.SETTLE_S:g} s after any other event"
        lines = [
            f"calm: before the attack, {after} (Figure 3: {calm})",
            f"steady: mean over the rounds of the attack, {after} (Figure 4: {steady})",
            "least dip: of the three ToP, the smallest fall while the target moves fast",
        ]
        if any(claim.ok is None for claim in self.claims):
            lines.append(
                "n/a: the bound holds for the rendered scene, and only with a person in clear view"
            )
        if self.footage:
            lines.append(
                f"the mean probability of a person was {self.footage['probability']:.2f} before "
                "the attack"
            )
        return [*lines, *([note] if note else [])]

    def _repr_markdown_(self) -> str:
        rows = [
            (
                f"{one.figure}",
                one.what,
                one.paper,
                one.needed,
                one.measured,
                claims.VERDICTS[one.ok],
            )
            for one in self.claims
        ]
        headings = ("figure", "what", "the paper", "needed", "measured", "")
        return markdown_table(headings, rows, headings)


def figures(
    scenario: PaperScenario = "paper-3x3-hog",
    *,
    seed: int = 0,
    advance: Advance = lambda what, share: None,
    **changes: Any,
) -> Figures:
    """Reproduce Figures 3 and 4 of Su and Saint-Jore (2023), and check the claims of the paper.

    Args:
        scenario: `"paper-3x3-hog"`, people detection in camera frames, or `"paper-3x3"`, plain
            numbers in place of cameras.
        seed: Random seed, at least 0; the rendered scene does not depend on it.
        advance: Called with the progress.
        **changes: Other values of fields of the scenario, such as `frames="walk.mp4"` and
            `playback="loop"`.

    Raises:
        ValueError: A value is not allowed, or the frames cannot be read or are too few.

    Example:
        >>> from roletrust_experiments.paper.figures import figures
        >>> found = figures("paper-3x3")
        >>> all(claim.ok for claim in found.claims)
        True
    """
    if scenario not in get_args(PaperScenario):
        raise ValueError(
            f"unknown scenario {scenario!r}{suggest(scenario, get_args(PaperScenario))}"
        )
    rules = make_scenario(scenario)
    game = Game(rules.change(**changes) if changes else rules)
    both, probabilities = papers(game.scenario.period_s), list[float]()

    def watch(state: State) -> None:
        probabilities.append(float(state.service.mean()))

    def track(paper: Paper) -> Curves:
        joint_policy = JointPolicy(game, paper.policies)
        return track_curves(joint_policy, seed, advance, f"Figure {paper.number}", on_round=watch)

    curves = track(both[0]), track(both[1])
    checked = [
        claim
        for paper, each in zip(both, curves, strict=True)
        for claim in paper.check(each, game.scenario, paper.attack)
    ]
    footage: dict[str, Any] | None = None
    if game.scenario.frames is not None:
        calm = claims.calm_before(curves[0].time_s, game.scenario, ON_OFF)
        footage = {
            "loop_length_s": loop_length_s(game),
            "probability": float(np.mean(probabilities[: len(calm)], where=calm)),
            "in_clear_view": claims.in_clear_view(checked),
        }
        checked = claims.for_given_frames(checked)
    return Figures(game, seed, both, curves, checked, footage)
