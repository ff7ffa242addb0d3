"""Caveats of a leaderboard: where the suite does not suit a model, or its attacks were not strong
enough.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from roletrust_env.arrays import Array
from roletrust_env.benchmarking.conditions import FLAT
from roletrust_env.benchmarking.schema import reason
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.suite import PLANNER, WITHOUT_SEARCH, Suite
from roletrust_env.benchmarking.worst_case import AttackScores, Condition
from roletrust_env.evaluation.search import late_gain
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.game.game import Game
from roletrust_env.game.state import Actions
from roletrust_env.trust import Traits
from roletrust_env.trust.model_checks import needs_watching
from roletrust_env.trust.random_order import RandomOrder

_SAME = 1e-9
_ROUNDING = 1e-6  # of sums in another order
_GAMES, _ROUNDS = 4, 12
_POINTS = 4  # a course with fewer says nothing of its end


def caveats(
    suite: Suite,
    stored: Sequence[StoredCell],
    attacks: Sequence[AttackScores],
    models: Sequence[str],
) -> list[str]:
    """Return the limitations of the numbers, one line each.

    Args:
        suite: Suite of the run.
        stored: Cells of the run with their results.
        attacks: Scores of all attacks.
        models: Names of the models.
    """
    return [
        *_model_caveats(suite, attacks, models),
        *_search_caveats(attacks),
        *_progress_caveats(stored),
        *_start_caveats(attacks),
        *_idle_caveats(suite, stored),
        *_condition_caveats(suite, attacks),
        *_failures(stored),
    ]


def _model_caveats(
    suite: Suite, attacks: Sequence[AttackScores], models: Sequence[str]
) -> Iterator[str]:
    scenario = next(iter(suite.scenarios.values())).scenario()
    played = {
        attack.model for attack in attacks
    }  # a model that hangs or ends Python must not run here
    discontinuous, names_of_methods = [], {method.partition(":")[0] for method in suite.methods}
    for name in models:
        if name not in played:
            continue
        try:
            model = parse_trust_model(name, scenario)
            game = Game(scenario, model)
            at_random, jumps = _is_random(game), not Traits.of(model).differentiable
            places_count = not at_random and needs_watching(model) and _depends_on_places(game)
        except (
            Exception,
            SystemExit,
        ) as error:  # a model that fails now and then must not cost the results
            yield f"{name}: it failed after the run: {reason(error)}"
            at_random = jumps = places_count = False
        if PLANNER in names_of_methods and jumps:
            discontinuous.append(name)
        if at_random:
            yield f"{name}: its trust is random, so other runs give other numbers"
        if places_count:
            shown = (
                "are the last of their role" if suite.places == "last" else "are at random places"
            )
            yield f"{name}: its trust depends on the places of agents; the liars of this suite {shown}"  # noqa: E501
        clean = [
            attack
            for attack in attacks
            if attack.model == name and not suite.tracks[attack.condition.track].roles
        ]
        leads = [
            attack.measured["utility"] - attack.measured["blind"]
            for attack in clean
            if _providers_differ(attack)
        ]
        if leads and all(np.nanmax(abs(lead)) < _SAME for lead in leads):
            yield f"{name}: choosing by its trust is no better than choosing blindly; it (almost) ignores ratings"  # noqa: E501
    if discontinuous:
        them = "them" if discontinuous[1:] else "it"
        yield f"{', '.join(discontinuous)}: trust jumps, so the white-box planner could not attack {them}"  # noqa: E501


def _providers_differ(clean: AttackScores) -> bool:
    """Return whether providers differ in quality, so that the best choice is better than a blind
    choice.
    """
    return bool(np.nanmin(clean.measured["blind"]) < 1 - _SAME)


def _is_random(game: Game) -> bool:
    """Return whether the model of a game computes different trust from the same ratings."""
    return not all(map(np.array_equal, _rated(game), _rated(game)))


def _depends_on_places(game: Game) -> bool:
    """Return whether the model of a game trusts an agent otherwise if it has another place among
    the agents.
    """
    if (
        not game.roster.not_self.all()
    ):  # places of raters and providers cannot change apart from each other
        return False
    seats: Any = RandomOrder(game.model)
    seated = Game(game.scenario, seats)
    return any(
        (abs(own - other) > _ROUNDING).any()
        for own, other in zip(*map(_rated, (game, seated)), strict=True)
    )


def _rated(game: Game) -> tuple[Array, Array]:
    """Return trust after some rounds in which all raters and providers differ."""
    shape = (game.roster.n_raters, game.roster.n_providers, _GAMES)
    random, state = (
        np.random.default_rng(0),
        game.start(game.draw(game.random(0), (_GAMES,), start=True)),
    )
    for _ in range(min(_ROUNDS, game.scenario.max_cycles)):
        actions = Actions(random.random(shape[1:]), random.random(shape))
        state, _ = game.step(state, actions, game.draw(game.random(0), (_GAMES,)))
    return game.published(state)


def _search_caveats(attacks: Sequence[AttackScores]) -> Iterator[str]:
    """Yield searches and learners that never beat the scripted attacks with default parameters."""
    scripted: dict[tuple[str, Condition], float] = {}
    for attack in attacks:
        if attack.method == "scripted":
            key = attack.model, attack.condition
            scripted[key] = min(scripted.get(key, np.inf), float(np.nanmean(attack.chosen)))
    for method in dict.fromkeys(
        attack.method
        for attack in attacks
        if not attack.white_box and attack.method not in WITHOUT_SEARCH
    ):
        results = [
            attack
            for attack in attacks
            if attack.method == method and (attack.model, attack.condition) in scripted
        ]
        if results and not any(
            np.nanmean(attack.chosen) < scripted[attack.model, attack.condition]
            for attack in results
        ):
            yield f"{method} never beat the scripts; a larger budget might"


def _progress_caveats(stored: Sequence[StoredCell]) -> Iterator[str]:
    """Yield searches that still found worse attacks at the end of their budget, or that cannot
    tell.
    """
    gains: dict[str, list[tuple[float, str]]] = {}
    short: Counter[str] = Counter()
    for cell, result in stored:
        for row in result.rows:
            if row.progress:
                gains.setdefault(cell.method, []).append((late_gain(row.progress), cell.key))
                short[cell.method] += len(row.progress) < _POINTS
    for method, progress in gains.items():
        rising = sum(gain > FLAT for gain, _ in progress)
        if rising:
            gain, key = max(progress)
            yield (
                f"{method}: the last doubling of its rounds gained more than {FLAT:g} in {rising} "
                f"of {len(progress)} "
                f"cells, at most {gain:.3f} in {key}; a larger budget might find worse"
            )
        if short[method]:
            yield (
                f"{method}: in {short[method]} of {len(progress)} cells its course has fewer than "
                f"{_POINTS} points, "
                "too few to say whether a larger budget finds worse"
            )


def _start_caveats(attacks: Sequence[AttackScores]) -> Iterator[str]:
    """Yield searches that found something else with another seed."""
    for method in dict.fromkeys(attack.method for attack in attacks):
        repeated = [
            attack
            for attack in attacks
            if attack.method == method and not np.isnan(attack.difference)
        ]
        apart = [attack for attack in repeated if attack.difference > FLAT]
        if apart:
            most = max(apart, key=lambda attack: attack.difference)
            yield (
                f"{method}: starts with other seeds differ by more than {FLAT:g} in {len(apart)} "
                f"of {len(repeated)} "
                f"searches, at most by {most.difference:.3f} on {most.model} in "
                f"{most.condition.description}"
            )


def _idle_caveats(suite: Suite, stored: Sequence[StoredCell]) -> Iterator[str]:
    """Yield searches and learners that never attacked. The planner is a caveat of the models."""
    for method in dict.fromkeys(
        cell.method for cell, _ in stored if not suite.is_white_box(cell.method)
    ):
        reasons = [result.unsuitable for cell, result in stored if cell.method == method]
        if all(reasons):
            yield f"{method} attacked nothing: {reasons[0]}"


def _condition_caveats(suite: Suite, attacks: Sequence[AttackScores]) -> Iterator[str]:
    """Yield conditions in which no attack can be played, so that they do not count."""
    played = {attack.condition[1:] for attack in attacks}
    for name in suite.tracks:
        idle = dict.fromkeys(
            share
            for _, track, share in suite.conditions
            if track == name and (name, share) not in played
        )
        if attacks and idle:
            shares = ", ".join(f"{share:g}" for share in idle)
            yield f"{name} {shares}: no attack was played there, so the worst case is that of the other conditions"  # noqa: E501


def _failures(stored: Sequence[StoredCell]) -> Iterator[str]:
    """Yield the failures, one line for each model and error message."""
    failures: dict[tuple[str, str], list[str]] = {}
    for cell, result in stored:
        if result.failed:
            others = f"; its other {len(result.rows)} attacks count" if result.rows else ""
            name = f"{cell.scenario}, {cell.track} {cell.share:g}, {cell.method}"
            failures.setdefault((cell.model, f"{result.failed}{others}"), []).append(name)
    for (model, message), names in failures.items():
        more = f" and {len(names) - 1} more cells" if names[1:] else ""
        yield f"{model}, {names[0]}{more}: {message}"
