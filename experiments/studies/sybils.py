"""What Sybils gain where members rate members: trust for one attacker, by its Sybils and by the
honest members it wins.

The attacker's identities vouch for one another in four ways
(`studies.sybil_graphs`), in a synthetic community or at the end of a log of real
ratings (`--log`). Minutes of a core.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
from matplotlib.figure import Figure

from roletrust_env.evaluation.specs import parse_named
from roletrust_env.logs import read
from roletrust_env.logs.log import Log
from roletrust_env.metrics.confidence import Estimate
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust.model import registry
from roletrust_env.trust.run import make_run
from roletrust_experiments.plots.charts import Panel, Series, panels_figure
from studies.study import Recipe, Run, Study, mean_of, with_ends
from studies.sybil_graphs import SybilGraph, Topology

EIGENTRUST = "personalized-pagerank:alpha=0.5"
"""EigenTrust with its pre-trusted peers, the seeds."""
MODELS = (
    "eigentrust",
    "leave-one-out",
    EIGENTRUST,
    "personalized-pagerank",
    "merit-rank",
    "sybil-rank",
)
PERSONAL = "first-hand"
"""Model in which the seeds judge by their own experience; too large for a log of thousands of
members."""
TOPOLOGIES: tuple[Topology, ...] = get_args(Topology)
SYBILS, BRIDGES = (0, 1, 3, 10, 30, 100), (0, 1, 3, 10, 30)
USUAL = 30, 3
"""Number of Sybils where bridge edges vary, and the other way round."""
CASES = sorted({*((n, USUAL[1]) for n in SYBILS), *((USUAL[0], k) for k in BRIDGES)})


class Options(NamedTuple):
    """The community and the numbers of runs.

    Attributes:
        log: Log of real ratings in which members rate members; a synthetic community if left out.
        low: Worst rating of the log.
        high: Best rating of the log.
        members: Number of members of the synthetic community.
        runs: Number of runs, each with another community, or with other honest members that are
            won.
        seeds: Number of seeds: the first members.
    """

    log: str = ""
    low: float = -10.0
    high: float = 10.0
    members: int = 300
    runs: int = 30
    seeds: int = 5


FILES = ("gains.md", "gains.png", "gains.csv")
RECIPES = {
    "sybils": Recipe(Options(), {name: f"sybils/{name}" for name in FILES}),
    "sybils-log": Recipe(
        Options(log="logs/bitcoin-otc/otc_network.csv.gz", runs=10),
        {name: f"sybils/log/{name}" for name in FILES},
    ),
}

GAINS = ("share", "rank")
"""Share of the trust of all but the seeds that the attacker's identities have, and share of the
honest members that are no seeds and have less trust than its target."""

Found = Mapping[str, Mapping[str, Estimate]]
"""Gains by model, topology, number of Sybils and of bridge edges."""


def main(study: Study[Options]) -> None:
    """Play all cases, and write the page."""
    options = study.options
    jobs = {str(k): (options, study.seed, k) for k in range(options.runs)}
    runs = list(study.play(measured, jobs, {"seed": study.seed, **options._asdict()}).values())
    gains_by_key = {
        key: {name: mean_of([run[key][name] for run in runs]) for name in GAINS} for key in runs[0]
    }
    rows = [
        [*key.split(), *(x for name in GAINS for x in gain[name].interval)]
        for key, gain in gains_by_key.items()
    ]
    study.csv("gains.csv", ["model", "topology", "sybils", "bridges", *with_ends(GAINS)], rows)
    study.figure(
        "gains.png",
        sybils_figure(
            gains_by_key, f"{len(runs)} runs, 95% intervals; the worst topology for each"
        ),
    )
    made = f"{len(runs)} runs, made by `{study.command}`."
    study.page("gains.md", sentence(gains_by_key), table(gains_by_key), made)


def community(members: int, rng: np.random.Generator) -> Log:
    """Return the ratings of a synthetic community: members join one after the other and trade with
    six others.

    They choose these by how many partners those have. A partner returns the rating with probability
    0.8. A tenth are cheats of quality 0.1, and the quality of others is uniform from 0.7 to 1.
    Ratings have a noise of 0.1.
    """
    quality = np.where(rng.random(members) < 0.1, 0.1, rng.uniform(0.7, 1, members))
    partners, pairs = np.ones(members), list[tuple[int, int]]()
    for newcomer in range(1, members):
        chances = partners[:newcomer] / partners[:newcomer].sum()
        for other in rng.choice(newcomer, min(newcomer, 6), replace=False, p=chances).tolist():
            partners[[newcomer, other]] += 1
            pairs += [(newcomer, other), (other, newcomer)][: 1 + (rng.random() < 0.8)]
    raters, ratees = np.array(pairs).T
    values = np.clip(quality[ratees] + rng.normal(0, 0.1, len(pairs)), 0, 1)
    names = [str(k) for k in range(members)]
    return Log(raters, ratees, values, None, names, names)


def measured(options: Options, seed: int, run: int) -> Run:
    """Return the gains of all cases in one run. The first members are seeds; any others may be
    won.
    """
    rng = np.random.default_rng([seed, run])
    if options.log:
        log = read(Path(options.log), scale=(options.low, options.high), same_agents=True)
    else:
        log = community(options.members, rng)
    members = (options.seeds + rng.permutation(len(log.rater_names) - options.seeds)).tolist()
    cases: list[tuple[int, int | str, list[int], int | None]] = [
        (n, k, members[:k], None) for n, k in CASES
    ]
    gains_by_key = {}
    for model in MODELS if options.log else (*MODELS, PERSONAL):
        for topology in TOPOLOGIES:
            for sybils, bridges, helpers, bought in [*cases, (USUAL[0], "bought", [], members[0])]:
                attack = SybilGraph(topology, sybils, returned=model == "sybil-rank")
                gains_by_key[f"{model} {topology} {sybils} {bridges}"] = gains(
                    model, attack, log, options.seeds, helpers, bought
                )
    return gains_by_key


def gains(
    model: str,
    attack: SybilGraph,
    log: Log,
    seeds: int,
    helpers: Sequence[int] = (),
    bought: int | None = None,
) -> dict[str, float]:
    """Return what an attack gains, see `GAINS`; under a personal model by the mean trust of the
    seeds as judges.
    """
    attacked, own = attack.added_to(log, helpers, bought), attack.identities(log, bought)
    made: Any = parse_named(registry, model, {"seeds": tuple(range(seeds))})
    run: Any = make_run(made, attacked.shape, one_role=False)
    run.play(attacked.raters, attacked.ratees, attacked.values)
    judges = hasattr(made, "judge_trust")
    trust = made.judge_trust(run.state)[:seeds].mean(axis=0) if judges else run.provider_trust
    honest = np.delete(trust, [*range(seeds), *own])
    all_trust = honest.sum() + trust[own].sum()
    below = np.mean(honest < trust[own[0]]) + np.mean(honest == trust[own[0]]) / 2
    return {
        "share": float(trust[own].sum() / all_trust) if all_trust else 0.0,
        "rank": float(below),
    }


def models_of(gains_by_key: Found) -> list[str]:
    """Return the models that were measured, in order."""
    return list(dict.fromkeys(key.split()[0] for key in gains_by_key))


def worst(
    gains_by_key: Found, model: str, sybils: int, bridges: int | str, gain: str
) -> tuple[str, Estimate]:
    """Return the topology with the highest mean gain, and this gain."""
    cases = {
        topology: gains_by_key[f"{model} {topology} {sybils} {bridges}"][gain]
        for topology in TOPOLOGIES
    }
    return max(cases.items(), key=lambda case: case[1].mean)


def sybils_figure(gains_by_key: Found, note: str) -> Figure:
    """Return both gains against the number of Sybils and against the number of bridge edges."""
    panels = []
    for gain, what in zip(GAINS, ("share of all trust", "members below the target"), strict=True):
        for along, at in (("Sybils", SYBILS), ("bridge edges", BRIDGES)):
            series = []
            for model in models_of(gains_by_key):
                pairs = [(n, USUAL[1]) if along == "Sybils" else (USUAL[0], n) for n in at]
                series.append(
                    Series(
                        model,
                        at,
                        [worst(gains_by_key, model, *pair, gain)[1].interval for pair in pairs],
                    )
                )
            title = f"{USUAL[1]} bridge edges" if along == "Sybils" else f"{USUAL[0]} Sybils"
            panels.append(Panel(title, along, what, series, "symlog"))
    return panels_figure(
        "What does an attacker gain by Sybils, and by honest members that it wins?", panels, note
    )


def percent(share: Estimate) -> str:
    """Return a share and half its interval in percent."""
    return f"{100 * share.mean:.2f}% ± {100 * share.half:.2f}"


def table(gains_by_key: Found) -> str:
    """Return the gains of each topology at the usual numbers, and without Sybils."""
    rows = []
    for model in models_of(gains_by_key):
        cells = [gains_by_key[f"{model} line 0 {USUAL[1]}"]]
        cells += [
            gains_by_key[f"{model} {topology} {USUAL[0]} {USUAL[1]}"] for topology in TOPOLOGIES
        ]
        for gain, label in zip(
            GAINS, (f"`{model}`: share", "members below the target"), strict=True
        ):
            rows.append([label, *(percent(cell[gain]) for cell in cells)])
    return markdown_table(["", "no Sybils", *TOPOLOGIES], rows, 1)


def sentence(gains_by_key: Found) -> str:
    """Return what the most Sybils gain with the usual bridge edges, and the usual Sybils without
    any.
    """
    models = models_of(gains_by_key)
    many = {model: worst(gains_by_key, model, SYBILS[-1], USUAL[1], "share") for model in models}
    none = {model: worst(gains_by_key, model, USUAL[0], 0, "share")[1].mean for model in models}
    sold = {model: worst(gains_by_key, model, USUAL[0], "bought", "share")[1] for model in models}
    order = sorted(many, key=lambda model: many[model][1].mean)
    shares = ", ".join(
        f"{percent(many[model][1])} under `{model}` ({many[model][0]})" for model in order
    )
    accounts = ", ".join(f"{percent(sold[model])} under `{model}`" for model in order)
    free = ", ".join(f"{none[model]:.1%} under `{model}`" for model in order if none[model] > 0)
    rest = ", and nothing under the others" if free else ""
    return (
        f"With {SYBILS[-1]} Sybils and {USUAL[1]} bridge edges an attacker has this share of all "
        "trust, in the worst "
        f"topology: {shares}. Without a bridge edge, {USUAL[0]} Sybils have "
        f"{free or 'nothing'}{rest}. Behind the "
        f"bought account of a member that is drawn, they and it have {accounts}."
    )
