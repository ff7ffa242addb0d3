"""Checks of the contract of attacks: policies that are played, searched and named by plug-ins."""

import copy
import warnings
from importlib.util import find_spec
from typing import Any, get_args

import numpy as np

from roletrust_env.arrays import Array
from roletrust_env.evaluation.scripts import Space
from roletrust_env.game.game import Game
from roletrust_env.game.joint_policy import JointPolicy
from roletrust_env.game.policy import Channel, Policy
from roletrust_env.game.rollout import Round, rollout
from roletrust_env.parameters import truth_value
from roletrust_env.trees import arrays
from roletrust_env.world.group import AgentGroup
from roletrust_env.world.scenario import Choice, RatingDelivery, Scenario

_RATERS, _PROVIDERS = ("sr_0", "srsp_0"), ("sp_0", "srsp_0")
_SEATS: dict[Channel, tuple[str, ...]] = {
    "ratings": _RATERS,
    "silence": _RATERS,
    "claims": _RATERS,
    "quality": _PROVIDERS,
    "treatment": _PROVIDERS,
    "presence": ("sr_0", "sp_0", "srsp_0"),
}
_VICTIMS, _ACCOMPLICES = (1, 2), (0, 3)  # places on the provider axis

_POINTS = 50  # attacks that a search may make


def check_attack(attack: Policy, *, torch: bool = True) -> None:
    """Check that an attack keeps to the contract of `Policy`.

    The attack has to play in a `JointPolicy` with actions in [0, 1] of the dtype of the game, leave
    its memory and itself unchanged, play each game of a batch as it plays it alone, on NumPy and on
    torch, and declare its parameters so that searches can vary them.

    Args:
        attack: Policy that attacks.
        torch: Whether to check on torch, too, if it is installed.

    Raises:
        ValueError: The argument is no policy, or a searched parameter refuses its own range.
        AssertionError: The attack breaks another rule. The message says which one and what to
            change.

    Warns:
        UserWarning: The attack plays like an honest agent for 25 rounds. An attack that begins
        later does that on
            purpose; in other attacks it is a mistake.

    Example:
        >>> from roletrust_env import make_attacker
        >>> check_attack(make_attacker("bad-mouthing", level=0.1))
    """
    if isinstance(attack, type):
        raise ValueError(
            f"attack {attack.__name__} is a class; check an object: {attack.__name__}()"
        )
    if not isinstance(attack, Policy):
        raise ValueError(
            f"attack {attack!r} is no Policy; derive its class from roletrust_env.Policy"
        )
    check_declaration(attack)
    likes: list[Array] = [np.zeros(()), np.zeros((), np.float32)]
    if truth_value("torch", torch) and find_spec("torch") is not None:
        import torch as library

        likes += [library.zeros((), dtype=library.float64), library.zeros(())]
    for like in likes:
        check_attack_rounds(attack, like)
    alone = check_independent_games(attack)
    for like in likes[2:3]:
        ours, theirs = _played(attack, like, (2,)), _played(attack, likes[0], (2,))
        _require(
            _same(ours, theirs),
            attack,
            "torch and NumPy have different results; compute with namespace(view.trust)",
        )
    if _same(alone, _played(attack, likes[0], (), honest=True)):
        hint = (
            f"it plays like an honest agent for {_rounds(attack)} rounds; override the methods "
            "of its channels"
        )
        warnings.warn(_line(attack, hint), UserWarning, stacklevel=2)


def check_declaration(attack: Policy) -> None:
    """Check the channels of an attack, and the parameters that its class declares for searches."""
    known = ", ".join(map(repr, get_args(Channel)))
    valid = (
        isinstance(attack.attacks, frozenset)
        and bool(attack.attacks)
        and attack.attacks <= set(get_args(Channel))
    )
    _require(
        valid, attack, f"attacks is {attack.attacks!r}; it must be a frozenset of some of {known}"
    )
    try:
        hash(attack)
    except TypeError:
        _require(
            False,
            attack,
            "it cannot be hashed; make its class a frozen dataclass, with tuples in place of lists",
        )
    own = {
        name
        for name in vars(type(attack))
        if isinstance(getattr(type(attack), name), list | dict | set)
    }
    own = {name for name in own if not name.startswith("__")}
    _require(
        not own,
        attack,
        f"{', '.join(sorted(own))}: shared by all objects; use a tuple or a frozenset",
    )
    space = Space(type(attack), _VICTIMS, _ACCOMPLICES, _rounds(attack), max(1, attack.reserve))
    points = np.random.default_rng(0).random((_POINTS, space.size))
    for point in (*points, np.zeros(space.size), np.ones(space.size)):
        policy = space.decode(point)
        same = policy.attacks == space.channels
        _require(
            same,
            attack,
            f"a search makes {policy!r}, which attacks on other channels; declare one class for "
            "each",
        )


