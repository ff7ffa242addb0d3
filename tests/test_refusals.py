"""What counts as a word of an error."""

import pytest
from refusals import names, refuses


@pytest.mark.parametrize("text", ["level is 1.5", "'level': 1.5; more", "[1.5, 2]", "1.5: level"])
def test_a_word_is_found_as_a_whole(text: str) -> None:
    assert names(text, 1.5)


@pytest.mark.parametrize("text", ["11.5", "1.55", "-1.5", "1.5e3", "2,1.5", "1.5.2", "x1.5", ""])
def test_a_number_is_not_a_part_of_another(text: str) -> None:
    assert not names(text, "1.5")


def test_a_name_is_not_a_part_of_another() -> None:
    assert names("trust_model 'role-trust' of sp_0", "role-trust")
    assert not names("trust_model 'role-trust' of sp_01", "trust")
    assert not names("trust_model 'role-trust' of sp_01", "sp_0")
    assert names("ratings.late is 0", "late")
    assert names("give --out", "--out")
    assert not names("give --out-of", "--out")


def test_the_class_the_words_and_one_line_are_asked_for() -> None:
    with refuses(ValueError, "level", 2) as error:
        raise ValueError("level is 2")
    assert error.type is ValueError
    for expected, words, message in (
        (ValueError, ("level", 3), "level is 2"),
        (ValueError, (), "level\nis 2"),
    ):
        with pytest.raises(AssertionError), refuses(expected, *words):
            raise ValueError(message)
    with pytest.raises(ValueError), refuses(TypeError):  # noqa: PT011
        raise ValueError
