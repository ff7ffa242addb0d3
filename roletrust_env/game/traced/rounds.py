"""The rounds of one small game: traced when first played, and from then on played as straight-line
Python.
"""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, is_dataclass
from threading import Lock
from time import perf_counter
from typing import Any

import numpy as np

from roletrust_env.arrays import Array
from roletrust_env.game.game import Game
from roletrust_env.game.policy import Policy, policy_name
from roletrust_env.game.traced.compiled import CompiledRound, Memory
from roletrust_env.game.traced.symbols import Symbols
from roletrust_env.game.traced.tape import Element, Symbol, Tape, Untraceable
from roletrust_env.randomness import Random
from roletrust_env.trees import leaves, map_leaves
from roletrust_env.trust.model_checks import needs_watching

MOST_PAIRS = 100
"""Number of pairs of a rater and a provider up to which a game is traced."""

MOST_OPERATIONS = 6000
"""Number of operations in a round up to which straight-line Python is faster than NumPy."""

MOST_FORMS = 16
"""Number of forms of a round above which a game would be traced again and again."""

_CHECKED = 4
"""Number of rounds of a form that are played by the rules, too."""

_LOOK = 512
"""Number of rounds of a form in Python after which the compiler is started, or asked for what it
made."""

_BUILDS = Lock()  # games may be played in several threads

SWITCH = "ROLETRUST_TRACED"
"""Variable of the environment that switches tracing off where it is 0."""

Play = Callable[..., tuple[Any, tuple[Array | None, ...]]]
"""A round: a pure function from a state, the actions and the noise to the next state and to what is
read off it."""


def reason_against(game: Game, policies: Iterable[Policy] = ()) -> str | None:
    """Return why the rounds of a game with scripted policies are not traced; None if nothing is
    known against it.
    """
    if game.like.dtype != np.float64:
        return "it is no game on a grid in NumPy's float64"
    pairs = game.roster.n_raters * game.roster.n_providers
    many = f"{pairs:,} pairs are more than {MOST_PAIRS}" if pairs > MOST_PAIRS else None
    return reason_against_symbols(game, policies) or many


def reason_against_symbols(game: Game, policies: Iterable[Policy]) -> str | None:
    """Return why a game with scripted policies must not be played with symbols; None if nothing is
    known against it.
    """
    if type(game) is not Game or not isinstance(game.like, np.ndarray):
        return "it is no game on a grid on NumPy"
    if needs_watching(game.model):  # it may be a process, which a trial with symbols would disturb
        return "the trust model is of another package"
    for policy in policies:  # its attributes become constants of a written round
        frozen = is_dataclass(policy) and policy.__dataclass_params__.frozen
        if getattr(policy, "__dict__", {}) and not frozen:
            return (
                f"{policy_name(policy)} may change: it has attributes, and is no frozen dataclass"
            )
    return None


@dataclass(frozen=True)
class Leaf:
    """An array of a state as numbers.

    Attributes:
        name: Name of its fields, such as `trust_tor`.
        mold: Array of the same shape, dtype and layout in memory; a number, where the leaf is one.
        elements: Constants, row by row; None where the numbers of a state have one.
    """

    name: str
    mold: Array
    elements: tuple[Element, ...]


