import random
import sys
from dataclasses import replace

import numpy as np
import pytest
from attackers import attacker_of, changed, files_of
from refusals import refuses

from roletrust_agents.learned.cards import Card
from roletrust_agents.learned.policy import LearnedBoth, learned, learned_policy, play_task
from roletrust_agents.learned.saved import digest, load_attacker, parse_attacker, save_attacker
from roletrust_env import Game, JointPolicy, Player, Policy, Random, make_scenario, parallel_env
from roletrust_env.game.rollout import record
from roletrust_env.game.views import AgentView


def test_what_is_saved_is_what_is_loaded(tmp_path):
    saved = attacker_of(("sr_2",), lstm=4)
    save_attacker(saved, tmp_path / "attacker", lambda path, data: path.write_bytes(data))
    for path in (
        tmp_path,
        tmp_path / "attacker",
        tmp_path / "attacker.json",
        tmp_path / "attacker.safetensors",
    ):
        loaded = load_attacker(path)
        assert loaded.card == saved.card
        assert all(
            (loaded.network.weights[name] == w).all() for name, w in saved.network.weights.items()
        )


@pytest.mark.parametrize("agent", ["sp_2", "sr_1"])
@pytest.mark.parametrize("lstm", [0, 4])
def test_the_policy_plays_as_the_attacker_does_in_its_task(agent, lstm):
    attacker = attacker_of((agent,), lstm=lstm)
    score = play_task(attacker.task(), attacker.network, games=3, seed=1)
    joint_policy = JointPolicy(attacker.task().game, {agent: learned_policy(attacker)})
    history = record(joint_policy, Random(np.random.default_rng(1), np.zeros((), np.float32)), (3,))
    honest = [j for j in range(3) if agent != f"sp_{j}"]
    assert np.allclose((1 - history.top[:, honest]).mean(axis=(0, 1)), score, atol=1e-6)


def test_the_policy_plays_in_a_pettingzoo_game_as_in_a_batch():
    attacker = attacker_of(("sr_1",), lstm=4)
    env = parallel_env(attacker.card.scenario)
    policies = {
        name: learned_policy(attacker) if name == "sr_1" else Policy()
        for name in env.possible_agents
    }
    players = {name: Player(policy, name, env.layout) for name, policy in policies.items()}
    seen, _ = env.reset(seed=0)
    damage = []
    while env.agents:
        seen, _, _, _, infos = env.step({name: players[name](seen[name]) for name in env.agents})
        damage.append(np.mean([1 - infos[f"sp_{j}"]["trust"] for j in range(3)]))
    assert np.mean(damage) == pytest.approx(
        play_task(attacker.task(), attacker.network, games=1, seed=0)[0], abs=1e-6
    )


def test_it_plays_on_torch_and_several_agents_share_it():
    torch = pytest.importorskip("torch")
    attacker = attacker_of(("sp_2",))
    policy = learned_policy(attacker)
    numpy_game = Game(attacker.card.scenario)
    torch_game = Game(attacker.card.scenario, like=torch.zeros((), dtype=torch.float64))
    joint_policy = {"sp_0": policy, "sp_2": policy}
    a = record(JointPolicy(numpy_game, joint_policy), Random(np.random.default_rng(0)), (2,))
    b = record(
        JointPolicy(torch_game, joint_policy),
        Random(np.random.default_rng(0), torch.zeros((), dtype=torch.float64)),
        (2,),
    )
    assert np.allclose(a.top, b.top.numpy(), atol=1e-6)


def test_an_agent_with_both_roles_decides_on_both_at_once():
    attacker = attacker_of(("srsp_5",), "peers", lstm=3)
    policy = learned_policy(attacker)
    assert isinstance(policy, LearnedBoth)
    observation = np.random.default_rng(0).random((attacker.card.architecture.inputs, 5))
    view = attacker.layout.both(observation)
    flat = attacker.layout.flatten_both(AgentView(*view))
    quality, ratings, memory = policy.both(
        view, policy.begin(Random(np.random.default_rng(0)), (5,)), None
    )
    action, after = attacker.network(flat, attacker.network.begin(flat[0]))
    assert np.allclose(quality, action[0])
    assert np.allclose(ratings, action[1:])
    assert np.allclose(memory, after)


@pytest.mark.skipif(
    not hasattr(Policy, "both"), reason="joint_policies do not ask both roles at once yet"
)
@pytest.mark.parametrize("lstm", [0, 4])
def test_an_agent_with_both_roles_plays_as_in_its_task(lstm):
    attacker = attacker_of(("srsp_5",), "peers", lstm=lstm)
    score = play_task(attacker.task(), attacker.network, games=2, seed=1)
    joint_policy = JointPolicy(attacker.task().game, {"srsp_5": learned_policy(attacker)})
    history = record(joint_policy, Random(np.random.default_rng(1), np.zeros((), np.float32)), (2,))
    honest = [j for j in range(9) if j != 5]
    assert np.allclose((1 - history.top[:, honest]).mean(axis=(0, 1)), score, atol=1e-6)


