"""The parts of the site's extension: docstrings, formulas, help texts, sources, pictures and
printed output."""

import inspect
import re

import pytest
from built import HOUSE
from latex2mathml.converter import convert
from nbformat.v4 import new_output
from pages import refused
from pybtex.database import parse_file

import roletrust_env
from roletrust_env import Game, make_scenario
from roletrust_env.evaluation.specs import parse_attacks
from roletrust_env.game.policy import registry as attackers
from roletrust_env.logs.models import LOG_MODELS
from roletrust_env.metrics import Score, damage
from roletrust_env.trust.model import registry as models
from roletrust_env.trust.models.personal.travos import Travos
from roletrust_env.world.presets import scenarios
from roletrust_experiments.catalogue import all_attackers, all_models
from site_pages import pictures, whole_streams
from site_pages.commands import everything, markdown, roletrust
from site_pages.docstrings import as_written, formula_of, formulas, readable, typeset
from site_pages.pages import cited
from site_pages.pictures import ATTACKS, CARD, draw, how_shown
from site_pages.scenario_files import as_toml

pytestmark = pytest.mark.slow

BIBLIOGRAPHY = HOUSE / "docs" / "references.bib"


def read(text, thing=None):
    lines = text.splitlines()
    readable(None, "class", "it", thing, None, lines)
    return lines


def test_what_is_indented_after_an_empty_line_is_a_formula():
    text = "A mean:\n\n    x = 1\n\n    y = 2\n\nAnd more\n\n    z = 3"
    found = [
        "A mean:",
        "",
        "::",
        "",
        "    x = 1",
        "",
        "    y = 2",
        "",
        "And more",
        "",
        "::",
        "",
        "    z = 3",
    ]
    assert read(text) == found
    sections = (
        "It does.\n\nArgs:\n    one: a number.\n\n    two: another.\n\nReturns:\n    What it is."
    )
    assert read(sections) == sections.splitlines()
    assert read("A game.\n\n## Description\n\nLong.") == ["A game.", ""]


def test_attributes_of_data_are_parameters():
    text = "Attributes:\n    error: how far."
    assert read(text, Score)[0] == "Args:"
    assert "error" not in " ".join(read(text, Travos))  # in the table of its page
    assert read(text, Game)[0] == "Attributes:"


def test_signatures_are_short():
    for what, thing, signature in (
        (
            "function",
            damage,
            (
                "(trust: TrustByRound, paired: TrustByRound, agents: Sequence[int], "
                "weights: RoundWeights | None=None)",
                "Score",
            ),
        ),
        ("class", Travos, ("(error=0.2, threshold=0.95, bins=5)", "")),
        ("method", Game.published, ("(state: State)", "tuple[PerRater, PerProvider]")),
        ("attribute", 3, None),
    ):
        assert as_written(None, what, "it", thing, None, "(...)", None) == signature


def test_each_model_and_attack_has_a_formula_with_its_own_parameters():
    names = {("models", name): models.factory(name) for name in roletrust_env.trust_models()}
    names |= {("attacks", name): attackers.factory(name) for name in roletrust_env.attackers()}
    names |= {("neighbours", name): thing for name, thing in LOG_MODELS.items()}
    assert {(kind, name) for kind, latex in formulas().items() for name in latex} == set(names)
    for (kind, name), factory in names.items():
        rows = formula_of(factory)
        markup = convert("\n".join(line.strip() for line in typeset(rows)[2:]), display="block")
        assert markup.count("<mtr>") >= len(rows) > 0, name
        assert "<mi>&</mi>" not in markup, name
        known = {*inspect.signature(factory).parameters, "start", "stop"}
        assert set(re.findall(r"\\textit\{(\w+)\}", formulas()[kind][name])) <= known, name


def test_a_formula_takes_the_place_of_the_plain_one_or_stands_after_the_first_paragraph():
    beta, median = (
        read(inspect.getdoc(models.factory(name)), models.factory(name))
        for name in ("beta", "median")
    )
    assert beta.count(".. math::") == 1
    assert not any("<-" in line for line in beta)
    assert beta[2] == ".. math::"
    assert median[1:3] == ["", ".. math::"]


