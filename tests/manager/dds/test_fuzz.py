"""Large numbers of invalid messages on a rater's topic, none of which may change trust."""

import tracemalloc
from functools import cache
from math import inf, nan

import numpy as np
import pytest
from manager_cases import PERIOD, TEAM, manager, random_ratings

from roletrust_manager.admission.keys import PublicKeys, Signer, make_keys
from roletrust_manager.admission.validation import RefusalReason
from roletrust_manager.dds.nodes.manager_node import receive_raw
from roletrust_manager.dds.wire import messages

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
    "strange": {RefusalReason.UNKNOWN},
}
ROUNDS, TRACED = 20, 16  # memory is traced from that round on, since tracing is slow
POOL = 50  # signed messages of a round; changed and cut messages are always new


@pytest.mark.parametrize("count", [2000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_invalid_messages_do_not_change_trust(count, tmp_path):
    make_keys(tmp_path, [*TEAM.raters, "liar", "thief"])
    (tmp_path / "thief.pub").unlink()
    keys = PublicKeys(tmp_path)
    clean, noisy = (
        manager(tmp_path / "clean", keyring=keys),
        manager(tmp_path / "noisy", keyring=keys),
    )
    random, (values, _) = np.random.default_rng(0), random_ratings(ROUNDS, lost=0.0)
    wanted, got, before, refused = [], [], 0, 0
    for r in range(1, ROUNDS + 1):
        now = PERIOD * r + 20_000_000
        sent = [
            signed(tmp_path, name, PERIOD * r, row)
            for name, row in zip(TEAM.raters, values[r - 1], strict=True)
        ]
        for name, raw in zip(TEAM.raters, sent, strict=True):
            wanted += receive_raw(clean, name, raw, now)
            got += receive_raw(noisy, name, raw, now)
        made = {
            kind: [wrong(tmp_path, random, kind, sent, r) for _ in range(POOL)] for kind in REASONS
        }
        if r == TRACED:
            tracemalloc.start()
            before = tracemalloc.get_traced_memory()[0]
        for kind in random.choice(list(REASONS), count // ROUNDS):
            cheap = kind in ("noise", "cut", "bent")
            topic, raw = (
                wrong(tmp_path, random, kind, sent, r)
                if cheap
                else made[kind][random.integers(POOL)]
            )
            counted = noisy.admission.refusals.copy()
            assert receive_raw(noisy, topic, raw, now + 1) == []
            reasons = {reason for _, reason in noisy.admission.refusals - counted}
            assert reasons
            assert reasons <= REASONS[kind], kind
            refused += 1
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert got == wanted
    assert len(got) == ROUNDS
    assert noisy.admission.refusals.total() >= refused == ROUNDS * (count // ROUNDS)
    assert len(noisy.admission.refusals) < 100
    assert grown < 500_000


signer_of = cache(Signer)


def signed(folder, rater, stamp, row, signer=None):
    """Return a message of `rater`, signed by itself or by another rater."""
    ratings = dict(zip(TEAM.providers, map(float, row), strict=True))
    return messages.encode(
        messages.ratings_message(rater, stamp, ratings, signer_of(folder, signer or rater))
    )


def wrong(folder, random, kind, sent, round):
    """Return the rater whose topic an invalid message is sent on, and its bytes."""
    place = int(random.integers(len(TEAM.raters)))
    name, raw, stamp, row = (
        TEAM.raters[place],
        sent[place],
        PERIOD * round + PERIOD // 2,
        random.random(3),
    )
    if kind == "noise":
        return name, random.bytes(int(random.integers(0, 300)))
    if kind == "cut":
        return name, raw[: int(random.integers(0, len(raw)))]
    if kind == "bent":
        bent = bytearray(raw)
        bent[int(random.integers(len(raw)))] ^= int(random.integers(1, 256))
        return name, bytes(bent)
    if kind == "unsigned":
        return name, messages.encode(
            messages.ratings_message(name, stamp, dict.fromkeys(TEAM.providers, 0.0))
        )
    if kind == "forged":
        return name, signed(folder, name, stamp, row, signer="liar")
    if kind == "elsewhere":
        return "liar", raw
    if kind in ("past", "future"):
        return name, signed(folder, name, stamp + PERIOD * (50 if kind == "future" else -50), row)
    if kind == "bad":
        return "liar", signed(
            folder, "liar", stamp, random.choice([nan, inf, -inf, -0.5, 1.5, 1e300], 3)
        )
    if kind == "strange":
        return "thief", signed(folder, "thief", stamp, row)
    return name, raw
