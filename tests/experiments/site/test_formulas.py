"""Every trust model and every attack has a typeset formula, whose parameters are those of the class."""

import inspect
import re

import pytest
from latex2mathml.converter import convert

import roletrust_env
from roletrust_env.game.policy import registry as attackers
from roletrust_env.trust.model import registry as models
from roletrust_env.trust.models.log_models import LOG_MODELS
from roletrust_experiments.site.docstrings import readable
from roletrust_experiments.site.formulas import formula_of, formulas, typeset

NAMES = [("models", name) for name in roletrust_env.trust_models()]
NAMES += [("attacks", name) for name in roletrust_env.attackers()]
NAMES += [("neighbours", name) for name in LOG_MODELS]
_WORDS = {"start", "stop"}


def factory(kind, name):
    return LOG_MODELS[name] if kind == "neighbours" else {"models": models, "attacks": attackers}[kind].factory(name)


@pytest.mark.parametrize(("kind", "name"), NAMES)
def test_each_has_a_formula(kind, name):
    rows = formula_of(factory(kind, name))
    assert rows
    latex = "\n".join(line.strip() for line in typeset(rows)[2:])
    markup = convert(latex, display="block")
    assert markup.count("<mtr>") >= len(rows)
    assert "<mi>&</mi>" not in markup


@pytest.mark.parametrize(("kind", "name"), NAMES)
def test_its_parameters_are_those_of_the_class(kind, name):
    known = set(inspect.signature(factory(kind, name)).parameters) | _WORDS
    assert set(re.findall(r"\\textit\{(\w+)\}", formulas()[kind][name])) <= known


def test_no_formula_is_left_over():
    assert {(kind, name) for kind, latex in formulas().items() for name in latex} == set(NAMES)


def shown(name):
    thing = factory("models", name)
    lines = (inspect.getdoc(thing) or "").splitlines()
    readable(None, "class", "it", thing, None, lines)
    return lines


def test_it_takes_the_place_of_the_plain_one():
    lines = shown("beta")
    assert lines.count(".. math::") == 1
    assert not any("<-" in line for line in lines)
    assert lines[2] == ".. math::"


def test_without_a_plain_one_it_stands_after_the_first_paragraph():
    lines = shown("median")
    assert lines[1:3] == ["", ".. math::"]
    assert any("ByCentre" in line for line in lines)
