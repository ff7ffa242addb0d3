"""`roletrust rate`: which agents to trust, from a log of ratings."""

from pathlib import Path
from typing import Annotated

import typer

from roletrust_env.errors import counted
from roletrust_env.logs.explain import find_agent
from roletrust_env.logs.rate import MODEL, ROLES
from roletrust_env.logs.rate import rate as rate_log
from roletrust_env.logs.suspects import find_suspects
from roletrust_env.storage.files import prepare_folder, write_csv
from roletrust_experiments.commands.console import console, progress_bar, stage, stages, tell
from roletrust_experiments.commands.log_options import READING, Scale, log_arguments
from roletrust_experiments.commands.options import NAMED, OWN, Out, Seed, keyword_option
from roletrust_experiments.commands.rate_tables import (
    calibration_table,
    explanation_table,
    ranking_table,
    suspects_table,
)

_REASON = (
    "which had the highest correlation with the next ratings of the real log of docs/real.md; the "
    "paper's is --model role-trust"
)


_SETTINGS = {**READING, "trusted": "raters that are trusted beforehand, by models with seeds"}


def rate(
    ratings: Annotated[Path, typer.Argument(help="File of ratings.")],
    scale: Scale = (0.0, 1.0),
    every: Annotated[
        float | None, typer.Option(help="Length of a round in seconds; else all is one round.")
    ] = None,
    settings: Annotated[list[str] | None, keyword_option("--set", _SETTINGS)] = None,
    model: Annotated[str, typer.Option(metavar=NAMED, help=f"Trust model. {OWN}")] = MODEL,
    explain: Annotated[
        str | None, typer.Option(metavar="AGENT", help="Show what makes the trust in an agent.")
    ] = None,
    suspects: Annotated[
        bool, typer.Option("--suspects", help="Look for raters that act together.")
    ] = False,
    seed: Seed = 0,
    out: Out = Path("results/rate"),
) -> None:
    """Compute [bold]the trust of raters and ratees from a log of ratings[/], a file that you bring.

    It is CSV, JSON, Parquet (also a folder), Feather, SQLite or xlsx; a text may be packed (.gz,
    .xz, .zip). Columns with usual names are found; otherwise --set names them, such as --set
    rater=buyer, and says more about the file, such as --set header=false.

    Ratings count round by round, by time (--every), or all in one round. Several ratings of one
    agent by another in a round count as one, their mean. Rows may be in any order of time.

    Written: [green]ratees.csv raters.csv[/], with trust and evidence: the number of ratings, of
    other agents in them, and of effectively independent ones, the last rating, the window of the
    log, model and version. With --out trust.parquet both roles are one table. Ratees are ranked by
    trust; or by trust that is drawn to its mean where raters are few, if that forecast later
    ratings better at all later cuts of the log's own past. An interval is that of the mean of later
    ratings; the output says how many of these it covered in the past.

    --explain shows the most important raters of an agent, and its trust without the ratings of
    each; of a rater, its ratings that agree and differ most with the trust in those that it rates,
    and its trust without each. --suspects shows groups of raters that rate the same ratees alike
    far beyond chance: [green]suspects.csv[/].

    [bold]Examples[/]

    [dim]# ratings from 1 to 5[/]
    [cyan]roletrust rate ratings.csv --scale 1 5[/]

    [dim]# members rate members, with rounds of 30 days[/]
    [cyan]roletrust rate log.csv.gz --set same_agents=true --scale -10 10 --every 2592000[/]
    """
    single = out.suffix.lower() == ".parquet"
    folder = out.parent if single else out
    tables = [out] if single else [out / f"{role}s.csv" for role in ROLES]
    targets = [path.resolve() for path in (*tables, folder / "suspects.csv")]
    if any(ratings.resolve() in {path, *path.parents} for path in targets):
        raise ValueError(f"--out {out} would write to the log {ratings}")
    if folders := [path for path in tables if path.is_dir()]:
        raise ValueError(f"{folders[0]} is a folder; a table needs another name")
    arguments = log_arguments(settings, scale, "trusted")
    prepare_folder(folder)
    with progress_bar(counted=False) as progress:
        rated = rate_log(
            ratings,
            **arguments,
            every=every,
            model=model,
            seed=seed,
            advance=stages(progress),
        )
        for note in rated.notes:
            tell(note)
        explanations = []
        if explain is not None and rated.log is not None:
            for role in find_agent(rated.log, explain):
                if role == "ratee" or rated.stream.model.rates_raters:
                    explanations.append(rated.explain(explain, role, stages(progress)))
        stage(progress, "Writing")
        written = rated.write(out)
        for role in ROLES:
            if role == "rater" and not rated.stream.model.rates_raters:
                tell(f"{model} does not compute trust in raters.")
            else:
                console.print(ranking_table(rated.table(role), role))
        if calibration := rated.calibration:
            console.print(calibration_table(calibration))
            by = "trust, drawn to its mean where raters are few" if calibration.weight else "trust"
            tell(
                f"Ratees are ranked by {by}. Spearman's correlation with later means in the past: "
                f"{calibration.trust_forecast:.3f} of trust, {calibration.estimate_forecast:.3f} "
                "of trust that is drawn to its mean."
            )
        else:
            tell("Ratees are ranked by trust: the log has too few later ratings for intervals.")
        for explanation in explanations:
            console.print(explanation_table(explanation, scale))
        if suspects and rated.log is not None:
            advance = stage(progress, "Looking for suspects")
            found_suspects = find_suspects(rated.log, seed=seed, advance=advance)
            console.print(suspects_table(found_suspects, rated.log))
            rows = [
                (n, rated.log.rater_names[at], group.apart, group.p)
                for n, group in enumerate(found_suspects.groups, 1)
                for at in group.raters
            ]
            write_csv(folder / "suspects.csv", ("group", "rater", "apart", "p"), rows)
            written.append(folder / "suspects.csv")
    tell(f"Model {model}{f', {_REASON}' if model == MODEL else ''}.")
    tell(
        f"{counted(rated.n_ratings, 'rating')} in {counted(rated.rounds, 'round')}. Written: "
        f"{', '.join(map(str, written))}"
    )