class Layout:
    """Common part of all states at one point of a game: the structure, flags and constants.

    Args:
        tree: State with a `Leaf` in place of each array.

    Attributes:
        key: Hashable value that tells layouts apart.
    """

    def __init__(self, tree: Any) -> None:
        self._tree = tree
        self._leaves = [leaf for leaf in leaves(tree) if isinstance(leaf, Leaf)]
        self.key = tuple(
            (leaf.mold.dtype.char, leaf.mold.shape, repr(leaf.elements))
            if isinstance(leaf, Leaf)
            else (type(leaf), leaf)
            for leaf in leaves(tree)
        )

    @classmethod
    def of(cls, state: Any, constant_flags: bool) -> "Layout":
        """Return the layout of a state, in which every number may change."""

        def leaf(name: str, part: Any) -> Any:
            if not on_numpy(part):
                return part
            numbers = part.ravel().tolist()
            fixed = constant_flags and part.dtype.kind == "b"
            return Leaf(name, part, tuple(numbers) if fixed else (None,) * len(numbers))

        return cls(map_named(leaf, state))

    def numbers(self, state: Any) -> list[Any]:
        """Return the numbers of a state that are no constants."""
        arrays = list(filter(on_numpy, leaves(state)))
        return [
            number
            for leaf, array in zip(self._leaves, arrays, strict=True)
            for number, element in zip(array.ravel().tolist(), leaf.elements, strict=True)
            if element is None
        ]

    def state(self, numbers: Sequence[Any]) -> Any:
        """Return the state of these numbers."""
        rest = iter(numbers)

        def array(part: Any) -> Any:
            if not isinstance(part, Leaf):
                return part
            filled = np.empty_like(part.mold)
            filled[...] = np.reshape(
                [next(rest) if e is None else e for e in part.elements], part.mold.shape
            )
            return filled[()] if isinstance(part.mold, np.generic) else filled

        return map_leaves(array, self._tree)

    def symbols(self, state: Any, tape: Tape) -> tuple[Any, list[Symbol]]:
        """Return a state with symbols for its numbers, and these symbols in order."""
        inputs: list[Symbol] = []

        def array(part: Any, example: Any) -> Any:
            if not isinstance(part, Leaf):
                return part
            symbols = np.empty(example.shape, object)
            for place, element in zip(np.ndindex(example.shape), part.elements, strict=True):
                symbol = Symbol(example.dtype.kind, "_".join([part.name, *map(str, place)]))
                symbols[place] = symbol if element is None else element
                inputs.extend([symbol] if element is None else [])
            return Symbols.of(symbols, example, tape)

        return map_leaves(array, self._tree, state), inputs

    def following(self, after: Any) -> tuple["Layout", list[Element]]:
        """Return the layout after a traced round, and the elements that are its numbers.

        Flags that depend on no symbol are constants, and so are arrays of which all numbers depend
        on none. A number that was constant and has another value now may change in every round, so
        it is none.
        """
        before = list(leaves(self._tree))
        place, numbers = iter(range(len(before) + 1)), []

        def leaf(name: str, part: Any) -> Any:
            was = before[min(next(place), len(before) - 1)]
            if not on_numpy(part):
                return part
            example = part.example if isinstance(part, Symbols) else part
            elements, whole = elements_of(part), not isinstance(part, Symbols)
            old = (
                was.elements if isinstance(was, Leaf) and len(was.elements) == len(elements) else ()
            )
            flags = example.dtype.kind == "b"
            for k, element in enumerate(elements):
                changed = not flags and old and old[k] is not None and repr(old[k]) != repr(element)
                if changed or isinstance(element, Symbol) or not (flags or whole):
                    numbers.append(element)
                    elements[k] = None
            return Leaf(
                name,
                np.empty_like(example) if isinstance(example, np.ndarray) else example,
                tuple(elements),
            )

        return Layout(map_named(leaf, after)), numbers


class Form:
    """A written round, for the states of one layout.

    Attributes:
        written: The round; it also takes the numbers of the noise, of the fields that are there.
        after: Layout of the state after it.
        assumed: Numbers that some of a state's numbers must be equal to: the place of each, and for
            all its values whether they are.
        following: Forms for the layout after it; None if there was no such round yet.
        unchecked: Number of rounds for which it is still to be compared with the rules.
        compiled: The round in C, once it is compiled.
        fields: Fields of the noise that are there.
        shapes: Shapes of the actions, of each field of the noise and of each result.
        trace_s: Time that it took to trace and to write it, in seconds.
    """

    trace_s: float

    def __init__(
        self,
        tape: Tape,
        inputs: Mapping[str, Sequence[Symbol]],
        outputs: Sequence[Sequence[Element] | None],
        fields: list[int],
        shapes: tuple[tuple[int, ...] | None, ...],
        after: Layout,
        assumed: list[tuple[int, list[bool]]],
    ) -> None:
        self.written, self.after, self.assumed = tape.written(inputs, outputs), after, assumed
        self.fields, self.shapes = fields, shapes
        self.following: list[Form] | None = None
        self.unchecked = _CHECKED
        self.compiled: CompiledRound | None = None
        self._kinds = [_CASTS[symbol.kind] for symbol in inputs["state"]]
        self._in_work: CompiledRound | None = CompiledRound(tape, list(inputs.values()), outputs)
        self._played = 0

    def play(self, numbers: Sequence[Any], actions: Array, noise: Any) -> Any:
        """Return the numbers of the next state and what is read off it, for the numbers of a
        state.
        """
        if isinstance(numbers, np.ndarray):
            numbers = [
                cast(number) for cast, number in zip(self._kinds, numbers.tolist(), strict=False)
            ]
        found = self.written.play(
            numbers, actions.tolist(), *[noise[field].ravel().tolist() for field in self.fields]
        )
        self._played += 1
        if not self._played % _LOOK:
            self.build()
        return found

    def build(self, wait: bool = False) -> None:
        """Start to compile the round, or take what the compiler made.

        Args:
            wait: Whether to wait for the compiler.
        """
        if not _BUILDS.acquire(blocking=wait):
            return
        try:
            if self._in_work is not None and self._in_work.build(wait):
                if self._in_work.ready:
                    self.compiled, self.unchecked = self._in_work, _CHECKED
                self._in_work = None
        finally:
            _BUILDS.release()