def check_attack_rounds(attack: Policy, like: Array) -> None:
    """Check some rounds of an attack in a batch: actions, memory and the attack itself."""
    game, itself = _game(attack, like), copy.deepcopy(_attributes(attack))
    joint_policy = _seated(game, attack)
    noise, state_of = game.random(0), game.random(1)
    state = game.start(game.draw(noise, (2,), start=True))
    memories = joint_policy.begin(state_of, (2,))
    for _ in range(5):
        before = [np.copy(np.asarray(leaf)) for leaf in arrays(memories)]
        try:
            actions, after = joint_policy.checked_act(state, memories, state_of)
        except ValueError as error:
            raise AssertionError(
                _line(attack, f"it cannot play, {error}; see the methods of Policy")
            ) from error
        unchanged = all(map(np.array_equal, map(np.asarray, arrays(memories)), before))
        _require(
            unchanged,
            attack,
            "it writes to its memory; return a new memory in place of the old one",
        )
        for name in ("quality", "ratings", "claims"):
            chosen = getattr(actions, name)
            if chosen is None:
                continue
            fault = (
                f"its {name} are {chosen.dtype} in a game of {like.dtype}; compute them from "
                "the view"
            )
            _require(chosen.dtype == like.dtype, attack, fault)
        state, memories = game.step(state, actions, game.draw(noise, (2,)))[0], after
    same = _attributes(attack) == itself
    _require(
        same,
        attack,
        "it changes its own attributes; keep what it remembers in the memory that begin returns",
    )


def check_independent_games(attack: Policy) -> list[Any]:
    """Check that games do not depend on each other, nor on games that were played before, and
    return one of them.
    """
    like = np.zeros(())
    alone, again = _played(attack, like, ()), _played(attack, like, ())
    _require(
        _same(alone, again),
        attack,
        "the same game has two results; draw random numbers from the `random` argument",
    )
    if not _same(alone, _played(attack, like, (), chance=8)):
        # it plays at random, so that a game in a batch has other numbers than the game alone
        return alone
    batch = _played(attack, like, (3,))
    first = [part[..., 0] for part in batch]
    _require(
        _same(alone, first),
        attack,
        "a game in a batch differs from the same game alone; reduce over no batch axis",
    )
    return alone


def _game(attack: Policy, like: Array) -> Game:
    groups: tuple[AgentGroup, ...] = (
        AgentGroup(role="SR", count=2, noise=0.1),
        AgentGroup(role="SP", count=3),
        AgentGroup(role="SR+SP", count=2, noise=0.1),
    )
    if attack.reserve or "presence" in attack.attacks:
        reserve = max(1, attack.reserve)
        groups = tuple(group.model_copy(update={"reserve": reserve}) for group in groups)
    claims = type(attack).claims is not Policy.claims
    scenario = Scenario(
        agents=groups,
        values=(1.0, 5.0),
        access=Choice(providers=3, temperature=0.2),
        ratings=RatingDelivery(open=4 if claims else None),
        max_cycles=_rounds(attack),
    )
    return Game(scenario, "role-trust", like)


def _rounds(attack: Policy) -> int:
    """Return the length of the game: 25 rounds, or the length that the attack has as a
    parameter.
    """
    return int(getattr(attack, "length", None) or 25)


def _seated(game: Game, attack: Policy) -> JointPolicy:
    """Return the attack at two agents with each of its channels; everybody else plays honestly."""
    seats = dict.fromkeys(name for channel in sorted(attack.attacks) for name in _SEATS[channel])
    return JointPolicy(game, dict.fromkeys(seats, attack))


def _played(
    attack: Policy, like: Array, batch: tuple[int, ...], chance: int = 4, honest: bool = False
) -> list[Any]:
    """Return the qualities, the ratings and the trust of every round."""
    game = _game(attack, like)
    players = JointPolicy(game, {}) if honest else _seated(game, attack)
    rounds: list[Round] = list(rollout(players, game.random(3), game.random(chance), batch))
    parts = (
        (r.state.quality, r.state.ratings, r.state.rated, *game.published(r.state)) for r in rounds
    )
    return [np.stack([np.asarray(part) for part in column]) for column in zip(*parts, strict=True)]


def _same(own: list[Any], other: list[Any]) -> bool:
    return all(
        a.shape == b.shape and np.allclose(a, b, rtol=0, atol=1e-9)
        for a, b in zip(own, other, strict=True)
    )


def _attributes(attack: Policy) -> dict[str, Any]:
    return dict(vars(attack)) if hasattr(attack, "__dict__") else {}


def _line(attack: Policy, fault: str) -> str:
    return f"attack {attack!r}: {fault}"


def _require(holds: bool, attack: Policy, fault: str) -> None:
    if not holds:
        raise AssertionError(_line(attack, fault))
