"""Pictures are drawn again when what draws them changes, and only then; pages only when they say something else."""

import pytest
from pages import refused

from roletrust_env.evaluation.specs import parse_attacks
from roletrust_experiments.commands.catalogue import all_attackers, all_models
from roletrust_experiments.site import drawn
from roletrust_experiments.site.drawn import draw
from roletrust_experiments.site.pictures import how_shown


def some(entries, *names):
    return {name: entries[name] for name in names}


def test_pictures_are_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(drawn, "films", lambda folder, quick: {})
    attacks = some(all_attackers(), "on-off")
    first = draw(tmp_path, some(all_models(), "mean"), attacks, quick=True)
    (picture,) = first.models["mean"]
    path = tmp_path / "models" / picture.file
    before = path.stat().st_mtime_ns
    assert draw(tmp_path, some(all_models(), "mean"), attacks, quick=True) == first
    assert path.stat().st_mtime_ns == before
    other = draw(tmp_path, some(all_models(), "median"), attacks, quick=True)
    assert set(other.models) == {"median"}
    (tmp_path / "drawn.json").write_text("{")
    assert draw(tmp_path, some(all_models(), "median"), attacks, quick=True) == other


def test_words_say_what_is_seen(tmp_path, monkeypatch):
    monkeypatch.setattr(drawn, "films", lambda folder, quick: {})
    found = draw(tmp_path, some(all_models(), "mean", "constant"), some(all_attackers(), "bad-mouthing"), quick=True)
    (mean,), (constant,) = found.models["mean"], found.models["constant"]
    assert "from 15 s to 45 s; ToP of honest providers 1.00 before, 0.60 to 0.80 in it" in mean.words
    assert "ToP of honest providers 0.50 before, 0.50 to 0.50 in it" in constant.words


@pytest.mark.parametrize("name", all_attackers())
def test_the_command_of_every_attack_can_be_called(name):
    shown = how_shown(name, all_attackers()[name])
    assert refused(shown.command.replace("\\\n", "")) == ""
    assert parse_attacks(shown.texts, shown.scenario)


def test_what_is_absent_has_words(tmp_path, monkeypatch):
    monkeypatch.setattr(drawn, "films", lambda folder, quick: {})
    attacks = draw(tmp_path, {}, some(all_attackers(), "whitewashing"), quick=True).attacks
    assert "nan" not in attacks["whitewashing"].words


def test_every_attack_is_seated_where_it_attacks():
    entries = all_attackers()
    assert how_shown("on-off", entries["on-off"]).who == "2 of 10 providers"
    assert how_shown("silent", entries["silent"]).who == "4 of 10 raters"
    assert how_shown("collusion", entries["collusion"]).who == "4 of 10 raters, 2 of 10 providers"
    assert how_shown("sybil", entries["sybil"]).texts == ("sp_10=sybil:reserve=3",)
    assert how_shown("learned", entries["learned"]).scenario.name == "paper-3x3"
