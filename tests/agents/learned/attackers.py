"""Attackers that have learned nothing, and their files, for the tests of saved attackers."""

import json

import numpy as np

from roletrust_agents.learned.cards import (
    Card,
    InputCard,
    ModelCard,
    Price,
    ScoreCard,
    TaskCard,
    TrainingCard,
    observation_fields,
)
from roletrust_agents.learned.network import Architecture, Network
from roletrust_agents.learned.saved import SavedAttacker, digest, save_attacker, task_from_card
from roletrust_agents.learned.weights import weights_bytes
from roletrust_env import Random, make_scenario
from roletrust_env.game.attack_task import AttackTask

MODEL = ModelCard(name="role-trust", parameters={"lam": 0.5, "initial": 0.5})


def attacker_of(
    agents=("sp_2",),
    scenario="paper-3x3",
    *,
    lstm=0,
    hidden=(8,),
    heads=(),
    knowledge="black_box",
    seed=0,
    **rules,
):
    """An attacker that has learned nothing: its weights are random."""
    rules = make_scenario(scenario).change(noise=0.0, max_cycles=12, **rules)
    task = TaskCard(
        id="RoleTrust/Test-v0",
        compromised=agents,
        objective="damage",
        stealth=Price(),
        knowledge=knowledge,
    )
    made = task_from_card(task, MODEL, rules)
    k = observed(made)
    shape = Architecture(inputs=k, outputs=made.action_size, hidden=hidden, lstm=lstm, heads=heads)
    rng = np.random.default_rng(seed)
    weights = {
        name: rng.standard_normal(size).astype(np.float32) for name, size in shape.shapes().items()
    }
    network = Network(shape, np.full(k, 0.5, np.float32), np.full(k, 0.1, np.float32), weights)
    card = Card(
        package_version="0",
        task=task,
        trust_model=MODEL,
        scenario=rules,
        observation=InputCard(
            fields=observation_fields(rules, agents, knowledge, k),
            mean=tuple(network.mean.tolist()),
            variance=tuple(network.variance.tolist()),
        ),
        architecture=shape,
        training=TrainingCard(algorithm="none", steps=0, seed=seed, seconds=0.0),
        score=ScoreCard(mean=0.0, half_95=0.0, games=1, seed=0, honest=0.0),
        weights_sha256=digest(weights_bytes(network)),
    )
    return SavedAttacker(card, network)


def observed(task: AttackTask) -> int:
    rng = Random(np.random.default_rng(0), np.zeros((), np.float32))
    return task.observe(task.start(task.game.draw(rng, (), start=True), rng)).shape[0]


def files_of(attacker):
    files = {}
    save_attacker(
        attacker,
        __import__("pathlib").Path("x"),
        lambda path, data: files.__setitem__(path.suffix, data),
    )
    return files[".json"], files[".safetensors"]


def changed(attacker, change):
    """The files, after a change to what the JSON says."""
    text, data = files_of(attacker)
    said = json.loads(text)
    change(said)
    return json.dumps(said).encode(), data
