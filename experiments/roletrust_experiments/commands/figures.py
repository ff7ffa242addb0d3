"""`roletrust figures`: Figures 3 and 4 of Su and Saint-Jore (EWSN 2023), from real ratings."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer
from rich.table import Table

from roletrust_env import Game, JointPolicy, State, make_scenario
from roletrust_env.storage.files import prepare_folder, write_json
from roletrust_env.storage.provenance import describe_policies, provenance
from roletrust_experiments.commands.console import console, plain_table, progress_bar, tell
from roletrust_experiments.commands.options import Out
from roletrust_experiments.paper import claims
from roletrust_experiments.paper.figures import (
    BAD_MOUTHING,
    ON_OFF,
    loop_length_s,
    loop_note,
    papers,
)
from roletrust_experiments.playing.games import track_curves


def figures(
    out: Out = Path("results/figures"),
    service: Annotated[
        Literal["hog", "synthetic"],
        typer.Option(help="Service: people detection in camera frames, or plain numbers."),
    ] = "hog",
    frames: Annotated[
        str | None,
        typer.Option(
            metavar="PATH_OR_NUMBER",
            help="Video, image folder or camera number in place of the scene.",
        ),
    ] = None,
    loop: Annotated[
        bool,
        typer.Option("--loop", help="Repeat --frames from the start if they end before the run."),
    ] = False,
    seed: Annotated[
        int,
        typer.Option(
            min=0,
            help="Random seed; the same seed gives the same results. The scene does not depend on it.",  # noqa: E501
        ),
    ] = 0,
) -> None:
    """Reproduce [bold]Figures 3 and 4[/] of the paper, and compare the measurements with its
    claims.

    Three raters rate three cameras every half second. The figures differ in the attacker only. In
    Figure 3, provider 3 alternates between bad and good service (on-off, 50-90 s). In Figure 4,
    rater 3 rates 0.5 whatever it sees (bad-mouthing, 20-45 s).

    Written: [green]figure3.csv figure3.png figure4.csv figure4.png results.json[/]. The state after
    round r, counted from 0, is at time (r + 1) x 0.5 s.

    With --frames, all three cameras see the same picture: 120 s of video, or 240 images, one for
    each round; fewer with --loop. Rows whose bounds only hold for the rendered scene say n/a. If no
    person is clear, there is no table.

    [bold]Examples[/]

    [dim]# with OpenCV's people detector, in about a minute[/]
    [cyan]roletrust figures[/]

    [dim]# with your own video of two minutes[/]
    [cyan]roletrust figures --frames walk.mp4 --out results/walk[/]

    [dim]# with a shorter video, repeated[/]
    [cyan]roletrust figures --frames walk.mp4 --loop --out results/walk[/]

    [dim]# for fewer rounds: 40 rounds need 20 s of video, or 40 images[/]
    [cyan]roletrust play paper-3x3-hog --set frames=walk.mp4 --set max_cycles=40[/]

    [dim]# without a camera, in a second[/]
    [cyan]roletrust figures --service synthetic --seed 7[/]
    """
    from roletrust_experiments.plots.paper import write_paper

    scenario = make_scenario("paper-3x3-hog" if service == "hog" else "paper-3x3")
    game = Game(scenario.change(frames=frames, playback="loop" if loop else "once"))
    prepare_folder(out)
    played, rounds = papers(game.scenario.period_s), []
    probabilities: list[float] = []  # of a person, in each round of one figure after the other

    def watch(state: State) -> None:
        probabilities.append(float(state.service.mean()))

    with progress_bar() as progress:
        for paper in played:
            joint_policy = JointPolicy(game, paper.policies)
            label = f"Figure {paper.number}"
            rounds.append(track_curves(joint_policy, seed, progress, label, on_round=watch))
    checked = [
        claim
        for paper, curves in zip(played, rounds, strict=True)
        for claim in paper.check(curves, game.scenario, paper.attack)
    ]
    seen: dict[str, Any] | None = None
    if frames is not None:
        calm = claims.calm_before(rounds[0].time_s, game.scenario, ON_OFF)
        probability = float(np.mean(probabilities[: len(calm)], where=calm))
        # Repeated frames have a length; the paper's levels apply if the person is clearly visible.
        visible = claims.in_clear_view(checked)
        seen = {
            "loop_length_s": loop_length_s(game),
            "probability": probability,
            "in_clear_view": visible,
        }
        checked = claims.for_given_frames(checked)
    written: list[str] = []
    note = loop_note(game)
    for paper, curves in zip(played, rounds, strict=True):
        written += write_paper(
            out, f"figure{paper.number}", paper, {"": curves}, game.scenario, note
        )
    written.append("results.json")
    results = {
        "command": "roletrust figures",
        "service": game.scenario.service,
        **provenance(game, seed),
        "attackers": {
            f"figure {paper.number}": describe_policies(paper.policies) for paper in played
        },
        "time": "the state after round r, counted from 0, stands at (r + 1) * period_s",
        **({"footage": seen} if seen else {}),
        "claims": [claim._asdict() for claim in checked],
        "files": written,
    }
    write_json(out / "results.json", results)
    if seen is None or seen["in_clear_view"]:
        seen_through = "OpenCV's HOG people detector" if service == "hog" else "a synthetic service"
        console.print(
            claims_table(f"Su and Saint-Jore (2023), seen through {seen_through}", checked)
        )
        calm_s = claims.spans(
            rounds[0].time_s, claims.calm_before(rounds[0].time_s, game.scenario, ON_OFF)
        )
        steady_s = claims.spans(
            rounds[1].time_s, claims.steady_under(rounds[1].time_s, game.scenario, BAD_MOUTHING)
        )
        after = f"{claims.SETTLE_S:g} s after any other event"
        console.print(f"[dim]calm: before the attack, {after} (Figure 3: {calm_s})[/]")
        console.print(
            f"[dim]steady: mean over the rounds of the attack, {after} (Figure 4: {steady_s})[/]"
        )
        console.print(
            "[dim]least dip: of the three ToP, the smallest fall while the target moves fast[/]"
        )
        if any(claim.ok is None for claim in checked):
            console.print(
                "[dim]n/a: the bound holds for the rendered scene; in these frames the detector "
                "still recognises the "
                "person when the picture is blurred[/]"
            )
    else:
        who = (
            "saw nobody in these frames"
            if seen["probability"] < 0.5
            else "did not see a person in every frame"
        )
        tell(
            f"OpenCV's people detector {who}: the mean probability of a person was "
            f"{seen['probability']:.2f} before "
            "the attack. The paper's levels assume a person in clear view, so they do not apply."
        )
    if note:
        tell(note, "dim")
    tell(f"Written to {out}: {', '.join(written)}")


def claims_table(title: str, checked: Sequence[claims.Claim]) -> Table:
    """Return the table of the paper's claims: the claim, the criterion and the measured value."""
    table = plain_table(title)
    for heading in ("fig", "what", "the paper", "needed", "measured", ""):
        table.add_column(
            heading, justify="right" if heading == "measured" else "left", overflow="fold"
        )
    for claim, following in zip(checked, [*checked[1:], None], strict=True):
        verdict = {True: "[green]ok[/]", False: "[bold red]not ok[/]", None: "[dim]n/a[/]"}[
            claim.ok
        ]
        ends = following is not None and following.figure != claim.figure
        table.add_row(
            str(claim.figure),
            claim.what,
            claim.paper,
            claim.needed,
            claim.measured,
            verdict,
            end_section=ends,
        )
    return table
