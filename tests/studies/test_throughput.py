"""Scripted cells play nearly as fast as the bare game does."""

from collections.abc import Iterator
from time import process_time
from typing import NamedTuple

import pytest

from roletrust_env import Game, JointPolicy
from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.suite import Cell, Suite, attacked_scenario
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.game.rollout import rollout

pytestmark = pytest.mark.slow


class Throughput(NamedTuple):
    """Env-steps, rounds x games, in a second of one core.

    Attributes:
        cell: from the name of a cell to its scores: everything that is done for them.
        game: of the same scenario in a batch of the same size, played honestly by
            `roletrust_env.game.rollout.rollout`.
    """

    cell: float
    game: float


def throughput(
    suite: Suite, models: tuple[str, ...] = ("role-trust", "mean"), turns: int = 3
) -> Iterator[Throughput]:
    """Measure both in turn for the scripted cells of some models: one cell for each model and track
    with attackers.

    Args:
        suite: whose cells they are.
        models: trust models.
        turns: of each of the two; the fastest counts, which other work on the machine disturbed
            least.
    """
    chosen: dict[tuple[str, str], Cell] = {}
    for cell in suite.model_copy(update={"models": models, "methods": ("scripted",)}).cells():
        if suite.tracks[cell.track].roles:
            chosen.setdefault((cell.model, cell.track), cell)
    for cell in chosen.values():
        yield Throughput(*map(max, zip(*(_turn(suite, cell) for _ in range(turns)), strict=True)))


def _turn(suite: Suite, cell: Cell) -> Throughput:
    began = process_time()
    done = play_cell(suite, cell)
    between = process_time()
    scenario = attacked_scenario(suite, cell).scenario
    game, batch = (
        Game(scenario, parse_trust_model(cell.model, scenario)),
        (len(done.rows), 2 * suite.games),
    )
    noise = game.random(cell.seed)
    steps = (
        batch[0] * batch[1] * sum(1 for _ in rollout(JointPolicy(game, {}), noise, noise, batch))
    )
    return Throughput(done.env_steps / (between - began), steps / (process_time() - between))


def test_scripted_cells_play_at_a_third_of_the_speed_of_the_bare_game():
    """Both in the same run, in seconds of the processor; on a quiet machine, the mean is 0.55."""
    quick = load_suite("quick")
    suite = quick.model_copy(
        update={"tracks": {name: quick.tracks[name] for name in ("raters", "identities")}}
    )
    for _ in range(4):  # other work may disturb all turns of one side
        shares = [one.cell / one.game for one in throughput(suite, turns=5)]
        if sum(shares) / len(shares) >= 1 / 3:
            break
    assert len(shares) == 4
    assert sum(shares) / len(shares) >= 1 / 3, shares
