"""Messages that must move nothing, in great numbers, as bytes on a rater's topic."""

import tracemalloc
from functools import cache
from math import inf, nan

import numpy as np
import pytest
from manager_cases import PERIOD, TEAM, manager, random_ratings

from roletrust_env.live.nodes.manager_node import receive_raw
from roletrust_env.live.rating_validation import RefusalReason
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.keys import PublicKeys, Signer, make_keys

REASONS = {
    "noise": {RefusalReason.GARBAGE},
    "cut": {RefusalReason.GARBAGE},
    "bent": set(RefusalReason),
    "unsigned": {RefusalReason.UNSIGNED},
    "forged": {RefusalReason.MIS_SIGNED},
    "replayed": {RefusalReason.REPLAYED},
    "elsewhere": {RefusalReason.ELSEWHERE},
    "past": {RefusalReason.PAST},
    "future": {RefusalReason.FUTURE},
    "bad": {RefusalReason.NOT_A_NUMBER, RefusalReason.OUT_OF_RANGE, RefusalReason.REPLAYED},
    "strange": {RefusalReason.UNKNOWN_RATER},
}
ROUNDS, TRACED = 20, 16  # memory is watched from that round on: it makes all of this slow
POOL = 50  # messages of a round that took a signature; what is bent and cut is always another


@pytest.mark.parametrize("count", [2000, pytest.param(100_000, marks=pytest.mark.live)])
def test_trust_is_that_of_a_run_without_them(count, tmp_path):
    make_keys(tmp_path, [*TEAM.raters, "liar", "thief"])
    (tmp_path / "thief.pub").unlink()
    keys = PublicKeys(tmp_path)
    clean, noisy = manager(tmp_path / "clean", keyring=keys), manager(tmp_path / "noisy", keyring=keys)
    random, (notes, _) = np.random.default_rng(0), random_ratings(ROUNDS, lost=0.0)
    wanted, got, before, refused = [], [], 0, 0
    for r in range(1, ROUNDS + 1):
        now = PERIOD * r + 20_000_000
        sent = [signed(tmp_path, name, PERIOD * r, row) for name, row in zip(TEAM.raters, notes[r - 1], strict=True)]
        for name, raw in zip(TEAM.raters, sent, strict=True):
            wanted += receive_raw(clean, name, raw, now)
            got += receive_raw(noisy, name, raw, now)
        made = {kind: [wrong(tmp_path, random, kind, sent, r) for _ in range(POOL)] for kind in REASONS}
        if r == TRACED:
            tracemalloc.start()
            before = tracemalloc.get_traced_memory()[0]
        for kind in random.choice(list(REASONS), count // ROUNDS):
            cheap = kind in ("noise", "cut", "bent")
            topic, raw = wrong(tmp_path, random, kind, sent, r) if cheap else made[kind][random.integers(POOL)]
            counted = noisy.validator.refusals.copy()
            assert receive_raw(noisy, topic, raw, now + 1) == []
            reasons = {reason for _, reason in noisy.validator.refusals - counted}
            assert reasons
            assert reasons <= REASONS[kind], kind
            refused += 1
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert got == wanted
    assert len(got) == ROUNDS
    assert noisy.validator.refusals.total() >= refused == ROUNDS * (count // ROUNDS)
    assert len(noisy.validator.refusals) < 100
    assert grown < 500_000


signer_of = cache(Signer)


def signed(folder, rater, stamp, row, signer=None):
    """A message as `rater` sends it, or somebody else in its name."""
    ratings = dict(zip(TEAM.providers, map(float, row), strict=True))
    signature = signer_of(folder, signer or rater).sign(
        messages.encode(messages.ratings_message(rater, stamp, ratings))
    )
    return messages.encode(messages.ratings_message(rater, stamp, ratings, signature))


def wrong(folder, random, kind, sent, round):
    """The topic that a message comes on, as the name of a rater, and its bytes."""
    place = int(random.integers(len(TEAM.raters)))
    name, raw, stamp, row = TEAM.raters[place], sent[place], PERIOD * round + PERIOD // 2, random.random(3)
    if kind == "noise":
        return name, random.bytes(int(random.integers(0, 300)))
    if kind == "cut":
        return name, raw[: int(random.integers(0, len(raw)))]
    if kind == "bent":
        bent = bytearray(raw)
        bent[int(random.integers(len(raw)))] ^= int(random.integers(1, 256))
        return name, bytes(bent)
    if kind == "unsigned":
        return name, messages.encode(messages.ratings_message(name, stamp, dict.fromkeys(TEAM.providers, 0.0)))
    if kind == "forged":
        return name, signed(folder, name, stamp, row, signer="liar")
    if kind == "elsewhere":
        return "liar", raw
    if kind in ("past", "future"):
        return name, signed(folder, name, stamp + PERIOD * (50 if kind == "future" else -50), row)
    if kind == "bad":
        return "liar", signed(folder, "liar", stamp, random.choice([nan, inf, -inf, -0.5, 1.5, 1e300], 3))
    if kind == "strange":
        return "thief", signed(folder, "thief", stamp, row)
    return name, raw
