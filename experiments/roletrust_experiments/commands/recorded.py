"""`roletrust figures --recording`: figures of a recorded live team."""

import statistics
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

from roletrust_env import make_scenario
from roletrust_env.evaluation.curves import Curves
from roletrust_env.live.team import PublishedTrust
from roletrust_env.live.validation import MANAGER, is_genuine
from roletrust_env.storage.files import prepare_folder, write_csv, write_json
from roletrust_experiments.commands.console import claims_table, console
from roletrust_experiments.commands.live.options import require_live
from roletrust_experiments.paper.figures import Attack, paper_of
from roletrust_experiments.paper.live_curves import curves_from_rounds
from roletrust_experiments.plots.figure_files import write_figure


def draw_recording(recording: Path, attack: Attack | None, keys: Path | None, out: Path) -> None:
    """Draw and write the published trust of a team, or for the paper's team and attack its figure and claims.

    Args:
        recording: Folder of the recording.
        attack: The paper's attack that was played; None for any other team.
        keys: Folder with the manager's public key; None draws unsigned trust, too.
        out: Folder for the results.

    Raises:
        ValueError: The folder is no recording, has fewer than two rounds, or has another team than the paper's.
    """
    require_live()
    from roletrust_env.live.wire import messages
    from roletrust_env.live.wire.keys import PublicKeys
    from roletrust_env.live.wire.recording import read_recording

    rounds, keyring = [], None if keys is None else PublicKeys(keys, [MANAGER])
    for one in read_recording(recording):
        if one.kind == messages.TRUST:
            with suppress(ValueError):  # an unreadable message is not from the manager
                trust, envelope = messages.read_trust(one.raw)
                if is_genuine(envelope, keyring):
                    rounds.append(trust)
    gaps = [(b.stamp - a.stamp) / (b.round - a.round) for a, b in pairwise(rounds) if b.round > a.round]
    period = round(statistics.median(gaps)) if gaps else 0
    if period <= 0 or not (rounds[-1].tor and rounds[-1].top):
        raise ValueError(
            f"{recording} holds {len(rounds)} rounds of trust; it must hold two consecutive ones, with agents"
        )
    start = rounds[0].stamp - rounds[0].round * period
    prepare_folder(out)
    if attack is None:
        written = _any_team(recording, rounds, curves_from_rounds(rounds, start, period, period / 1e9), out)
    else:
        written = _papers(recording, rounds, attack, start, period, out)
    console.print(f"Written to {out}: {', '.join(written)}", soft_wrap=True)


def _any_team(recording: Path, rounds: list[PublishedTrust], curves: Curves, out: Path) -> list[str]:
    """Write the trust of all agents against time."""
    from roletrust_experiments.plots.curves import Panel, trust_figure

    last = rounds[-1]
    panels = [
        Panel("trust of raters, ToR", tuple(last.tor), curves.tor),
        Panel("trust of providers, ToP", tuple(last.top), curves.top),
    ]
    header = ["time_s", *(f"ToR {name}" for name in last.tor), *(f"ToP {name}" for name in last.top)]
    rows = zip(curves.time_s.tolist(), *curves.trust[..., 0].T.tolist(), strict=True)
    write_csv(out / "figure.csv", header, rows)
    title = f"{recording.name}: {len(last.tor)} raters, {len(last.top)} providers, {len(rounds)} rounds"
    write_figure(out / "figure.png", trust_figure(title, panels, curves.time_s, float(curves.time_s[-1])))
    return ["figure.csv", "figure.png"]


def _papers(
    recording: Path, rounds: list[PublishedTrust], attack: Attack, start: int, period: int, out: Path
) -> list[str]:
    """Write the paper's figure, with the paper's clock at any speed of the team."""
    from roletrust_experiments.plots.paper import write_paper

    scenario = make_scenario("paper-3x3-hog")
    paper, size = paper_of(attack, scenario.period_s), (len(rounds[-1].tor), len(rounds[-1].top))
    if size != (3, 3):
        raise ValueError(
            f"--attack {attack} needs the paper's three raters and three providers; {recording} has {size[0]} and "
            f"{size[1]}; leave --attack out to draw its curves"
        )
    curves = curves_from_rounds(rounds, start, period, scenario.period_s)
    if curves.time_s[0] > 5 or curves.time_s[-1] <= paper.attack.start_s + 20:
        raise ValueError(
            f"{recording} is from {curves.time_s[0]:g} to {curves.time_s[-1]:g} s of the paper's clock, too short for "
            f"--attack {attack}; leave --attack out to draw its curves"
        )
    found = paper.check(curves, scenario, paper.attack)
    note = f"recorded in {recording.name}: {len(rounds)} rounds"
    written = write_paper(out, f"figure{paper.number}", paper, {"": curves}, scenario, note)
    results = {"command": "roletrust figures", "recording": str(recording), "attack": attack, "period_s": period / 1e9}
    write_json(out / "results.json", {**results, "claims": [claim._asdict() for claim in found]})
    console.print(claims_table("Su and Saint-Jore (2023), from a recording", found))
    return [*written, "results.json"]
