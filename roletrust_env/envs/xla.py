"""Functions of a game in a form that XLA makes fast code of: the games of a batch last, and plain
arithmetic.

`jax.vmap` puts the games first, so that the innermost loops are those over a few agents. XLA
compiles a sum over agents to a loop of its own, which ends the fusion of operations, and on a CPU
it calls the C library for each sine.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial, reduce
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax
from jax.custom_batching import custom_vmap
from jax.experimental.layout import Layout, with_layout_constraint
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal, jaxpr_as_fun

from roletrust_env.arrays import Array

_MOST_TERMS = 32
"""Number of terms of the longest sum that is written out."""

_TURN = 6.28125, 2 * math.pi - 6.28125
"""The period of a sine in two parts. Multiples of the first are exact in float32 up to 32,768
turns."""

_SINE = [(-1) ** k / math.factorial(2 * k + 1) for k in range(6)]
"""Coefficients of sin(x) / x in the square of x: on [0, pi / 2] the first term that is missing is
below 6e-8."""


def games_last(
    function: Callable[..., Any], differentiated: Callable[..., Any] | None = None
) -> Callable[..., Any]:
    """Return a pure function of a game of which `jax.vmap` makes one call with all games on the
    last axis.

    Derivatives, which need the operations themselves, are those of a function with the games first.

    Args:
        function: Function of trees of arrays which takes further axes behind those of one game.
        differentiated: Equal function of which derivatives are taken; None is the same.
    """

    def batch(games: int, batched: Sequence[Any], _: Any, *arguments: Any) -> tuple[Any, Any]:
        def last(array: Array, has_games: bool) -> Array:
            array = array if has_games else jnp.broadcast_to(array, (games, *array.shape))
            return jnp.moveaxis(array, 0, -1)

        found = _in_plain_arithmetic(function, *jax.tree.map(last, arguments, tuple(batched[1:])))
        return jax.tree.map(_games_first, found), jax.tree.map(lambda _: True, found)

    def play(*arguments: Any) -> Any:
        record, shapes = jax.make_jaxpr(function, return_shape=True)(*arguments)

        def recorded(constants: Sequence[Array], *arguments: Any) -> Any:
            found = jaxpr_as_fun(ClosedJaxpr(record.jaxpr, constants))(*jax.tree.leaves(arguments))
            return jax.tree.unflatten(jax.tree.structure(shapes), found)

        single = custom_vmap(recorded)
        single.def_vmap(batch)
        # A condition that differs by game gives its branches all arrays by game, and constants must
        # be arguments then.
        return single(record.consts, *arguments)

    differentiable: Any = jax.custom_jvp(play)
    differentiable.defjvp(
        lambda primals, tangents: jax.jvp(differentiated or function, primals, tangents)
    )
    played: Callable[..., Any] = differentiable
    return played


def _games_first(array: Array) -> Array:
    """Return an array with the last axis first, and as it was in memory."""
    array = jnp.moveaxis(array, -1, 0)
    return with_layout_constraint(array, Layout((*range(1, array.ndim), 0)))


def _in_plain_arithmetic(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a function returns, by what JAX records of it, with other operations for those of
    `_RULES`.
    """
    record, shapes = jax.make_jaxpr(function, return_shape=True)(*arguments)
    found = _replay(record.jaxpr, record.consts, jax.tree.leaves(arguments))
    return jax.tree.unflatten(jax.tree.structure(shapes), found)


def _replay(record: Jaxpr, constants: Iterable[Array], arguments: Iterable[Array]) -> list[Array]:
    values: dict[Any, Array] = dict(
        zip([*record.constvars, *record.invars], [*constants, *arguments], strict=True)
    )

    def value(atom: Any) -> Array:
        return atom.val if isinstance(atom, Literal) else values[atom]

    for operation in record.eqns:
        name, parameters = operation.primitive.name, operation.params
        inputs = list(map(value, operation.invars))
        if name in _CALLS:
            called = parameters[_CALLS[name]]
            found = _replay(called.jaxpr, called.consts, inputs)
        else:
            found = _RULES.get(name, operation.primitive.bind)(*inputs, **parameters)
            found = found if operation.primitive.multiple_results else [found]
        values |= zip(operation.outvars, found, strict=True)
    return list(map(value, record.outvars))


def _reduced(
    primitive: Any, join: Callable[[Array, Array], Array], array: Array, **parameters: Any
) -> Array:
    """Return a reduction, term by term if there are few."""
    axes = parameters["axes"]
    if math.prod(array.shape[axis] for axis in axes) > _MOST_TERMS or 0 in array.shape:
        return primitive.bind(array, **parameters)
    for axis in sorted(axes, reverse=True):
        terms = (
            lax.index_in_dim(array, at, axis, keepdims=False) for at in range(array.shape[axis])
        )
        array = reduce(join, terms)
    return array


def _power(base: Array, exponent: Array) -> Array:
    if base.dtype != jnp.float32:
        return lax.pow_p.bind(base, exponent)
    size = jnp.where(exponent == 0, 1.0, jnp.exp(exponent * jnp.log(abs(base))))
    remainder = abs(exponent - 2 * jnp.round(exponent / 2))  # 0 of an even number, 1 of an odd one
    of_negative = jnp.where(remainder == 0, size, jnp.where(remainder == 1, -size, jnp.nan))
    return jnp.where(base < 0, of_negative, size)


def _sine(angle: Array, **parameters: Any) -> Array:
    if angle.dtype != jnp.float32:
        return lax.sin_p.bind(angle, **parameters)
    angle = _within_a_turn(angle)
    size = abs(angle)
    return jnp.sign(angle) * _sine_polynomial(jnp.where(size > math.pi / 2, math.pi - size, size))


def _cosine(angle: Array, **parameters: Any) -> Array:
    if angle.dtype != jnp.float32:
        return lax.cos_p.bind(angle, **parameters)
    return _sine_polynomial(math.pi / 2 - abs(_within_a_turn(angle)))


def _within_a_turn(angle: Array) -> Array:
    """Return an angle within [-pi, pi], as exact as if it had been rounded once more."""
    turns = jnp.round(angle * (0.5 / math.pi))
    return angle - turns * _TURN[0] - turns * _TURN[1]


def _sine_polynomial(angle: Array) -> Array:
    square = angle * angle
    return angle * reduce(lambda sum, coefficient: sum * square + coefficient, reversed(_SINE))


_CALLS = {
    "jit": "jaxpr",
    "pjit": "jaxpr",
    "custom_jvp_call": "call_jaxpr",
    "custom_vjp_call": "call_jaxpr",
}
"""Parameter with the record of what is called, for operations that are calls."""

_RULES: dict[str, Callable[..., Array]] = {
    "reduce_sum": partial(_reduced, lax.reduce_sum_p, jnp.add),
    "reduce_max": partial(_reduced, lax.reduce_max_p, jnp.maximum),
    "reduce_min": partial(_reduced, lax.reduce_min_p, jnp.minimum),
    "reduce_and": partial(_reduced, lax.reduce_and_p, jnp.logical_and),
    "reduce_or": partial(_reduced, lax.reduce_or_p, jnp.logical_or),
    "pow": _power,
    "sin": _sine,
    "cos": _cosine,
}
