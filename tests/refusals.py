"""What a test asks of an error: its class and the words that come from the input, never its
sentence."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

import pydantic
import pytest


def names(text: str, word: object) -> bool:
    """Whether a word stands in a text as a whole, not as part of another name or number."""
    word = str(word)
    before = after = ""
    if re.match(r"[\w-]", word):
        before = r"(?<![\w-])"
    if re.match(r"\d", word):
        before += r"(?<!\d[.,])"
    if re.search(r"\w$", word):
        after = r"(?![\w-])"
    if re.search(r"\d$", word):
        after += r"(?![.,]\d)"
    return re.search(before + re.escape(word) + after, text) is not None


def assert_names(text: str, *words: object) -> None:
    """Assert that each word stands in a text as a whole, and that the text is one line."""
    assert "\n" not in text.rstrip("\n"), text
    assert not (missing := [word for word in words if not names(text, word)]), (missing, text)


@contextmanager
def refuses(
    expected: type[BaseException] | tuple[type[BaseException], ...], *words: object
) -> Iterator[pytest.ExceptionInfo[BaseException]]:
    """Expect an error of a class whose message is one line and has the words: the name of what is
    wrong, its value. The errors of pydantic have lines of their own."""
    with pytest.raises(expected) as error:
        yield error
    text = str(error.value)
    if isinstance(error.value, pydantic.ValidationError):
        text = text.replace("\n", " ")
    assert_names(text, *words)
