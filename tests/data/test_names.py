"""Names in columns: their order and their places, however they are cut into columns."""

import numpy as np
import pyarrow as arrow
import pytest

from roletrust_env.data import names as module
from roletrust_env.data.names import NameColumns


@pytest.mark.parametrize("some", ["a", "12345678", "é", "a\0", "a longer name"])
def test_names_have_the_places_in_which_they_first_occur(
    some: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Names of more than 8 bytes also come after shorter ones, and one with a NUL is another one
    than without."""
    monkeypatch.setattr(module, "_LEAST", 100)
    texts = [f"n{n}" for n in np.random.default_rng(0).integers(0, 200, 3000)]
    texts[1500:1502] = some, "a"
    columns = NameColumns()
    for at in range(0, len(texts), 60):
        columns.add(arrow.array(texts[at : at + 60 : 2]), arrow.array(texts[at + 1 : at + 60 : 2]))
    order: dict[str, int] = {}
    for at in range(0, len(texts), 60):
        for name in texts[at : at + 60 : 2] + texts[at + 1 : at + 60 : 2]:
            order.setdefault(name, len(order))
    names, (even, odd), *changed = columns.places(2)
    assert (names, changed) == (list(order), [0, 0])
    assert even.tolist() == [order[name] for name in texts[::2]]
    assert odd.tolist() == [order[name] for name in texts[1::2]]
