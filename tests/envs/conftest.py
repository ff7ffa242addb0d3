"""Games that are played by the rules."""

import pytest

from roletrust_env.game.traced.rounds import SWITCH


@pytest.fixture
def untraced(monkeypatch: pytest.MonkeyPatch) -> None:
    """No round is written out, which takes longer than a short game; `game/traced` compares them to
    the bit."""
    monkeypatch.setenv(SWITCH, "0")