def test_the_forward_pass_is_that_of_torch():
    torch = pytest.importorskip("torch")
    network = attacker_of(("sr_0",), lstm=5, hidden=(7, 6)).network
    lstm = torch.nn.LSTM(network.architecture.inputs, 5)
    with torch.no_grad():
        for name, weight in (
            ("weight_ih_l0", "input"),
            ("weight_hh_l0", "hidden"),
            ("bias_ih_l0", "bias"),
        ):
            getattr(lstm, name).copy_(torch.as_tensor(network.weights[f"lstm.{weight}"]))
        lstm.bias_hh_l0.zero_()
        seen = (
            np.random.default_rng(0).random((4, network.architecture.inputs, 3)).astype(np.float32)
        )
        memory = network.begin(seen[0, 0])
        for row in seen:
            played, memory = network(row, memory)
        x = torch.as_tensor((seen - 0.5) / np.sqrt(np.float32(0.1))).clamp(-10, 10).swapaxes(1, 2)
        x = lstm(x)[0][-1]
        for i in range(3):
            w, b = (
                torch.as_tensor(network.weights[f"layer{i}.{part}"]) for part in ("weight", "bias")
            )
            x = x @ w.T + b
            x = torch.tanh(x) if i < 2 else x.clamp(-1, 1)
    assert np.allclose(played, x.numpy().T / 2 + 0.5, atol=1e-5)


def test_honest_play_is_the_scripted_one():
    attacker = attacker_of(("sr_0", "sp_1"))
    history = record(
        JointPolicy(attacker.task().game, {}),
        Random(np.random.default_rng(0), np.zeros((), np.float32)),
        (2,),
    )
    honest = (1 - history.top[:, [0, 2]]).mean(axis=(0, 1))
    assert np.allclose(play_task(attacker.task(), None, games=2, seed=0), honest, atol=1e-6)


@pytest.mark.parametrize("options", [{"agents": ("sr_0", "sr_1")}, {"knowledge": "grey_box"}])
def test_one_mind_or_more_knowledge_is_no_policy(options):
    attacker = attacker_of(**options)
    with refuses(ValueError, "play_task"):
        learned_policy(attacker)
    assert play_task(attacker.task(), attacker.network, games=2, seed=0).shape == (2,)


def test_white_box_attackers_are_saved_too():
    attacker = attacker_of(knowledge="white_box")
    assert parse_attacker(*files_of(attacker)).card == attacker.card


def test_a_game_of_another_size_is_refused():
    joint_policy = JointPolicy(
        Game(make_scenario("crowd-10x10")), {"sp_2": learned_policy(attacker_of())}
    )
    with refuses(ValueError, "LearnedProvider", "3"):
        record(joint_policy, Random(np.random.default_rng(0)))


def test_in_a_longer_game_its_clock_stands_still():
    policy = learned_policy(attacker_of())
    history = record(
        JointPolicy(Game(make_scenario("paper-3x3")), {"sp_2": policy}),
        Random(np.random.default_rng(0)),
    )
    assert history.quality.shape[0] == make_scenario("paper-3x3").max_cycles


CHANGES = [
    (lambda said: said.update(format="pickle"), ("format", "pickle")),
    (lambda said: said.update(format_version=2), ("format_version", "2")),
    (lambda said: said.update(code="import os"), ("code", "import os")),
    (lambda said: said.pop("scenario"), ("scenario",)),
    (lambda said: said.update(weights_sha256="0"), ("weights_sha256", "0")),
    (lambda said: said.update(weights_sha256="0" * 64), ("digest",)),
    (lambda said: said["task"].update(compromised=["sp_9"]), ("sp_9",)),
    (lambda said: said["task"].update(compromised=["sr_0"]), ("observation",)),
    (lambda said: said["observation"]["mean"].pop(), ("observation",)),
    (
        lambda said: said["observation"]["variance"].__setitem__(0, 0.0),
        ("observation.variance.0", "0.0"),
    ),
    (lambda said: said["architecture"].update(inputs=11), ("observation",)),
    (lambda said: said["architecture"].update(outputs=2), ("outputs",)),
    (lambda said: said["architecture"].update(hidden=[8, 8]), ("layer0.bias",)),
    (lambda said: said["architecture"].update(hidden=[9]), ("layer0.weight", "(9, 10)")),
    (lambda said: said["architecture"].update(hidden=[4096, 4096]), ("16830465", "4000000")),
    (lambda said: said["architecture"].update(lstm=-1), ("architecture.lstm", "-1")),
    (lambda said: said["architecture"].update(hidden=["8"]), ("architecture.hidden.0", "8")),
    (lambda said: said["score"].update(mean="high"), ("score.mean", "high")),
    (lambda said: said["scenario"]["agents"][0].update(count=50_000), ("10000",)),
    (lambda said: said["scenario"].update(max_cycles=10**9), ("1000000000",)),
    (lambda said: said["scenario"].update(lam=2), ("scenario.lam", "2")),
    (
        lambda said: said["trust_model"].update(parameters={"lam": [[]]}),
        ("trust_model.parameters.lam", "[[]]"),
    ),
]


