"""Trust models that are trained against a population of attackers, and attackers against the models, in turn.

The payoffs of all known models against all known attackers are a matrix, whose equilibrium is solved. Then an attacker
is trained in each condition against the models' mixture, and each learner against the attackers' mixture, and all join
the matrix. What the best responses win in other games is a lower bound of the NashConv.

At the end, the learned models stand beside the fixed ones: under the attackers that were found, one that is trained
against each model alone with the same budget, and attackers and worlds that no training has met. The number is skill: 1
for the best choice of a consumer, 0 for a blind one. With several runs, all is trained again with other seeds, and
intervals cover games and trainings.

The best model of each learner is written into the folder of its seed, as the text that `--model` takes or as a network.
Half an hour on one core for three runs; each step is kept.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from roletrust_agents.learned.saved import digest
from roletrust_agents.learned.saved_defence import DefenceCard, save_defence, weights_bytes
from roletrust_agents.training.defence import Climb
from roletrust_agents.training.defence_learners import NetworkLearner, learner_of
from roletrust_agents.training.runs import write_bytes
from roletrust_env import __version__
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.files import write_text
from roletrust_env.storage.markdown import markdown_table
from studies.charts import Panel, Series, panels_figure
from studies.defence.comparison import Comparison, Row, leads, rows
from studies.defence.double_oracle import Game, Setup
from studies.defence.fronts import Front
from studies.defence.progress import Iteration, iterations
from studies.defence.response import least_budget
from studies.study import Recipe, Study, with_ends


class Options(NamedTuple):
    """The game and its effort.

    Attributes:
        defence: Defences to train: the numbers of a trust model, by its name, or `network`.
        model: Specs of fixed trust models that the defence has at the beginning.
        beside: Specs of further trust models for the comparison at the end.
        suite: Suite with the conditions.
        front: Conditions to train in, as SCENARIO/TRACK/SHARE.
        world: Conditions that are kept for the comparison.
        iterations: Number of times that both sides respond.
        budget: Rounds x games of the training of an attacker in one condition.
        steps: Steps of the training of a defence.
        games: Games that choose, and as many others that measure.
        fresh: The same for the comparison, in fresh games.
        explored: Share of all known attackers alike in what a defence is trained against.
        runs: Number of runs, with the seed of the study and those after it.
    """

    defence: tuple[str, ...] = ("leave-one-out", "first-hand", "network")
    model: tuple[str, ...] = ("role-trust", "wary-role-trust", "leave-one-out", "iterative-filtering")
    beside: tuple[str, ...] = ("travos", "own-experience", "first-hand")
    suite: str = "standard"
    front: tuple[str, ...] = ("crowd/raters/0.4", "crowd/coalition/0.2", "market/raters/0.2", "market/coalition/0.2")
    world: tuple[str, ...] = ("diverse/raters/0.2", "diverse/coalition/0.1", "large/raters/0.2", "large/coalition/0.1")
    iterations: int = 3
    budget: int = 60_000
    steps: int = 20
    games: int = 24
    fresh: int = 24
    explored: float = 0.25
    runs: int = 3


_TABLES = ("defence.md", "defence.png", "iterations.csv", "comparison.csv", "leads.csv")
_SAVED = ("leave-one-out.txt", "first-hand.txt", "network.json", "network.safetensors")
FILES = {name: f"defence/{name}" for name in _TABLES} | {f"seed-0/{name}": f"defence/{name}" for name in _SAVED}
RECIPES = {"defence": Recipe(Options(), FILES)}

_LONGEST = 300  # length of the longest spec of a model that a text shows, in letters
_SHOWN = 0.005  # least probability of a model in the text
_FEW = 12  # games below which the worst attack is chosen by chance

_WINS = {
    "value": "value",
    "attack": "attackers win",
    "defence": "defence wins",
    "nash_conv": "NashConv, at least",
    "worst": "mixture at worst",
    "single": "best model alone",
}
_WINS_LEGEND = (
    "Skill: 1 for the best choice of a consumer, 0 for a blind one; means ± half of the 95% interval. "
    "Value: of both mixtures against each other. Attackers and defence win: by their best responses; NashConv: both "
    "together. Mixture at worst, best model alone: under the best responses."
)
_SKILLS = {"clean": "clean", "worst": "worst found", "strangers": "strangers", "worlds": "other worlds"}
_SKILLS_LEGEND = (
    "Clean: nobody attacks. Worst found: under the worst attacker of the game, or one that is trained against this "
    "model alone. Strangers: under the worst attacker that no training has met. Other worlds: the same in other "
    "conditions."
)
_LEADS_LEGEND = "Skill of the learned model less that of the one beside it, in the same games."


def main(arguments: Sequence[str] | None = None) -> None:
    """Play all games and comparisons, and write what they come to."""
    with Study(__name__, RECIPES, arguments) as study:
        asked = study.options
        met, others = (
            {(one := Front.of(asked.suite, n)).name: one for n in names} for names in (asked.front, asked.world)
        )
        if both := sorted({*met} & {*others}):
            raise ValueError(f"{both[0]} is a condition of the training; --world is for others")
        fronts, worlds = list(met.values()), list(others.values())
        for name in asked.defence:
            learner_of(name)
        for one in (*fronts, *worlds):
            one.condition.check([*asked.model, *asked.beside])
        if asked.budget < (least := max(least_budget(one.length) for one in fronts)):
            raise ValueError(f"--budget is {asked.budget} rounds; the training of an attacker needs {least} or more")
        games = [_game(study, fronts, worlds, study.seed + k) for k in range(asked.runs)]
        warnings = _caveats([*fronts, *worlds], min(asked.games, asked.fresh))
        comparisons = []
        for game in games:
            with study.progress(game.stages) as advance:
                for words in game.play():
                    advance(words)
            comparison = Comparison(game, asked.beside, worlds, asked.fresh)
            with study.progress(comparison.stages) as advance:
                for words in comparison.play():
                    advance(words)
            comparisons.append(comparison)
            _save(study, game, comparison.learned)
        _report(study, games, iterations(games), rows(comparisons), leads(comparisons), warnings)


def _game(study: Study[Options], fronts: Sequence[Front], worlds: Sequence[Front], seed: int) -> Game:
    """Return a game with the steps of it that are kept in the folder of its seed."""
    asked = study.options
    climb = Climb(steps=asked.steps)
    setup = Setup(asked.defence, asked.model, asked.iterations, asked.budget, climb, asked.games, asked.explored, seed)
    conditions = {one.name: one.condition.describe() for one in (*fronts, *worlds)}
    settings = {**setup.plain(), "fresh": asked.fresh, "conditions": conditions}
    runs = study.runs(settings, study.out / f"seed-{seed}")
    return Game(fronts, setup, runs, runs.keep)


def _caveats(fronts: Sequence[Front], games: int) -> list[str]:
    """Return what a reader of the numbers must know about these conditions and this number of games."""
    lines = [
        f"{one.name}: the suite {one.condition.suite.name} knows no attackers there, so strangers are its scripts at "
        "their defaults."
        for one in fronts
        if not one.has_strangers
    ]
    if games < _FEW:
        lines.append(f"{games} games choose the worst attack, which is mostly chance; give {_FEW} or more.")
    return lines


def _save(study: Study[Options], game: Game, learned: Mapping[str, int]) -> None:
    """Write the best model of each learner: its spec, or the files of a network.

    Args:
        study: Study, whose folder has one for each seed.
        game: Game that is played to its end.
        learned: Iteration, from 0, of the best model of each learner.
    """
    setup = game.setup
    folder = study.out / f"seed-{setup.seed}"
    for name, k in learned.items():
        run = game.runs[f"defence|{k}|{name}"]
        if name != NetworkLearner.name:
            write_text(folder / f"{name.replace(':', '.')}.txt", run["spec"] + "\n")
            continue
        learner, vector = NetworkLearner(), np.array(run["vector"])
        weights = np.array(learner.weights(vector))
        card = DefenceCard(
            package_version=__version__,
            parameters=learner.parameters(vector),
            conditions=tuple(str(front.condition) for front in game.fronts),
            iteration=k + 1,
            seed=setup.seed,
            settings={"steps": setup.climb.steps, "budget": setup.budget, "explored": setup.explored},
            weights_sha256=digest(weights_bytes(weights)),
        )
        save_defence(weights, card, folder / name, write_bytes)


def _report(
    study: Study[Options],
    games: Sequence[Game],
    found: Sequence[Iteration],
    models: Sequence[Row],
    over: Mapping[str, Sequence[Row]],
    warnings: Sequence[str],
) -> None:
    """Write the tables, the figure and the page.

    Args:
        study: Study.
        games: Games with other seeds, played to their end.
        found: Numbers of each iteration.
        models: Models beside each other.
        over: Lead of each learned model over each fixed one.
        warnings: Lines of `_caveats`.
    """
    pairs = [(name, row) for name, others in over.items() for row in others]
    study.csv("iterations.csv", ["iteration", *with_ends(_WINS)], [[one.number, *_cells(one, _WINS)] for one in found])
    study.csv("comparison.csv", ["model", *with_ends(_SKILLS)], [[row.name, *_cells(row, _SKILLS)] for row in models])
    header = ["model", "beside", *with_ends(_SKILLS)]
    study.csv("leads.csv", header, [[name, row.name, *_cells(row, _SKILLS)] for name, row in pairs])
    fronts, runs = games[0].fronts, len(games)
    over_what = f"{runs} runs, 95% intervals over runs and games" if runs > 1 else "95% intervals over games"
    note = f"{len(fronts)} condition{'s' * (len(fronts) > 1)} of {fronts[0].condition.suite.name}, {over_what}"
    title = "What do trust models and attackers reach when both are trained against each other?"
    study.figure("defence.png", panels_figure(title, _panels(found, models), note))
    skills = list(_SKILLS.values())
    won = [[str(one.number + 1), *_texts(one, _WINS)] for one in found]
    beside = [[f"`{name}`", f"`{row.name}`", *_texts(row, _SKILLS)] for name, row in pairs]
    study.page(
        "defence.md",
        markdown_table(["iteration", *_WINS.values()], won, 1),
        _WINS_LEGEND,
        markdown_table(["model", *skills], [[f"`{row.name}`", *_texts(row, _SKILLS)] for row in models], 1),
        _SKILLS_LEGEND,
        markdown_table(["model", "beside", *skills], beside, 2),
        _LEADS_LEGEND,
        *warnings,
        _mixture(games),
        f"{note}. Made by `{study.command}`.",
    )


def _panels(found: Sequence[Iteration], models: Sequence[Row]) -> list[Panel]:
    at, names = [one.number + 1 for one in found], [row.name for row in models]

    def lines(columns: Mapping[str, str]) -> list[Series]:
        return [Series(label, at, [getattr(one, name) for one in found]) for label, name in columns.items()]

    strangers = [
        Series(label, names, [getattr(row, kind) for row in models])
        for label, kind in {"in the same worlds": "strangers", "in other worlds": "worlds"}.items()
        if all(getattr(row, kind) for row in models)
    ]
    met = Series("met", names, [row.worst for row in models])
    wins = {"either side": "nash_conv", "attackers": "attack", "defence": "defence"}
    worst = {"mixture, attackers respond": "worst", "best model alone": "single"}
    return [
        Panel("what a best response wins", "iteration", "skill", lines(wins)),
        Panel("the defence", "iteration", "skill", lines(worst)),
        Panel("at the end: the worst attacker found", "", "skill", [met]),
        *([Panel("attackers that nobody has met", "", "skill", strangers)] if strangers else ()),
    ]


def _mixture(games: Sequence[Game]) -> str:
    """Return the mean equilibrium at the end in words, with the numbers of the learned models in that of one run."""
    last = games[0].setup.iterations
    weights = np.mean([game.solution(last).models for game in games], axis=0)
    parts = []
    for (name, spec), weight in zip(games[0].known(last).defences.items(), weights, strict=True):
        shown = name if len(games) > 1 or len(spec) > _LONGEST or spec == name else f"{name} (`{spec}`)"
        parts += [f"{shown}: {weight:.0%}"] if weight >= _SHOWN else []
    return f"The defence's mixture at the end: {'; '.join(parts)}."


def _cells(one: Iteration | Row, columns: Iterable[str]) -> list[float | None]:
    return [x for name in columns for x in getattr(one, name) or (None,) * 3]


def _texts(one: Iteration | Row, columns: Iterable[str]) -> list[str]:
    return [_text(getattr(one, name)) for name in columns]


def _text(value: Interval | None) -> str:
    return "" if value is None else f"{value.value + 0.0:.3f} ± {(value.high - value.low) / 2:.3f}"


if __name__ == "__main__":
    main()