class Known:
    """Knowledge of the rounds of equal games: their forms by layout, and why they are not traced,
    if so.
    """

    def __init__(self, reason: str | None) -> None:
        self.forms: dict[Any, list[Form]] = {}
        self.shapes: tuple[tuple[int, ...] | None, ...] | None = (
            None  # of what a round takes and returns
        )
        self.reason = reason

    def of(self, layout: Layout) -> list[Form]:
        """Return the forms for the states of a layout, to which more may be added."""
        return self.forms.setdefault(layout.key, [])


def _fitting(forms: list[Form], numbers: Sequence[Any]) -> Form | None:
    """Return the form whose assumptions hold for the numbers of a state."""
    for form in forms:
        if not form.assumed or all(holds[int(numbers[place])] for place, holds in form.assumed):
            return form
    return None


_CASTS: dict[str, Callable[[float], Any]] = {"f": float, "i": int, "b": bool}

_KNOWN: dict[Any, Known] = {}
"""What this process knows of the rounds of games, by all that they depend on; at most
`_MOST_KNOWN`."""

_MOST_KNOWN = 64


class Rounds:
    """The rounds of one game in progress. They are equal to the bit to those of the rules, traced
    or not.

    Args:
        game: Game that is played.
        play: Its round. The actions are a vector; what is read off a state are vectors, or None.
        key: What else than the scenario and the trust model the round depends on, hashable.
        policies: Policies of scripted agents.
    """

    def __init__(self, game: Game, play: Play, key: Any, policies: Iterable[Policy] = ()) -> None:
        self._play, self._key = play, (key, game.scenario, type(game.model), repr(game.model))
        self._reason = reason_against(game, policies)
        self._known = self._look_up()
        self._layout: Layout | None = None
        self._form: Form | None = None
        self._numbers: Sequence[Any] | Array = ()
        self._memory: Memory | None = None
        self._state: Any = None

    def _look_up(self) -> Known:
        reason = f"{SWITCH} is 0" if os.environ.get(SWITCH) == "0" else self._reason
        if reason is not None:
            return Known(reason)
        if self._key not in _KNOWN:
            if len(_KNOWN) >= _MOST_KNOWN:
                del _KNOWN[next(iter(_KNOWN))]
            _KNOWN[self._key] = Known(None)
        return _KNOWN[self._key]

    def __repr__(self) -> str:
        if self._known.reason:
            return f"untraced: {self._known.reason}"
        return "traced" if self._form is None or self._form.compiled is None else "traced, compiled"

    def __getstate__(self) -> dict[str, Any]:
        none = dict.fromkeys(("_known", "_layout", "_form", "_memory"))
        return {**self.__dict__, **none, "_state": self.state, "_numbers": ()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._known = self._look_up()
        if self._state is not None:
            self._take(self._state, constant_flags=False)

    def __deepcopy__(self, memo: dict[int, Any]) -> "Rounds":
        twin = memo[id(self)] = type(self).__new__(type(self))
        for name, value in {**self.__dict__, "_memory": None}.items():
            shared = name in (
                "_key",
                "_known",
                "_layout",
                "_form",
            )  # copied policies would be others
            twin.__dict__[name] = value if shared else deepcopy(value, memo)
        return twin

    @property
    def state(self) -> Any:
        """The state of the game; None before `begin`."""
        if self._state is None and self._layout is not None:
            self._state = self._layout.state(self._numbers)
        return self._state

    @property
    def forms(self) -> list[Form]:
        """The forms of the written round."""
        return [form for forms in self._known.forms.values() for form in forms]

    def compile(self) -> None:
        """Compile the rounds that were played so far, and wait for it; else that is done beside the
        play.
        """
        for form in self.forms:
            form.build(wait=True)

    def begin(self, state: Any) -> None:
        """Take the state before the first round."""
        self._take(state, constant_flags=True)

    def play(self, actions: Any, noise: Any, *further: Any) -> Sequence[Any]:
        """Play one round.

        Args:
            actions: Actions, a vector.
            noise: Noise of the round.
            *further: Further arguments of the round, which a traced one must not use, such as
                random numbers.

        Returns:
            What is read off the state: tuples of numbers, or vectors, which hold until the next
                round; None as the round has it.
        """
        form = self._form
        if form is None or form.unchecked:
            return self._play_anew(actions, noise, *further)
        try:
            numbers, *results = self._play_form(form, actions, noise)
        except (ArithmeticError, ValueError):  # such as a division by 0, at which NumPy goes on
            return self._play_plainly(actions, noise, *further)
        self._advance(form, numbers)
        read: Sequence[Any] = results
        return read

    def _play_form(self, form: Form, actions: Array, noise: Any) -> Sequence[Any]:
        """Return the numbers of the next state and what is read off it."""
        compiled, memory = form.compiled, self._memory
        if compiled is None:
            played: Sequence[Any] = form.play(self._numbers, actions, noise)
            return played
        if (
            memory is None
            or len(memory.state) < compiled.size
            or len(memory.called) < compiled.n_called
        ):
            size = max(compiled.size, len(self._numbers))
            memory = self._memory = Memory(form.shapes, len(form.fields), size, compiled.n_called)
        if self._numbers is not memory.state:
            memory.state[: len(self._numbers)] = self._numbers
        memory.actions[...] = actions
        for place, field in zip(memory.noise, form.fields, strict=True):
            place[...] = noise[field]
        compiled.play(memory)
        return memory.state, *memory.results

    def _advance(self, form: Form, numbers: Sequence[Any]) -> None:
        self._state, self._layout, self._numbers = None, form.after, numbers
        if form.following is None:
            form.following = self._known.of(form.after)
        self._form = _fitting(form.following, numbers)

    def _take(self, state: Any, constant_flags: bool) -> None:
        self._state, self._layout, self._form = state, None, None
        if self._known.reason is None and (strange := _strange(state)):
            self._known.reason = f"a state holds {strange}"
        if self._known.reason is None:
            self._layout = Layout.of(state, constant_flags)
            self._numbers = self._layout.numbers(state)
            self._form = _fitting(self._known.of(self._layout), self._numbers)

    def _play_plainly(self, actions: Any, noise: Any, *further: Any) -> Sequence[Any]:
        """Play a round by the rules."""
        after, results = self._play(self.state, np.asarray(actions), noise, *further)
        self._take(after, constant_flags=False)
        return results

    def _play_anew(self, actions: Any, noise: Any, *further: Any) -> Sequence[Any]:
        """Play a round that is not traced, or is to be traced, or to be compared with the rules."""
        known, form = self._known, self._form
        if known.reason is None and form is None and self._layout is not None:
            form = _fitting(
                known.of(self._layout), self._numbers
            )  # another game may have traced it meanwhile
        if known.reason is None and form is None:
            try:
                form = self._trace(np.asarray(actions), noise, len(further))
            except Untraceable as error:
                known.reason = str(error)
            except Exception as error:  # whatever NumPy says of an array of symbols
                known.reason = f"{type(error).__name__}: {error}"
        if form is None or known.reason is not None:
            return self._play_plainly(actions, noise, *further)
        before = self.state  # the memory of a compiled round has no other place for it
        try:
            numbers, *found = self._play_form(form, actions, noise)
        except (ArithmeticError, ValueError):
            return self._play_plainly(actions, noise, *further)
        self._state = before
        results = self._play_plainly(actions, noise, *further)
        if not _same(form.after.state(numbers), self.state) or not all(map(_alike, found, results)):
            if form.compiled is not None:
                form.compiled, form.unchecked = None, 0
                return results
            known.reason = "a written round differs from the rules by rounding"
            return results
        form.unchecked -= 1
        self._advance(form, numbers)
        return results

    def _trace(self, actions: Array, noise: Any, n_further: int) -> Form:
        """Return the form of the round for states like this one.

        Raises:
            Untraceable: The round cannot be written.
        """
        layout, known, state, began = self._layout, self._known, self.state, perf_counter()
        assert layout is not None  # it is None for games that are not traced
        if len(self.forms) >= MOST_FORMS:
            raise Untraceable(f"its rounds have more than {MOST_FORMS} forms")
        tape = Tape(MOST_OPERATIONS)
        symbols, numbers = layout.symbols(state, tape)
        inputs = {"state": numbers}
        given = []
        names = ["actions", *(f"noise_{field}" for field in noise._fields)]
        for name, part in zip(names, (actions, *noise), strict=True):
            if part is not None:
                whole = Layout(Leaf(name, part, (None,) * part.size))
                part, inputs[name] = whole.symbols(part, tape)
            given.append(part)
        after, results = self._play(
            symbols, given[0], type(noise)(*given[1:]), *[Unknown()] * n_further
        )
        following, outputs = layout.following(after)
        read = [None if one is None else elements_of(one) for one in results]
        places = {symbol: place for place, symbol in enumerate(numbers)}
        assumed = [
            (
                places[symbol],
                [*(table == table[self._numbers[places[symbol]]]).all(axis=1).tolist(), False],
            )
            for symbol, table in tape.assumed
        ]
        fields = [k for k, part in enumerate(noise) if part is not None]
        shapes = (
            actions.shape,
            *(noise[k].shape for k in fields),
            *(None if one is None else (len(one),) for one in read),
        )
        known.shapes = shapes if known.shapes is None else known.shapes
        if shapes != known.shapes:
            raise Untraceable("its rounds have vectors of many lengths")
        form = Form(tape, inputs, [outputs, *read], fields, known.shapes, following, assumed)
        form.trace_s = perf_counter() - began
        known.of(layout).append(form)
        return form


class Unknown(Random):
    """Stands for the random numbers of policies, which a traced round must not use."""

    def __init__(self) -> None:
        pass

    def __getattribute__(self, name: str) -> Any:
        raise Untraceable("a policy draws random numbers")


def _strange(state: Any) -> str | None:
    """Return the type of a leaf that is no array, number, flag or text; None without any."""
    known = np.ndarray | np.generic | int | float | str | None
    return next(
        (type(leaf).__name__ for leaf in leaves(state) if not isinstance(leaf, known)), None
    )


def on_numpy(leaf: Any) -> bool:
    """Return whether a leaf of a tree is an array or a number of NumPy."""
    return isinstance(leaf, np.ndarray | np.generic)


def elements_of(array: Any) -> list[Element]:
    """Return the symbols and constants of an array, row by row."""
    return (
        list(array.elements.ravel())
        if isinstance(array, Symbols)
        else np.asarray(array).ravel().tolist()
    )


def _same(one: Any, other: Any) -> bool:
    """Return whether two trees hold the same bits."""
    pairs = zip(leaves(one), leaves(other), strict=True)
    return all(np.asarray(a).tobytes() == np.asarray(b).tobytes() for a, b in pairs)


def _alike(found: Any, result: Any) -> bool:
    return (found is None) == (result is None) and (
        result is None or np.asarray(found, result.dtype).tobytes() == result.tobytes()
    )


def map_named(change: Callable[[str, Any], Any], tree: Any, name: str = "") -> Any:
    """Return a tree with other leaves, by the name of a leaf and the leaf."""
    if not isinstance(tree, tuple):
        return change(name, tree)
    names = getattr(tree, "_fields", range(len(tree)))
    parts = [
        map_named(change, part, f"{name}_{key}".strip("_"))
        for key, part in zip(names, tree, strict=True)
    ]
    return type(tree)(*parts) if hasattr(tree, "_fields") else tuple(parts)
