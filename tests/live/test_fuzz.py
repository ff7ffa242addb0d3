"""Messages that must move nothing, in great numbers, as bytes on a rater's topic."""

import tracemalloc
from functools import cache
from math import inf, nan

import numpy as np
import pytest
from manager_cases import PERIOD, TEAM, luck, manager

from roletrust_env.live.nodes.manage import hear_raw
from roletrust_env.live.wire import messages
from roletrust_env.live.wire.keys import PublicKeys, Signer, make_keys

KINDS = ("noise", "cut", "bent", "unsigned", "forged", "replayed", "elsewhere", "past", "future", "bad", "strange")


@pytest.mark.parametrize("count", [2000, pytest.param(100_000, marks=pytest.mark.live)])
def test_trust_is_that_of_a_run_without_them(count, tmp_path):
    make_keys(tmp_path, [*TEAM.raters, "liar", "thief"])
    (tmp_path / "thief.pub").unlink()
    keys = PublicKeys(tmp_path)
    clean, noisy = manager(tmp_path / "clean", keyring=keys), manager(tmp_path / "noisy", keyring=keys)
    random, rounds = np.random.default_rng(0), 20
    notes, _ = luck(rounds, lost=0.0)
    wanted, got, told = [], [], []
    for r in range(1, rounds + 1):
        now = PERIOD * r + 20_000_000
        sent = [signed(tmp_path, name, PERIOD * r, row) for name, row in zip(TEAM.raters, notes[r - 1], strict=True)]
        for name, raw in zip(TEAM.raters, sent, strict=True):
            wanted += hear_raw(clean, name, raw, now)
            got += hear_raw(noisy, name, raw, now)
        if r == 2:
            tracemalloc.start()
            before = tracemalloc.get_traced_memory()[0]
        for _ in range(count // rounds):
            kind = KINDS[random.integers(len(KINDS))]
            name = str(random.choice(TEAM.raters))
            counted = noisy.gate.refused.total()
            assert hear_raw(noisy, *wrong(tmp_path, random, kind, name, sent, r), now + 1) == []
            told.append(noisy.gate.refused.total() > counted)
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert got == wanted
    assert len(got) == rounds
    assert all(told)
    assert len(noisy.gate.refused) < 100
    assert grown < 2_000_000


signer_of = cache(Signer)


def signed(folder, rater, stamp, row, signer=None, providers=TEAM.providers):
    """A message as `rater` sends it, or somebody else in its name."""
    ratings = dict(zip(providers, map(float, row), strict=True))
    signature = signer_of(folder, signer or rater).sign(
        messages.encode(messages.ratings_message(rater, stamp, ratings))
    )
    return messages.encode(messages.ratings_message(rater, stamp, ratings, signature))


def wrong(folder, random, kind, name, sent, round):
    """The topic that a message comes on, as the name of a rater, and its bytes."""
    raw, stamp, row = sent[TEAM.raters.index(name)], PERIOD * round + PERIOD // 2, random.random(3)
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
