"""The table from whole numbers to places: it is a dict, for many keys at a time."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from roletrust_env.trust import key_index
from roletrust_env.trust.key_index import KeyIndex

KEY = st.integers(-3, 12) | st.integers(-(2**63) + 1, 2**63 - 1)


@given(st.lists(st.lists(KEY, max_size=40), max_size=6))
def test_it_gives_each_key_one_place(batches: list[list[int]]) -> None:
    index, known = KeyIndex(), set()
    for batch in batches:
        keys = np.array(batch, np.int64)
        unknown = index.places(keys, add=False)
        assert [int(place) >= 0 for place in unknown] == [key in known for key in batch]
        places = index.places(keys)
        known.update(batch)
        assert np.array_equal(index.keys[places], keys)
        assert sorted(index.keys.tolist()) == sorted(known)
        assert len(index) == len(known)


@given(st.lists(st.lists(st.integers(0, 12), max_size=40), max_size=6))
def test_small_keys_have_places_in_the_order_in_which_they_first_occur(
    batches: list[list[int]],
) -> None:
    index = KeyIndex()
    for batch in batches:
        index.places(np.array(batch, np.int64))
    assert index.keys.tolist() == list(dict.fromkeys(key for batch in batches for key in batch))


@pytest.mark.parametrize("block", [7, 1 << 16])
@pytest.mark.parametrize(
    ("least", "small"), [(-5_000, 1 << 20), (0, 1 << 20), (0, 16), (1 << 40, 16)]
)
def test_places_stay_when_the_table_grows(
    monkeypatch: pytest.MonkeyPatch, block: int, least: int, small: int
) -> None:
    """Whether keys are entries of the table themselves, are hashed, or change from the one to the
    other."""
    monkeypatch.setattr(key_index, "_BLOCK", block)
    monkeypatch.setattr(key_index, "_SMALL", small)
    keys = least + np.random.default_rng(0).integers(0, 10_000, 20_000)
    index = KeyIndex()
    first = index.places(keys[:300])
    index.places(keys)
    assert np.array_equal(index.places(keys[:300]), first)
    assert len(index) == len(np.unique(keys))
    assert np.array_equal(np.sort(index.keys), np.unique(keys))
