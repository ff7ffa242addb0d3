"""Networks of several heads: their forward pass output by output, their files, and what of them is
refused."""

import numpy as np
import pytest
from attackers import attacker_of, changed, files_of
from refusals import refuses

from roletrust_agents.learned.network import Head
from roletrust_agents.learned.policy import play_task
from roletrust_agents.learned.saved import parse_attacker

# The agent sp_2 and the raters sr_0 and sr_1 in paper-3x3: a quality, then twice three ratings.
HEADS = (
    Head(outputs=(1, 4, 2, 5, 3, 6), sees=((10, 40), (27, 41), (11, 0), (28, 1), (12, 2), (29, 3))),
    Head(outputs=(0,), sees=((7, 0, 5),)),
)


def coalition(**options):
    return attacker_of(("sp_2", "sr_0", "sr_1"), heads=HEADS, hidden=(5, 4), **options)


def test_the_forward_pass_is_that_of_each_output():
    network = coalition().network
    w, seen = network.weights, np.random.default_rng(0).random((network.architecture.inputs, 3))
    action, _ = network(seen)
    x = np.clip((seen - 0.5) / np.sqrt(np.float32(0.1)), -10, 10)
    for h, head in enumerate(HEADS):
        for k, (output, places) in enumerate(zip(head.outputs, head.sees, strict=True)):
            for game in range(3):
                y = np.array([x[place, game] for place in places])
                y = np.tanh(
                    w[f"head{h}.layer0.weight"] @ y
                    + w[f"head{h}.layer0.bias"]
                    + w[f"head{h}.own"][k]
                )
                y = np.tanh(w[f"head{h}.layer1.weight"] @ y + w[f"head{h}.layer1.bias"])
                y = w[f"head{h}.layer2.weight"] @ y + w[f"head{h}.layer2.bias"]
                assert action[output, game] == pytest.approx(
                    np.clip(y[0], -1, 1) / 2 + 0.5, abs=1e-6
                )


def test_batches_of_any_shape_and_torch():
    torch = pytest.importorskip("torch")
    network = coalition().network
    seen = np.random.default_rng(0).random((network.architecture.inputs, 2, 3))
    action, _ = network(seen)
    assert action.shape == (7, 2, 3)
    assert np.allclose(network(seen[:, 1, 2])[0], action[:, 1, 2], atol=1e-6)
    assert np.allclose(network(torch.as_tensor(seen))[0].numpy(), action, atol=1e-6)


def test_what_is_saved_is_what_is_loaded():
    saved = coalition()
    loaded = parse_attacker(*files_of(saved))
    assert loaded.card == saved.card
    scores = [
        play_task(saved.task(), attacker.network, games=2, seed=0) for attacker in (saved, loaded)
    ]
    assert scores[0].tolist() == scores[1].tolist()


def test_files_from_before_there_were_heads_load():
    attacker = attacker_of()
    assert (
        parse_attacker(*changed(attacker, lambda said: said["architecture"].pop("heads"))).card
        == attacker.card
    )


def first(said):
    return said["architecture"]["heads"][0]


CHANGES = [
    (lambda said: first(said)["outputs"].__setitem__(0, 2), ("outputs", "7")),
    (lambda said: first(said)["outputs"].__setitem__(0, 7), ("7",)),
    (lambda said: first(said)["sees"].pop(), ("inputs",)),
    (lambda said: first(said)["sees"][2].pop(), ("inputs", "1")),
    (lambda said: first(said).update(sees=[[]] * 6), ("inputs", "1")),
    (lambda said: first(said)["sees"][0].__setitem__(0, 44), ("44",)),
    (lambda said: first(said)["sees"][0].__setitem__(0, -1), ("-1",)),
    (lambda said: first(said)["sees"][0].__setitem__(0, 1.5), ("1.5",)),
    (lambda said: said["architecture"].update(lstm=4), ("LSTM",)),
    (lambda said: said["architecture"].update(hidden=[]), ("LSTM",)),
    (lambda said: said["architecture"].update(hidden=[4096] * 5), ("470147079", "400000000")),
    (lambda said: said["architecture"].update(heads=[]), ("weights", "head0.layer0.bias")),
    (lambda said: said["architecture"].update(hidden=[5, 5]), ("head0.layer1.weight", "(5, 5)")),
    (lambda said: said["architecture"]["heads"].reverse(), ("head0.own", "(1, 5)")),
]


@pytest.mark.parametrize(("change", "words"), CHANGES)
def test_what_does_not_fit_is_refused(change, words):
    with refuses(ValueError, *words):
        parse_attacker(*changed(coalition(), change))
