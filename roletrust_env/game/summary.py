"""The whole state of a game as one vector, for PettingZoo's `state()`."""

from typing import Annotated

from roletrust_env.arrays import Array, cast, namespace
from roletrust_env.game.game import Game
from roletrust_env.game.state import State, rateable
from roletrust_env.shapes import Shape
from roletrust_env.world.scenario import InRange


def summary_size(game: Game) -> int:
    """Return the number of entries of `summarise`."""
    s, p, n = game.roster.n_raters, game.roster.n_providers, game.roster.n_agents
    return (
        1 + s + 3 * p + n + 4 * s * p + (2 * n if isinstance(game.scenario.access, InRange) else 0)
    )


def summarise(game: Game, state: State) -> Annotated[Array, Shape("K ...")]:
    """Return the whole state as a vector, shape (summary_size, ...), every entry in [0, 1].

    In this order: clock; ToR (S); ToP (P); value of the next services (P); delivered quality (P);
    presence (N). Then, row by row, S x P each: perceived quality of the services without a rating
    yet, whether there is one, ratings that arrived, and whether one did. Where robots move, their
    positions relative to the arena (N x 2).
    """
    xp, batch, roster = namespace(game.like), state.round.shape, game.roster
    tor, top = game.published(state)
    present = game.present(state)
    if present is None:
        present = xp.ones((roster.n_agents, *batch), dtype=game.like.dtype, device=game.like.device)
    clock = cast(state.round, game.like.dtype) / game.scenario.max_cycles
    parts = [clock, tor, top, state.value, state.quality, present]
    parts += [*rateable(state), state.ratings, state.rated]
    if state.motion is not None and isinstance(game.scenario.access, InRange):
        parts.append(state.motion.position / game.scenario.access.arena)
    return xp.concat([part.reshape(-1, *batch) for part in parts])
