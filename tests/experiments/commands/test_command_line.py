"""The command line as a whole: options, suggestions and tables of 80 columns."""

import io
import os
import re
import subprocess
import sys

import pytest
import typer
from refusals import refuses
from rich.console import Console
from typer.testing import CliRunner

from roletrust_env.game.policy import registry as attackers
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.world.presets import scenarios
from roletrust_experiments import main
from roletrust_experiments.cli import app
from roletrust_experiments.commands.console import number_table
from roletrust_experiments.commands.figures import claims_table
from roletrust_experiments.paper.claims import Claim

LONG = "a-trust-model-with-quite-a-long-name:parameter=0.123456789,another=true"


def commands():
    """Each command with its words, those of groups included."""
    root = typer.main.get_command(app)
    for name, late in root.commands.items():
        command = late.loaded
        if hasattr(command, "commands"):
            yield from ((f"{name} {part}", sub.loaded) for part, sub in command.commands.items())
        else:
            yield name, command


OPTIONS = [
    (name, one)
    for name, command in commands()
    for one in command.params
    if one.param_type_name == "option"
]


def test_one_spelling_for_each_concept():
    spelled = {flag for _, one in OPTIONS for flag in one.opts}
    assert not spelled & {
        "--trust_model".replace("_", "-"),
        "--models",
        "--algo",
        "--algorithm",
        "--folder-out",
    }
    assert {
        "--model",
        "--attack",
        "--learner",
        "--out",
        "--json",
        "--seed",
        "--games",
        "--set",
    } <= spelled


@pytest.mark.parametrize("flag", ["--model", "--attack", "--learner", "--set"])
def test_one_grammar_for_each_concept(flag):
    grammars = {
        one.metavar
        for name, one in OPTIONS
        if flag in one.opts and name not in ("figures", "robots demo")
    }
    expected = {
        "--attack": {"AGENT=NAME[:key=value,...]", "NAME[:key=value,...]"},
        "--set": {"FIELD=VALUE", "KEY=VALUE"},
    }
    assert grammars <= expected.get(flag, {"NAME[:key=value,...]"}), grammars


def test_the_help_of_every_option_is_a_sentence_and_flags_have_no_type():
    for name, one in OPTIONS:
        text = one.help or ""
        assert re.match(r"[A-Z]", text), (name, one.opts, text)
        assert text.endswith((".", "...")), (name, one.opts, text)
        assert not re.search(r"\bluck\b|^Of |^Who|^What|^That |need be", text), (
            name,
            one.opts,
            text,
        )
        assert not (one.is_flag and one.metavar), (name, one.opts)
    result = CliRunner().invoke(app, ["play", "--help"], env={"COLUMNS": "80"})
    assert "<bool>" not in result.output


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
        (["train", "RaterAttack", "--set", 'compromised=["sr2"]'], "did you mean 'sr_2'?"),
        (["train", "RaterAttack", "--set", "objective=damge"], "'damage'"),
        (["train", "RaterAttack", "--learner", "SCA"], "did you mean 'SAC'?"),
        (["train", "RaterAttack", "--learner", "SAC:gama=0.5"], "did you mean 'gamma'?"),
        (["benchmark", "--suite", "quik"], "did you mean 'quick'?"),
    ],
    ids=" ".join,
)
def test_a_name_that_is_nearly_right_is_suggested(arguments, message, tmp_path):
    result = CliRunner().invoke(app, arguments, env={"COLUMNS": "200"})
    assert result.exit_code == 2
    assert message in result.output


ROLETRUST = [sys.executable, "-c", "from roletrust_experiments import main; main()"]


def test_letters_that_the_terminal_lacks_and_a_width_that_it_does_not_know_are_no_fault():
    around = {**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "0"}
    done = subprocess.run(
        [*ROLETRUST, "list", "models"], env=around, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert r"J\xf8sang" in done.stdout


def test_a_closed_input_and_a_reader_that_stops_are_no_fault():
    script = 'set -o pipefail; "$@" list models <&- | true; [ $? -lt 2 ] || [ $? = 141 ]'
    done = subprocess.run(["bash", "-c", script, "-", *ROLETRUST], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("", "")


def test_a_working_directory_that_is_gone_is_named_in_one_line(tmp_path, monkeypatch, capsys):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    with refuses(SystemExit, "2"):
        main()
    assert (
        capsys.readouterr().err
        == "roletrust needs a working directory, and this one has been deleted\n"
    )


def printed(table, width):
    console = Console(file=io.StringIO(), width=width)
    console.print(table)
    return console.file.getvalue()


def first_column(text):
    """The folded cells of the first column, put together again."""
    return "".join(re.match(r" ?(\S*)", line)[1] for line in text.splitlines())


@pytest.mark.parametrize("width", [80, 200])
def test_a_long_name_is_never_cut(width):
    table = number_table("Leaderboard", "", "clean", "worst", "damage", "alarms", "AUC", "holds")
    table.add_row(LONG, ".912±.003", ".512±.013", ".123", ".045", ".612", "98%")
    text = printed(table, width)
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= width
    assert LONG in first_column(text)
    assert ".912±.003" in text
    assert ".045" in text


@pytest.mark.parametrize("width", [60, 80])
def test_the_claims_of_the_paper_are_never_cut(width):
    claim = Claim(4, "steady: ToR_1,2", "down to 0.6", "0.59 ± 0.06", "0.592, 0.593", [], True)
    text = printed(
        claims_table("Su and Saint-Jore (2023), seen through a synthetic service", [claim]), width
    )
    assert "…" not in text
    assert "0.592," in text
    assert "0.593" in text


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
def test_commands_cut_nothing_in_a_narrow_terminal(arguments, tmp_path):
    out = [] if arguments[0] == "list" else ["--out", str(tmp_path)]
    result = CliRunner().invoke(app, [*arguments, *out], env={"COLUMNS": "80", "TERM": "dumb"})
    assert result.exit_code == 0, result.output
    assert "…" not in result.output
    assert not re.search(r"±(?!\d?\.\d{3})", result.output.replace("± half", ""))
    tables = result.output.partition("Written")[0]
    if arguments[0] == "list":
        for name in [*scenarios(), *trust_models.names(), *attackers.names()]:
            assert re.search(rf"(^| ){re.escape(name)}(,| |$)", tables, re.MULTILINE), name
