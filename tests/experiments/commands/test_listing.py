import json
import re
from dataclasses import dataclass

import pytest
from typer.testing import CliRunner

import roletrust_env
from roletrust_agents.learned.saved import zoo
from roletrust_env import Scenario, make_scenario, scenarios, trust_models
from roletrust_env.benchmarking import register_learner
from roletrust_env.evaluation.search import search_methods
from roletrust_env.trust import Mean, register_trust_model
from roletrust_experiments.catalogue import all_attackers, all_models
from roletrust_experiments.cli import app


def run(*arguments, width=120):
    return CliRunner().invoke(app, ["list", *arguments], env={"COLUMNS": str(width)})


@pytest.mark.parametrize("arguments", [[], ["scenarios"], ["models"], ["attackers"]])
def test_list(arguments):
    result = run(*arguments)
    assert result.exit_code == 0
    assert all(name in result.output for name in scenarios()) == (arguments in ([], ["scenarios"]))
    assert all(name in result.output for name in trust_models()) == (arguments in ([], ["models"]))
    assert ("whitewashing" in result.output) == (arguments in ([], ["attackers"]))


class Steady:
    """Plays one quality in every round."""

    def __init__(self, quality: float = 0.4) -> None:
        self.quality = quality

    def learn(self, env, budget, seed):
        return lambda seen: seen[:, :1] * 0 + self.quality


def test_learners_are_listed_with_those_of_others():
    register_learner("steady", Steady)
    printed = " ".join(run("learners").output.split())
    assert all(name in printed for name in search_methods.names())
    assert "Plays one quality in every round. quality=0.4" in printed
    assert "steady" in run().output
    learners = json.loads(run("learners", "--json").output)["learners"]
    assert list(learners) == [*search_methods.names(), "steady"]
    assert learners["steady"]["parameters"]["quality"]["default"] == 0.4


def test_list_of_nothing_known():
    assert run("planets").exit_code == 2


@pytest.mark.parametrize("width", [80, 120])
def test_it_is_readable(width):
    lines = [
        line
        for kind in ("scenarios", "models", "attackers")
        for line in run(kind, width=width).output.splitlines()
    ]
    assert max(map(len, lines)) <= width
    for name in [*scenarios(), *trust_models(), *roletrust_env.attackers()]:
        assert any(line.split()[:1] == [name] for line in lines), name  # no name is cut or wrapped
    for said in ("lam=0.5  0.5 to below 1", "period=2  1 to 12", "targets=None  some honest"):
        assert any(said in line for line in lines)


def test_the_names_fit_a_screen():
    lines = run(width=80).output.splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert {*scenarios(), *trust_models(), *roletrust_env.attackers()} <= set(
        re.split(r"[\s,]+", "\n".join(lines))
    )


def test_models_say_what_they_are_unfit_for():
    words = re.sub(r"\s+", " ", run("models", width=200).output)
    assert re.search(r" travos .* personal, Teacy et al. \(2006\) .* cost grows as S\^2 P", words)
    assert all_models()["median"]["differentiable"] is False
    assert words.count("unfit: no trust in raters") == sum(
        not model["rates_raters"] for model in all_models().values()
    )


def test_every_parameter_has_a_meaning():
    for name, entry in (all_models() | all_attackers()).items():
        assert all(parameter["meaning"] for parameter in entry["parameters"].values()), name
    assert all_attackers()["sybil-ring"]["parameters"]["cut"]["meaning"].startswith(
        "Rank down to which"
    )  # of a base


def test_what_is_searched_is_what_attacks_declare():
    attackers = all_attackers()
    on_off, collusion = attackers["on-off"], attackers["collusion"]["parameters"]
    assert on_off["channels"] == ["quality"]
    said = {
        "default": 2,
        "required": False,
        "allowed": "whole number from 1",
        "searched": {"low": 1, "high": 12},
    }
    period = on_off["parameters"]["period"]
    assert period == {**said, "given": False, "meaning": period["meaning"]}
    assert on_off["parameters"]["switching"]["searched"] is None  # it is kept
    assert attackers["bad-mouthing"]["parameters"]["lie"]["searched"] == {
        "options": ["constant", "relative"]
    }
    assert attackers["bad-mouthing"]["parameters"]["targets"]["searched"] == "victims"
    assert (collusion["accomplices"]["required"], collusion["accomplices"]["given"]) == (True, True)
    assert attackers["sybil"]["parameters"]["serves"]["default"].startswith(
        "on-off:period=2,duty=1"
    )


def test_plug_ins_are_described_and_a_broken_one_spoils_nothing(install):
    learned = all_attackers()["learned"]
    assert learned["description"].startswith("Trained attacker")
    assert learned["channels"] is None  # only what it makes has some
    for group in ("scenarios", "trust_models", "attackers"):
        install(f"broken_{group}", f"roletrust_env.{group}", "", "broken = no_such_module:made")
    assert "no_such_module" in all_models()["broken"]["error"]
    result = run()
    assert result.exit_code == 0
    assert result.output.count("'no_such_module:made'") == 3
    assert "on-off" in result.output


@dataclass(frozen=True)
class Unreadable(roletrust_env.Policy):
    """Has a type that is nowhere to be found."""

    delay: "dataclass.nothing" = 1


@dataclass(frozen=True)
class Endless(roletrust_env.Policy):
    """Has a default that JSON does not know."""

    wait: float = float("inf")


def test_what_others_register_is_listed_as_far_as_it_can_be_read():
    roletrust_env.register_attacker("unreadable", Unreadable)
    roletrust_env.register_attacker("endless", Endless)
    register_trust_model("made-mean", lambda lam=0.7: Mean(lam=lam))
    assert "nothing" in all_attackers()["unreadable"]["error"]
    assert document("attackers")["attackers"]["endless"]["parameters"]["wait"]["default"] == "inf"
    mean = all_models()["made-mean"]
    assert mean["rates_raters"] is False  # as the model that it makes says
    assert mean["parameters"] == {
        "lam": {"default": 0.7, "required": False, "allowed": "", "meaning": ""}
    }
    assert run().exit_code == 0


def document(*arguments):
    result = run(*arguments, "--json", width=30)
    assert (result.exit_code, result.stderr) == (0, "")
    return json.loads(result.stdout)


def test_json_holds_all_there_is():
    found = document()
    assert {kind: set(entries) for kind, entries in found.items()} == {
        "scenarios": set(scenarios()),
        "models": set(trust_models()),
        "attackers": set(roletrust_env.attackers()),
        "learners": set(search_methods.names()),
        "zoo": set(zoo()),
    }
    for name, fields in found["scenarios"].items():
        assert Scenario(**fields) == make_scenario(name)  # all fields, and as they are in a file
    travos = found["models"]["travos"]
    assert {
        key: travos[key] for key in ("family", "source", "differentiable", "cost", "rates_raters")
    } == {
        "family": "personal",
        "source": "Teacy et al. (2006)",
        "differentiable": False,
        "cost": "S^2 P",
        "rates_raters": True,
    }
    error = travos["parameters"]["error"]
    assert (error["default"], error["required"], error["allowed"]) == (0.2, False, "0 to 1")
    assert found["attackers"] == all_attackers()


@pytest.mark.parametrize("kind", ["scenarios", "models", "attackers"])
def test_json_of_one_kind(kind):
    assert list(document(kind)) == [kind]
