"""The command line as a whole: options, suggestions, completion, narrow terminals and the next command."""

import io
import re
import shlex

import pytest
import typer
from pages import refused
from rich.console import Console
from typer.testing import CliRunner

from roletrust_env.game.policy import registry as attackers
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.world.presets import scenarios
from roletrust_experiments.cli import app
from roletrust_experiments.commands import completion
from roletrust_experiments.commands.console import FittedTable, number_table, option, print_next
from roletrust_experiments.commands.figures import claims_table
from roletrust_experiments.paper.claims import Claim

LONG = "a-trust-model-with-quite-a-long-name:parameter=0.123456789,another=true"


def commands():
    """Each command with its words, those of `roletrust live` included."""
    root = typer.main.get_command(app)
    for name, late in root.commands.items():
        command = late.loaded
        if hasattr(command, "commands"):
            yield from ((f"{name} {part}", sub.loaded) for part, sub in command.commands.items())
        else:
            yield name, command


OPTIONS = [(name, one) for name, command in commands() for one in command.params if one.param_type_name == "option"]


def test_one_spelling_for_each_concept():
    spelled = {flag for _, one in OPTIONS for flag in one.opts}
    assert not spelled & {"--trust_model".replace("_", "-"), "--models", "--algo", "--algorithm", "--folder-out"}
    assert {"--model", "--attack", "--learner", "--out", "--json", "--force", "--seed", "--games", "--set"} <= spelled


@pytest.mark.parametrize("flag", ["--model", "--attack", "--learner", "--set"])
def test_one_grammar_for_each_concept(flag):
    grammars = {one.metavar for name, one in OPTIONS if flag in one.opts and name not in ("figures", "live demo")}
    expected = {
        "--attack": {"AGENT=NAME[:key=value,...]", "NAME[:key=value,...]"},
        "--set": {"FIELD=VALUE"},
    }
    assert grammars <= expected.get(flag, {"NAME[:key=value,...]"}), grammars


def test_the_help_of_every_option_is_a_sentence_and_flags_have_no_type():
    for name, one in OPTIONS:
        if name.startswith("live"):
            continue
        text = one.help or ""
        assert re.match(r"[A-Z]", text), (name, one.opts, text)
        assert text.endswith((".", "...")), (name, one.opts, text)
        assert not re.search(r"\bluck\b|^Of |^Who|^What|^That |need be", text), (name, one.opts, text)
        assert not (one.is_flag and one.metavar), (name, one.opts)
    result = CliRunner().invoke(app, ["play", "--help"], env={"COLUMNS": "80"})
    assert "<bool>" not in result.output


def complete(line):
    """What the shell offers at the end of a line, by typer's completion for bash."""
    words = line.split(" ")
    environment = {
        "_ROLETRUST_COMPLETE": "complete_bash",
        "COMP_WORDS": "\n".join(words),
        "COMP_CWORD": str(len(words) - 1),
    }
    return CliRunner().invoke(app, prog_name="roletrust", env=environment).stdout.split()


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("roletrust be", ["benchmark"]),
        ("roletrust play --model role", ["role-trust"]),
        ("roletrust train RaterAttack --model media", ["median"]),
        ("roletrust benchmark --model trim", ["trimmed-mean"]),
        ("roletrust benchmark --attack bad-m", ["bad-mouthing"]),
        ("roletrust play paper", ["paper-3x3", "paper-3x3-hog"]),
        ("roletrust train RaterAttack --scenario op", ["open-system"]),
        ("roletrust benchmark --suite learners-q", ["learners-quick"]),
        ("roletrust benchmark --learner rec", ["recurrent", "PPO"]),
        ("roletrust train Coll", ["CollusionAttack"]),
        ("roletrust train Rater", ["RaterAttack"]),
        ("roletrust train RaterAttack --learner recurrent", ["recurrent-PPO"]),
        ("roletrust train RaterAttack --objective mis", ["mislead"]),
    ],
)
def test_names_are_completed(line, offered):
    assert complete(line) == offered


def test_every_name_is_offered():
    assert set(complete("roletrust play --model ")) == set(trust_models.names())
    assert set(complete("roletrust benchmark --attack ")) == set(attackers.names())
    assert set(complete("roletrust play ")) >= set(scenarios())


def test_a_seated_attack_is_completed_in_two_steps():
    assert complete("roletrust play --attack sp_") == ["sp_0=", "sp_1=", "sp_2="]
    assert complete("roletrust play --attack sp_0=on-") == ["sp_0=on-off"]
    assert complete("roletrust play crowd-10x10 --attack sp_9") == ["sp_9="]
    assert complete("roletrust play nowhere --attack s") == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["paly"], "'play'"),
        (["play", "--modle", "mean"], "--model"),
        (["play", "papper-3x3"], "did you mean 'paper-3x3'?"),
        (["play", "--model", "meen"], "did you mean 'mean'?"),
        (["play", "--model", "mean:lamb=0.7"], "did you mean 'lam'?"),
        (["play", "--attack", "sp_0=onoff"], "did you mean 'on-off'?"),
        (["play", "--attack", "sp_0=on-off:strat=3"], "did you mean 'start'?"),
        (["play", "--set", "max_cycle=3"], "did you mean 'max_cycles'?"),
        (["train", "RateAttack"], "did you mean 'RaterAttack'?"),
        (["play", "--attack", "sr_0=bad-mouthing:lvl=0"], "did you mean 'level'?"),
        (["train", "RaterAttack", "--compromised", "sr2"], "did you mean 'sr_2'?"),
        (["train", "RaterAttack", "--objective", "damge"], "did you mean 'damage'?"),
        (["train", "RaterAttack", "--learner", "SCA"], "did you mean 'SAC'?"),
        (["train", "RaterAttack", "--learner", "SAC:gama=0.5"], "did you mean 'gamma'?"),
        (["benchmark", "--suite", "quik"], "did you mean 'quick'?"),
        (["list", "zoo", "provider-3x"], "did you mean 'provider-3x3'?"),
    ],
    ids=" ".join,
)
def test_a_name_that_is_nearly_right_is_suggested(arguments, message, tmp_path):
    result = CliRunner().invoke(app, arguments, env={"COLUMNS": "200"})
    assert result.exit_code == 2
    assert message in result.output