def test_markup_and_examples_of_help_texts():
    for markup, text in (
        ("Play [bold]any[/] game", "Play **any** game"),
        ("[green]a_b.png[/], then `c_d` and e_f", r"`a_b.png`, then `c_d` and e\_f"),
        (r"all of sr_* in \[0, 1]", r"all of sr\_\* in \[0, 1]"),
    ):
        assert markdown(markup) == text
    play = next(
        command for command in everything(roletrust()) if command.words == ("roletrust", "play")
    )
    assert (
        "roletrust play crowd-10x10 --attack 'sr_[0-2]=bad-mouthing' --games 20"
        in play.examples.splitlines()
    )
    assert " \\\n  --attack sp_5=whitewashing:reserve=3" in play.examples
    assert "[cyan]" not in play.examples
    assert [given.name for given in play.arguments] == ["scenario <str>"]
    assert {given.name for given in play.options} >= {"--set FIELD=VALUE", "--video"}


def test_sources_are_found_by_name_and_year():
    for text, keys in (
        ("Jøsang, Hayward and Pope (2006)", ["josang2006"]),
        (
            "with the weightings of Yu et al. (2006) and Laureti et al. (2006)",
            ["yu2006", "laureti2006"],
        ),
        ("Irissappane, Jiang and Zhang (2012)", ["irissappane2012"]),
        ("de Kerchove and Van Dooren (2010)", ["kerchove2010"]),
        ("Huber. Later, in 1964, nothing", []),
        ("nobody (1999)", []),
    ):
        assert cited(text, BIBLIOGRAPHY) == keys
    for thing in (*(models.factory(name) for name in models.names()), *LOG_MODELS.values()):
        source = getattr(thing, "source", "") or ""
        assert bool(cited(source, BIBLIOGRAPHY)) == bool(source), thing
    for key, entry in parse_file(str(BIBLIOGRAPHY)).entries.items():
        assert entry.fields["title"], key
        assert re.fullmatch(r"10\.\d{4,}/\S+", entry.fields.get("doi", "10.1000/none")), key


def test_pictures_are_kept_until_their_source_changes_and_say_what_is_seen(tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "films", lambda folder: {})
    monkeypatch.setattr(pictures, "ATTACKS", {CARD: ATTACKS[CARD]})
    entries, attacks = (
        all_models(),
        {name: all_attackers()[name] for name in ("bad-mouthing", "whitewashing")},
    )

    def drawn(*names):
        return draw(tmp_path, {name: entries[name] for name in names}, attacks)

    first = drawn("mean")
    path = tmp_path / "models" / first.models["mean"][0].file
    before = path.stat().st_mtime_ns
    assert drawn("mean") == first
    assert path.stat().st_mtime_ns == before
    other = drawn("mean", "constant")
    assert set(other.models) == {"mean", "constant"}
    (tmp_path / "drawn.json").write_text("{")
    assert drawn("mean", "constant") == other
    (mean,), (constant,) = other.models["mean"], other.models["constant"]
    assert (
        "from 15 s to 45 s; ToP of honest providers 1.00 before, 0.60 to 0.80 in it" in mean.words
    )
    assert "ToP of honest providers 0.50 before, 0.50 to 0.50 in it" in constant.words
    assert "nan" not in other.attacks["whitewashing"].words  # where an agent is absent


def test_the_command_of_every_attack_can_be_called():
    for name, entry in all_attackers().items():
        shown = how_shown(name, entry)
        assert refused(shown.command.replace("\\\n", "")) == ""
        assert parse_attacks(shown.texts, shown.scenario)


def test_every_attack_is_seated_where_it_attacks():
    shown = {name: how_shown(name, entry) for name, entry in all_attackers().items()}
    assert shown["on-off"].who == "2 of 10 providers"
    assert shown["silent"].who == "4 of 10 raters"
    assert shown["collusion"].who == "4 of 10 raters, 2 of 10 providers"
    assert shown["sybil"].texts == ("sp_10=sybil:reserve=3",)
    assert shown["learned"].scenario.name == "paper-3x3"


def test_printed_lines_that_came_in_pieces_are_whole():
    parts = ["rank  sc", "ore\n1  0.9", "6\n"]
    picture = new_output("display_data", {"image/png": ""})
    outputs = [*(new_output("stream", name="stdout", text=part) for part in parts), picture]
    outputs.insert(1, new_output("stream", name="stderr", text="careful\n"))
    printed, warned, shown = whole_streams(outputs)
    assert (printed["text"], warned["text"], shown) == (
        "rank  score\n1  0.96\n",
        "careful\n",
        picture,
    )


@pytest.mark.parametrize("name", sorted(scenarios()))
def test_scenarios_are_shown_as_files_that_can_be_read(name, tmp_path):
    scenario = make_scenario(name).change(description='a "quoted" \\ name\n\x7f')
    (tmp_path / f"{name}.toml").write_text(as_toml(scenario), encoding="utf-8")
    assert make_scenario(tmp_path / f"{name}.toml") == scenario
