"""What listening is worth to consumers: the gain over the solo model by the share of liars, and by
the share of free riders that send no reports.

Plays the worlds of the suite `standard` under scripted attacks with default parameters. Takes about
20 minutes of a core.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from roletrust_env.benchmarking.pool import play_safely
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.metrics.confidence import Estimate
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.world.roster import Roster
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from studies.study import Recipe, Run, Study, mean_of, plus_minus, with_ends

SOLO = "own-experience"
"""Trust model that listens to nobody. Consumers choose the provider with the best mean of their own
services."""
MODELS = (SOLO, "first-hand", "block", "agreed-once", "beta", "role-trust")
RIDDEN = (SOLO, "first-hand", "block", "beta")
"""Trust models that are also played with free riders."""
LIARS = (0.0, 0.1, 0.2, 0.3, 0.45, 0.6)
"""Shares of raters that lie."""
SILENT = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Shares of honest raters that send no reports."""


class Options(NamedTuple):
    """Size of the study.

    Attributes:
        selection: Number of worlds in which the worst attack is chosen.
        measured: Number of worlds in which it is measured.
        games: Number of games in each measured world.
        selection_games: Number of games in each selection world.
    """

    selection: int = 12
    measured: int = 30
    games: int = 4
    selection_games: int = 2


FILES = ("listening.png", "liars.csv", "liars.md", "break_even.csv", "silent.csv", "silent.md")
RECIPES = {
    "listening": Recipe(Options(), {name: f"listening/{name}" for name in FILES}),
    "listening-long": Recipe(Options(games=16, selection_games=8)),
}

Runs = Mapping[str, Run]
"""Scores in each measured world, by trust model and setting, see `key_of`."""


def main(study: Study[Options]) -> None:
    """Play all trust models in all settings, and write the tables and the figure."""
    options = study.options
    jobs = {key_of(*pair): (options, study.seed, *pair) for pair in pairs()}
    runs = study.play(measured, jobs, {**options._asdict()})
    if lacking := [key for key in jobs if key not in runs]:
        raise ValueError(f"{len(lacking)} of {len(jobs)} runs failed, the first is {lacking[0]}")
    study.csv(
        "liars.csv",
        ["model", "share", *with_ends(("skill", "gain")), "attack"],
        [
            (
                *(model, share),
                *(x for part in (skill, gain) for x in part(runs, model, liars(share)).interval),
                runs[key_of(model, liars(share))]["attack"],
            )
            for model in MODELS
            for share in LIARS
        ],
    )
    study.csv(
        "break_even.csv",
        ["model", "share"],
        [(model, break_even(gains_of(runs, model), LIARS)) for model in MODELS[1:]],
    )
    study.csv(
        "silent.csv",
        ["model", "share", *with_ends(("skill", "gain", "silent_skill", "advantage"))],
        [
            (model, share, *(x for value in silent_row(runs, model, share) for x in value.interval))
            for model in RIDDEN
            for share in SILENT
        ],
    )
    note = f"{options.measured} worlds, 95% intervals over worlds"
    study.figure("listening.png", figure(runs, note))
    size = (
        f"{options.measured} measured worlds with {options.games} games each, ± half the 95% "
        f"interval over worlds. Made by `{study.command}`."
    )
    study.page("liars.md", liars_table(runs), size)
    study.page("silent.md", silent_table(runs), size)


def liars(share: float) -> str:
    """Return the name of the setting with a share of liars."""
    return f"raters-{round(100 * share)}" if share else "clean"


def silent(share: float) -> str:
    """Return the name of the setting with a share of free riders."""
    return f"silent-{round(100 * share)}" if share else "clean"


def key_of(model: str, setting: str) -> str:
    """Return the key of the run of a trust model in a setting."""
    return f"{model} {setting}"


def pairs() -> list[tuple[str, str]]:
    """Return the trust models with the settings in which they are played."""
    found = [(model, liars(share)) for model in MODELS for share in LIARS]
    found += [(model, silent(share)) for model in RIDDEN for share in SILENT]
    return list(dict.fromkeys(found))


@cache
def suite_of(options: Options, seed: int) -> Any:
    """Return the suite `standard` with the settings of this study."""
    standard: Any = load_suite("standard")
    settings: dict[str, dict[str, Any]] = {"clean": {}}
    for share in LIARS[1:]:
        settings[liars(share)] = {"roles": ["SR"], "share": share}
    for share in SILENT[1:]:
        settings[silent(share)] = {"silent": share}
    worlds = {"seed": seed, "selection": options.selection, "measured": options.measured}
    changes = {
        "models": MODELS,
        "own": (),
        "methods": ("scripts",),
        "replayed": (),
        "settings": {name: {**fields, "reports": "open"} for name, fields in settings.items()},
        "worlds": {**standard.worlds.model_dump(), **worlds},
        "games": options.games,
        "selection_games": options.selection_games,
    }
    return type(standard).model_validate({**standard.model_dump(), **changes})