def printed(table, width):
    console = Console(file=io.StringIO(), width=width)
    console.print(table)
    return console.file.getvalue()


def first_column(text):
    """The folded cells of the first column, put together again."""
    return "".join(re.match(r" ?(\S*)", line)[1] for line in text.splitlines())


@pytest.mark.parametrize("width", [40, 60, 80, 200])
def test_a_long_name_is_never_cut(width):
    table = number_table("Leaderboard", "", "clean", "worst", "damage", "alarms", "AUC", "holds")
    table.add_row(LONG, ".912±.003", ".512±.013", ".123", ".045", ".612", "98%")
    text = printed(table, width)
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= width
    assert LONG in first_column(text)
    assert ".912±.003" in text
    for heading, value in {"damage": ".123", "alarms": ".045", "AUC": ".612", "holds": "98%"}.items():
        assert (value in text) or heading in text.partition("too narrow for:")[2]
    assert ("too narrow for" in text) == (width < 80)


@pytest.mark.parametrize("width", [60, 80])
def test_the_claims_of_the_paper_are_never_cut(width):
    claim = Claim(4, "steady: ToR_1,2", "down to 0.6", "0.59 ± 0.06", "0.592, 0.593", [], True)
    text = printed(claims_table("Su and Saint-Jore (2023), seen through a synthetic service", [claim]), width)
    assert "…" not in text
    assert "0.592," in text
    assert "0.593" in text


@pytest.mark.parametrize("width", ["60", "80"])
@pytest.mark.parametrize(
    "arguments",
    [
        ["list"],
        [
            "play",
            "--model",
            "regression-aligned",
            "--set",
            "max_cycles=12",
            "--games",
            "2",
            "--attack",
            "sr_2=bad-mouthing",
        ],
    ],
    ids=lambda arguments: arguments[0],
)
def test_commands_cut_nothing_in_a_narrow_terminal(arguments, width, tmp_path):
    out = [] if arguments[0] == "list" else ["--out", str(tmp_path)]
    result = CliRunner().invoke(app, [*arguments, *out], env={"COLUMNS": width, "TERM": "dumb"})
    assert result.exit_code == 0, result.output
    assert "…" not in result.output
    assert not re.search(r"±(?!\d?\.\d{3})", result.output.replace("± half", ""))
    tables = result.output.partition("Written")[0]
    if arguments[0] == "list":
        for name in [*scenarios(), *trust_models.names(), *attackers.names()]:
            assert re.search(rf"(^| ){re.escape(name)}( |$)", tables, re.MULTILINE), name


def test_columns_are_dropped_from_the_right():
    table = FittedTable("A table", needed=2)
    for heading in ("name", "first", "second", "third"):
        table.column(heading, "left" if heading == "name" else "right")
    table.add_row("short", "1" * 10, "2" * 10, "3" * 10)
    assert "3333333333" in printed(table, 60)
    narrow = printed(table, 30)
    assert "1111111111" in narrow
    assert "2222222222" not in narrow
    assert "too narrow for: second, third" in " ".join(narrow.split())


def test_the_next_command_can_be_copied(capsys):
    print_next("play", option("--model", ["role-trust", "mean"]), "--attack", "sr_[0-2]=bad-mouthing", None)
    line = capsys.readouterr().out.strip()
    assert line == "Next: roletrust play --model role-trust --model mean --attack 'sr_[0-2]=bad-mouthing'"


@pytest.mark.parametrize(
    "arguments",
    [
        ["list"],
        ["list", "scenarios"],
        ["list", "models"],
        ["play", "--set", "max_cycles=12"],
        ["play", "--set", "max_cycles=12", "--attack", "sr_2=bad-mouthing", "--seed", "3"],
        ["play", "--set", "max_cycles=12", "--attack", "sr_2=bad-mouthing", "--model", "mean", "--model", "median"],
        ["benchmark", "--dry-run", "--model", "mean"],
    ],
    ids=" ".join,
)
def test_a_command_ends_with_one_that_is_useful_next(arguments, tmp_path):
    out = [] if arguments[0] == "list" else ["--out", str(tmp_path)]
    result = CliRunner().invoke(app, [*arguments, *out], env={"COLUMNS": "60"})
    assert result.exit_code == 0, result.output
    last = result.output.strip().splitlines()[-1]
    assert last.startswith("Next: roletrust ")
    assert shlex.split(last)[2] in {name for name, _ in commands()}
    assert refused(last.removeprefix("Next: ")) == ""


def test_completion_of_tasks_gives_their_ids():
    assert ("RaterAttack", "RoleTrust/RaterAttack-v0") in completion.tasks("R")
