"""`python -m studies.models`: every trust model under the same three attacks, on one page of figures."""

from pathlib import Path
from typing import Annotated, Any

import typer

from roletrust_env import Game, JointPolicy, make_scenario
from roletrust_env.evaluation.resources import check_memory
from roletrust_env.evaluation.specs import parse_attacks, parse_trust_model
from roletrust_env.storage.files import prepare_folder, write_csv, write_json
from roletrust_env.storage.provenance import describe, describe_policies, provenance
from roletrust_env.trust import Traits, trust_models
from roletrust_experiments.commands.console import console, option, print_next, progress_bar
from roletrust_experiments.commands.options import ModelsOption, Out, Seed
from roletrust_experiments.playing.games import all_curve_bytes
from roletrust_experiments.plots.figure_files import write_figure
from studies.running import run

SCENARIO, ROUNDS = "crowd-10x10", 120
"""Scenario of the comparison, and its number of rounds."""

_WINDOW = "start=30,stop=90"
ATTACKS = {
    "one provider is on-off": [f"sp_0=on-off:period=20,{_WINDOW}"],
    "4 of 10 raters bad-mouth": [f"sr_[0-3]=bad-mouthing:level=0,{_WINDOW}"],
    "a ring: 4 raters, 2 providers": [f"sr_[0-3]=collusion:{_WINDOW}", f"sp_[01]=collusion:{_WINDOW}"],
}
"""Attacks as `--attack` takes them, by their titles on the page."""

_HEADER = ("trust_model", "attack", "trust", "whose", "time_s", "mean")


def models(
    model: ModelsOption = None,
    games: Annotated[int, typer.Option(min=1, help="Number of games whose mean is drawn.")] = 8,
    seed: Seed = 0,
    out: Out = Path("results/models"),
) -> None:
    """Draw [bold]every trust model under the same three attacks[/], in one row each, with the same random numbers.

    Ten raters rate ten providers for a minute. The attacks last from 15 s to 45 s: a provider that alternates between
    bad and good service every 5 s; four raters that rate everybody 0; and a ring of four raters and two providers that
    serves badly, praises its own members and rates all others 0.

    Written: [green]models.png models.csv results.json[/].

    [bold]Examples[/]

    [dim]# the page in docs/[/]
    [cyan]python -m studies.models[/]

    [dim]# one model with two settings of its memory[/]
    [cyan]python -m studies.models --model beta --model beta:keep=0.99 --out results/beta[/]
    """
    from studies.plots.models import Panel, models_figure, play_panel

    rules = make_scenario(SCENARIO).change(max_cycles=ROUNDS)
    attacks = {name: parse_attacks(texts, rules) for name, texts in ATTACKS.items()}
    names = list(dict.fromkeys(model or trust_models()))
    played = {name: Game(rules, parse_trust_model(name, rules)) for name in names}
    one, *_ = played.values()
    check_memory("--games", games, all_curve_bytes([JointPolicy(one, {})], {}))
    prepare_folder(out)
    panels: dict[str, dict[str, Panel]] = {name: {} for name in names}
    with progress_bar() as progress:
        pages = progress.add_task("Trust models under attacks", total=len(names) * len(attacks))
        for name, game in played.items():
            for attack, attackers in attacks.items():
                label = f"{name}, {attack}"
                panels[name][attack] = play_panel(JointPolicy(game, attackers), seed, progress, label, games=games)
                progress.advance(pages)
    families = {name: Traits.of(game.model).family for name, game in played.items()}
    note = f"shaded: during the attack; means over agents and {games} game{'s' * (games > 1)} of {rules.name}"
    write_figure(out / "models.png", models_figure(panels, families, note))
    write_csv(
        out / "models.csv",
        _HEADER,
        [
            (name, attack, *line, *point)
            for name, by_attack in panels.items()
            for attack, panel in by_attack.items()
            for line, values in panel.lines.items()
            for point in zip(panel.time_s.tolist(), values.tolist(), strict=True)
        ],
    )
    results: dict[str, Any] = {
        "command": "python -m studies.models",
        "games": games,
        **{key: value for key, value in provenance(one, seed).items() if key != "trust_model"},
        "attackers": {attack: describe_policies(attackers) for attack, attackers in attacks.items()},
        "trust_models": {name: describe(game.model) for name, game in played.items()},
    }
    write_json(out / "results.json", results)
    console.print(f"Written to {out}: models.png, models.csv, results.json", soft_wrap=True)
    print_next("benchmark", option("--model", model))


if __name__ == "__main__":
    run(models)