@pytest.mark.parametrize(("change", "words"), CHANGES)
def test_what_does_not_fit_is_refused(change, words):
    with refuses(ValueError, *words):
        parse_attacker(*changed(attacker_of(), change))


def test_weights_that_fit_their_digest_but_not_the_network_are_refused():
    from safetensors.numpy import save

    attacker = attacker_of()
    weights = attacker.network.weights
    first = weights["layer0.weight"]
    cases = {
        ("safetensors",): b"\x80\x04\x95 a pickle",
        ("layer0.weight", "float16"): save({**weights, "layer0.weight": first.astype(np.float16)}),
        ("layer0.weight", "NaN"): save(
            {**weights, "layer0.weight": np.where(first > 0, np.nan, first)}
        ),
        ("extra",): save({**weights, "extra": first}),
        ("layer0.weight", "(10, 8)"): save({**weights, "layer0.weight": first.T.copy()}),
    }
    for words, data in cases.items():
        card = attacker.card.model_copy(update={"weights_sha256": digest(data)})
        with refuses(ValueError, *words):
            parse_attacker(card.model_dump_json().encode(), data)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"[" * 100_000, ("JSON",)),
        (b'{"format": NaN}', ("NaN",)),
        (b'{"format": 1, "format": 2}', ("JSON",)),
        (b"\xff\xfe", ("JSON",)),
        (b"", ("JSON",)),
        (b"[]", ("table",)),
        (b" " * 1_000_001, ("1000001", "1000000")),
    ],
)
def test_what_is_no_card_is_refused(text, words):
    with refuses(ValueError, *words):
        parse_attacker(text, b"")


def test_missing_files_and_other_weights_are_refused(tmp_path):
    attacker = attacker_of()
    with refuses(ValueError, str(tmp_path / "nobody.json")):
        load_attacker(tmp_path / "nobody")
    with refuses(ValueError, "digest"):
        save_attacker(
            replace(attacker, network=attacker_of(seed=1).network),
            tmp_path / "x",
            lambda path, data: None,
        )
    save_attacker(attacker, tmp_path / "x", lambda path, data: path.write_bytes(data))
    (tmp_path / "x.safetensors").write_bytes(files_of(attacker_of(seed=1))[1])
    with refuses(ValueError, tmp_path / "x", "digest"):
        learned(str(tmp_path / "x.json"))


def damaged(rng, data):
    """The bytes with one changed, some cut, some swapped, or some of them twice."""
    found = bytearray(data)
    i, j = sorted(rng.sample(range(len(found)), 2))
    kind = rng.randrange(5)
    if kind == 0:
        found[i] = rng.randrange(256)
    elif kind == 1:
        del found[i:j]
    elif kind == 2:
        del found[i:]
    elif kind == 3:
        found[i], found[j] = found[j], found[i]
    else:
        found[i:i] = found[i : i + rng.randrange(1, 200)]
    return bytes(found)


@pytest.mark.parametrize("sealed", [False, True], ids=["as they are", "with a digest made to fit"])
def test_damaged_files_are_refused_or_load_as_what_they_are(sealed):
    rng, attacker = random.Random(0), attacker_of(hidden=(2,))
    text, data = files_of(attacker)
    outcomes = {"refused": 0, "loaded": 0}
    for case in range(400):
        hurt, weights = (
            (damaged(rng, text), data) if case % 2 and not sealed else (text, damaged(rng, data))
        )
        if sealed:
            hurt = text.replace(attacker.card.weights_sha256.encode(), digest(weights).encode())
        try:
            loaded = parse_attacker(hurt, weights)
        except ValueError:
            outcomes["refused"] += 1
            continue
        outcomes["loaded"] += 1
        assert loaded.card.model_dump(mode="json") == Card.model_validate_json(hurt).model_dump(
            mode="json"
        )
        action, _ = loaded.network(np.zeros((loaded.card.architecture.inputs, 2)))
        assert ((action >= 0) & (action <= 1)).all()
    assert outcomes["refused"] > 100


def test_loading_runs_no_code_and_opens_no_other_file():
    """Not even a trust model's package is imported: the card only names it."""
    files = changed(attacker_of(), lambda said: said["trust_model"].update(name="evil-plug-in"))
    parse_attacker(*files)  # what is imported at first use is imported now
    events = []
    watching = True
    sys.addaudithook(lambda event, _: events.append(event) if watching else None)
    loaded = parse_attacker(*files)
    watching = False
    assert not {
        "import",
        "exec",
        "compile",
        "open",
        "pickle.find_class",
        "os.system",
        "subprocess.Popen",
    } & set(events)
    with refuses(ValueError, "evil-plug-in"):
        loaded.task()
