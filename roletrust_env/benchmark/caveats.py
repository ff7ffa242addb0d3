"""What a reader of the leaderboard should know: where the suite is unfit for a model, or was not strong enough."""

from collections.abc import Iterator, Sequence

import numpy as np

from roletrust_env import Game
from roletrust_env.benchmark.leaderboard import AttackScores, Condition
from roletrust_env.benchmark.schema import reason
from roletrust_env.benchmark.store import StoredCell
from roletrust_env.benchmark.suite import OPEN, Suite
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.game.state import Actions
from roletrust_env.trust import Traits

_SAME = 1e-9


def caveats(
    suite: Suite, kept: Sequence[StoredCell], attacks: Sequence[AttackScores], models: Sequence[str]
) -> list[str]:
    """A line for everything that limits what the numbers say."""
    return [
        *_of_models(suite, attacks, models),
        *_of_searches(attacks),
        *_of_rungs(kept),
        *_of_conditions(suite, attacks),
        *_of_cells(kept),
    ]


def _of_models(suite: Suite, attacks: Sequence[AttackScores], models: Sequence[str]) -> Iterator[str]:
    scenario = next(iter(suite.scenarios.values())).scenario()
    played = {one.model for one in attacks}  # one that hangs or ends Python has not, and must not here
    jump = []
    for name in models:
        if name not in played:
            continue
        try:
            model = parse_trust_model(name, scenario)
            at_random, jumps = is_random(Game(scenario, model)), not Traits.of(model).differentiable
        except (Exception, SystemExit) as error:  # a model that fails now and then must not cost the results
            yield f"{name}: it failed after the run: {reason(error)}"
            at_random = jumps = False
        if "white-box planner" in suite.rungs and jumps:
            jump.append(name)
        if at_random:
            yield f"{name}: it plays at random, so that other runs find other numbers"
        calm = [one for one in attacks if one.model == name and not suite.tracks[one.condition.track].roles]
        telling = [one for one in calm if has_a_choice(one)]
        if telling and all(ignores_ratings(one) for one in telling):
            yield f"{name}: whoever goes by it does no better than by going blindly; it ignores ratings, or all but"
    if jump:
        them = "them" if jump[1:] else "it"
        yield f"{', '.join(jump)}: trust jumps, so the white-box planner could not attack {them}"


def has_a_choice(calm: AttackScores) -> bool:
    """Return whether the best choice of a provider brings more than a blind one; else all are equally good."""
    return bool(np.nanmin(calm.measured["blind"]) < 1 - _SAME)


def ignores_ratings(calm: AttackScores) -> bool:
    """Return whether a choice by trust brings the same as a blind one."""
    difference = calm.measured["utility"] - calm.measured["blind"]
    return bool(np.nanmax(abs(difference)) < _SAME)


def is_random(game: Game) -> bool:
    """Whether a model gives different trust to the same ratings."""
    return _trust(game) != _trust(game)


def _trust(game: Game) -> bytes:
    random = game.random(0)
    state = game.start(game.draw(random, (2,), start=True))
    for _ in range(3):
        state, _ = game.step(state, Actions(state.quality + 1, state.ratings + 0.5), game.draw(random, (2,)))
    return b"".join(np.asarray(part).tobytes() for part in game.published(state))


def _of_searches(attacks: Sequence[AttackScores]) -> Iterator[str]:
    """Searches and learners that never found more than the scripts with their defaults."""
    scripted: dict[tuple[str, Condition], float] = {}
    for one in attacks:
        if one.rung == "scripted":
            key = one.model, one.condition
            scripted[key] = min(scripted.get(key, np.inf), float(np.nanmean(one.chosen)))
    for rung in dict.fromkeys(one.rung for one in attacks if one.rung != "scripted" and one.rung not in OPEN):
        mine = [one for one in attacks if one.rung == rung and (one.model, one.condition) in scripted]
        if mine and not any(np.nanmean(one.chosen) < scripted[one.model, one.condition] for one in mine):
            yield f"{rung} never beat the scripts; with a larger budget it might"


def _of_rungs(kept: Sequence[StoredCell]) -> Iterator[str]:
    """Searches and learners that did not play at all; of the planner, see the models."""
    for rung in dict.fromkeys(cell.rung for cell, _ in kept if cell.rung not in OPEN):
        whys = [done.unsuitable for cell, done in kept if cell.rung == rung]
        if all(whys):
            yield f"{rung} attacked nothing: {whys[0]}"


def _of_conditions(suite: Suite, attacks: Sequence[AttackScores]) -> Iterator[str]:
    """Conditions in which none of the attacks has a place, so that they do not count."""
    played = {(one.condition.track, one.condition.share) for one in attacks}
    for name, track in suite.tracks.items():
        idle = [share for share in track.shares if (name, share) not in played]
        if attacks and idle:
            shares = ", ".join(f"{share:g}" for share in idle)
            yield f"{name} {shares}: no attack was played there, so the worst case is that of the other conditions"


def _of_cells(kept: Sequence[StoredCell]) -> Iterator[str]:
    """What failed, a line for each model and reason."""
    found: dict[tuple[str, str], list[str]] = {}
    for cell, done in kept:
        if done.failed:
            left = f"; its other {len(done.rows)} attacks count" if done.rows else ""
            place = f"{cell.scenario}, {cell.track} {cell.share:g}, {cell.rung}"
            found.setdefault((cell.model, f"{done.failed}{left}"), []).append(place)
    for (model, why), places in found.items():
        more = f" and {len(places) - 1} cells more" if places[1:] else ""
        yield f"{model}, {places[0]}{more}: {why}"
