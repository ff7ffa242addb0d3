"""Help texts of the terminal as Markdown."""

import pytest

from roletrust_experiments.site.commands import everything, markdown, roletrust


@pytest.mark.parametrize(
    ("markup", "text"),
    [
        ("Play [bold]any[/] game", "Play **any** game"),
        ("[green]a_b.png[/], then `c_d` and e_f", r"`a_b.png`, then `c_d` and e\_f"),
        (r"all of sr_* in \[0, 1]", r"all of sr\_\* in \[0, 1]"),
    ],
)
def test_markup(markup, text):
    assert markdown(markup) == text


def test_examples_are_typed_as_they_stand():
    play = next(command for command in everything(roletrust()) if command.words == ("roletrust", "play"))
    assert "roletrust play crowd-10x10 --attack 'sr_[0-2]=bad-mouthing' --games 20" in play.examples.splitlines()
    assert " \\\n  --attack sp_5=whitewashing:reserve=3" in play.examples
    assert "[cyan]" not in play.examples
    assert [given.name for given in play.arguments] == ["scenario <str>"]
    assert {given.name for given in play.options} >= {"--set FIELD=VALUE", "--video"}