def measured(options: Options, seed: int, model: str, setting: str) -> Run:
    """Return the scores under the worst attack on a trust model, in each measured world.

    `quiet` is the share of the consumers that send no reports.

    Raises:
        ValueError: An attack or the trust model fails.
    """
    suite = suite_of(options, seed)
    (cell,) = (cell for cell in suite.cells() if cell[:3] == (model, "common", setting))
    result = play_safely(suite, cell)
    if result.failed:
        raise ValueError(result.failed)
    row = next(row for row in result.rows if row.measured)
    quiet = []
    for number in range(options.measured):
        world = suite.world(cell, "measured", number).scenario
        quiet.append(len(suite.silent(cell, world)) / Roster.of(world).n_raters)
    scores = {name: list(row.measured[name]) for name in ("skill", "silent_skill")}
    return {"attack": row.attack, "quiet": quiet, **scores}


def skill(runs: Runs, model: str, setting: str) -> Estimate:
    """Return the mean skill of the honest consumers in the worst case."""
    return mean_of(runs[key_of(model, setting)]["skill"])


def gain(runs: Runs, model: str, setting: str) -> Estimate:
    """Return the mean of the skill less that of the solo model in the same world."""
    own, solo = (_skills(runs, name, setting) for name in (model, SOLO))
    return mean_of((own - solo).tolist())


def gains_of(runs: Runs, model: str) -> list[float]:
    """Return the mean gain at each share of liars."""
    return [gain(runs, model, liars(share)).mean for share in LIARS]


def break_even(gains: Sequence[float], shares: Sequence[float]) -> float:
    """Return the share at which the gain becomes negative, by linear interpolation.

    The share is NaN if the gain is never negative, and the first share if it always is.

    Example:
        >>> break_even([0.2, 0.1, -0.1], [0.0, 0.2, 0.4])
        0.3
    """
    for k, value in enumerate(gains):
        if value < 0:
            if k == 0:
                return shares[0]
            part = gains[k - 1] / (gains[k - 1] - value)
            return float(shares[k - 1] + part * (shares[k] - shares[k - 1]))
    return float("nan")


def silent_row(runs: Runs, model: str, share: float) -> tuple[Estimate, ...]:
    """Return the skill and the gain of all consumers, the skill of the silent ones, and their
    advantage: their skill less that of the consumers that report.
    """
    setting = silent(share)
    run = runs[key_of(model, setting)]
    everyone, quiet = np.array(run["skill"]), np.array(run["quiet"])
    alone = np.array(run["silent_skill"], float)
    # All consumers have the same yardsticks, so that the skill of all is a weighted mean.
    with np.errstate(invalid="ignore", divide="ignore"):
        reporting = np.where(quiet < 1, (everyone - quiet * alone) / (1 - quiet), np.nan)
    return (
        skill(runs, model, setting),
        gain(runs, model, setting),
        mean_of(alone.tolist()),
        mean_of((alone - reporting).tolist()),
    )


def figure(runs: Runs, note: str) -> Figure:
    """Return the gain against the share of liars and against the share of free riders."""
    lying = [
        Series(model, LIARS, [gain(runs, model, liars(share)).interval for share in LIARS])
        for model in MODELS[1:]
    ]
    riding = [
        Series(model, SILENT, [gain(runs, model, silent(share)).interval for share in SILENT])
        for model in RIDDEN[1:]
    ]
    panels = [
        Panel("Some raters lie", "share of raters that lie", "gain in skill", lying),
        Panel("All are honest", "share of raters that send no reports", "gain in skill", riding),
    ]
    title = "What does a consumer gain if it listens to others?"
    return panels_figure(title, panels, note)


def liars_table(runs: Runs) -> str:
    """Return the gain of each trust model by the share of liars, and the break-even share."""
    rows = [
        [
            f"`{model}`",
            *(plus_minus(gain(runs, model, liars(share))) for share in LIARS),
            _percent(break_even(gains_of(runs, model), LIARS)),
        ]
        for model in MODELS[1:]
    ]
    solo = [plus_minus(skill(runs, SOLO, liars(share))) for share in LIARS]
    rows.append([f"skill of `{SOLO}`", *solo, "-"])
    shares = [f"{share:.0%} lie" for share in LIARS]
    return markdown_table(["gain", *shares, "break-even share"], rows, 1)


def silent_table(runs: Runs) -> str:
    """Return the gain and the advantage of silence by the share of free riders."""
    rows = []
    for model in RIDDEN[1:]:
        values = [silent_row(runs, model, share) for share in SILENT]
        for name, index in (("gain", 1), ("skill of the silent", 2), ("their advantage", 3)):
            label = f"`{model}`: {name}" if name == "gain" else name
            rows.append([label, *(_or_dash(value[index]) for value in values)])
    return markdown_table(["", *(f"{share:.0%} silent" for share in SILENT)], rows, 1)


def _skills(runs: Runs, model: str, setting: str) -> np.ndarray[Any, Any]:
    return np.array(runs[key_of(model, setting)]["skill"], float)


def _percent(share: float) -> str:
    if np.isnan(share):
        return f"none up to {LIARS[-1]:.0%}"
    return f"{share:.0%}" if share else "0%, also without liars"


def _or_dash(value: Estimate) -> str:
    return "-" if np.isnan(value.mean) else plus_minus(value)
