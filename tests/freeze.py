"""What the code computes, as SHA-256 digests, so that a change of form can be told from a change of
numbers.

    python tests/freeze.py write base.json
    python tests/freeze.py compare base.json --only games --sample 10

`write` computes the digests of all cases, or of those of some sections, and puts them into a file;
sections that it has are replaced. `compare` computes the cases that the file has and names those
that differ. With `--sample N` one case in N is computed, the same ones at each call; `--quick` is
`--sample 25`. Digests hold for one machine and one set of versions: another processor may round
otherwise.

Only what the package exports is used, but for the functions in the first part of the file.
"""

import argparse
import contextlib
import csv
import hashlib
import inspect
import io
import json
import os
import sys
import tempfile
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # sums of several threads are added in another order

import numpy as np
import torch
from freeze_faces import ROUNDS, faces

import roletrust_env as rt
from roletrust_env.logs import TrustStream
from roletrust_env.trust import Traits

torch.set_num_threads(1)
DOCS = Path(__file__).parent.parent / "docs"
Case = tuple[str, Callable[[], Any]]
"""The name of a case, and a function that computes its numbers: arrays, numbers, texts, or
containers of them."""


# What is not exported, and may get other names.


def board(models: list[str]) -> list[Any]:
    """The leaderboard of the suite `quick`: its rows as in a CSV file, and the games of each cell,
    without times."""
    from roletrust_env.benchmarking import benchmark

    result = benchmark(models, "quick", workers=0, progress=False)
    with tempfile.TemporaryDirectory() as folder:
        result.to_csv(Path(folder) / "board.csv")
        rows = list(csv.reader((Path(folder) / "board.csv").open()))
    cases = [[*key, *case] for key, case in sorted(result.worst_cases.items())]
    return [rows, cases]


def zoo_names() -> list[str]:
    """The attackers that come with the project."""
    from roletrust_agents.learned.saved import zoo

    return zoo()


def zoo_scores(name: str) -> Any:
    """The scores of a saved attacker in its own task."""
    from roletrust_agents.learned.policy import play_task
    from roletrust_agents.learned.saved import load_attacker

    attacker = load_attacker(name)
    return play_task(attacker.task(), attacker.network, games=8, seed=0)


def journal(model: Any, path: Path, rounds: Any, teams: list[Any]) -> list[Any]:
    """The bytes of a manager's journal, and the trust after its replay. `rounds` has one entry for
    each of `teams`."""
    from roletrust_manager.dds.team_run import TeamRun, grows
    from roletrust_manager.dds.team_trust import replay_rounds
    from roletrust_manager.journal.lines import Journal, JournalEntry, read_journal
    from roletrust_manager.team import Team

    growing = grows(model)
    team_run = TeamRun(model, Team(*teams[0 if growing else -1]))
    with Journal(path, {"model": repr(model)}) as file:
        for number, (ratings, team) in enumerate(zip(rounds, teams, strict=True)):
            team = Team(*team) if growing else team_run.team
            if team_run.team != team:
                team_run.grow(team)
            team_run.play_named(ratings)
            file.append(
                JournalEntry(
                    number, 500 * number, 500 * number + 20, team, ratings, (), team_run.trust
                )
            )
    return [
        path.read_bytes(),
        tuple(
            replay_rounds(model, read_journal(path), None if growing else team_run.team, path).trust
        ),
    ]


def search_names() -> list[str]:
    """The search methods by name, without those that need a saved result or learn for long."""
    from roletrust_env.evaluation.search import search_methods

    return [*(name for name in search_methods.describe() if name != "universal"), "exact"]


def searched(name: str, arguments: dict[str, Any], budget: int) -> Any:
    """The attack that a search method finds: its words, its rounds, and its rewards in held-out
    games."""
    from roletrust_env.evaluation.search import UnsuitableError, bounds, find, search_methods

    try:
        method = (bounds if name in bounds.names() else search_methods).make(name)
        found = find(method, arguments, budget=budget, seed=0, games=4)
    except UnsuitableError:
        return "unsuitable"
    return [found.description, found.rounds, found.scores, found.objective, found.cost]


def attacker(name: str, facts: dict[str, Any]) -> Any:
    """An attacker by name, with those of some facts that are its parameters."""
    from roletrust_env.game.policy import registry

    return rt.make_attacker(name, **registry.accepted_parameters(name, facts))


def rate(arguments: list[str]) -> Any:
    """What `roletrust rate` writes."""
    from roletrust_experiments.cli import app

    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        app(["rate", *arguments, "--out", folder], standalone_mode=False)
        return [[path.name, path.read_bytes()] for path in sorted(Path(folder).glob("*.csv"))]


# The cases.

BAD = {"on-off": {"period": 4}, "bad-mouthing": {"start": 3}}
LIKES = {"numpy": np.zeros(()), "torch": torch.zeros((), dtype=torch.float64)}
CENTRAL = [
    name for name in rt.trust_models() if Traits.of(rt.make_trust_model(name)).family == "central"
]


def games() -> Iterator[Case]:
    """Whole games in every preset, under every trust model, on every library: one game, and a
    batch."""
    for preset in rt.scenarios():
        for model in rt.trust_models():
            for library, like in LIKES.items():
                for batch in ((), (3,)):
                    if preset == "city" or (
                        preset == "paper-3x3-hog" and (batch or library == "torch")
                    ):
                        continue  # a city is a sparse game; cameras are slow, and need NumPy
                    name = f"{preset} {model} {library} {'batch' if batch else 'one'}"
                    yield name, lambda p=preset, m=model, k=like, b=batch: played(p, m, k, b)


def played(preset: str, model: str, like: Any, batch: tuple[int, ...]) -> Any:
    """The record of games in which a provider and a rater attack."""
    game = rt.Game(rt.make_scenario(preset).change(max_cycles=ROUNDS.get(preset, 24)), model, like)
    provider, rater = game.roster.provider_names[0], game.roster.rater_names[-1]
    policies = {
        agent: rt.make_attacker(name, **BAD[name])
        for agent, name in ((provider, "on-off"), (rater, "bad-mouthing"))
    }
    return rt.record(rt.JointPolicy(game, policies), game.random(0), batch)


def edges() -> Iterator[Case]:
    """Every central model on a million ratings in five rounds: four large ones, and one of few
    agents."""
    for model in CENTRAL:
        for same in (False, True):
            yield (
                f"{model} {'one role' if not same else 'same agents'}",
                lambda m=model, s=same: million(m, s),
            )


def million(model: str, same_agents: bool) -> Any:
    """The trust of all agents after each round."""
    random, stream = (
        np.random.default_rng(0),
        TrustStream(rt.make_trust_model(model), same_agents=same_agents),
    )
    known, trust = (np.zeros(0, np.int64),) * 2, []
    for size in (400_000, 300_000, 200_000, 99_500, 500):
        half = min(len(known[0]), size) // 8
        raters = np.concatenate(
            [known[0][:half], (120_000 * random.random(size - half) ** 2).astype(np.int64)]
        )
        providers = np.concatenate(
            [known[1][:half], (30_000 * random.random(size - half) ** 2).astype(np.int64)]
        )
        providers[raters == providers] += 30_000 * same_agents
        known = raters, providers
        stream.update(raters, providers, random.integers(0, 11, size) / 10)
        trust.append(
            [
                [list(side), list(side.values())]
                for side in (stream.rater_trust(), stream.provider_trust())
            ]
        )
    return [np.array(column) for pair in trust for side in pair for column in side]


def streams() -> Iterator[Case]:
    """Streams that are saved and go on, and what `roletrust rate` makes of a log."""
    for model in CENTRAL:
        for same in (False, True):
            yield (
                f"{model} {'one role' if not same else 'same agents'}",
                lambda m=model, s=same: saved(m, s),
            )
    log = [("--every", "10"), ()]
    for model in (
        "role-trust",
        "leave-one-out",
        "eigentrust",
        "beta-filtered",
        "travos",
        "fire",
        "qor",
    ):
        for rounds in log:
            for same in ((), ("--set", "same_agents=true")):
                name = " ".join(["rate", model, *rounds, *(["--same-agents"] if same else [])])
                yield name, lambda m=model, r=rounds, s=same: rated(["--model", m, *r, *s])


def ratings(seed: int, size: int = 300) -> Any:
    """Raters, providers, ratings from 1 to 5, and ascending times."""
    random = np.random.default_rng(seed)
    raters, providers = random.integers(0, 25, size), random.integers(0, 15, size)
    return (
        raters,
        providers + (raters == providers),
        random.integers(1, 6, size),
        np.sort(random.random(size) * 100),
    )


def saved(model: str, same_agents: bool) -> Any:
    """The trust by name in a stream, before and after it is saved and loaded."""
    settings: Any = {"scale": (1, 5), "every": 7.0, "same_agents": same_agents}
    stream, found = TrustStream(rt.make_trust_model(model), **settings), []
    for part in range(6):
        raters, providers, values, times = ratings(part)
        stream.update(
            [f"a{n}" for n in raters], [f"a{n}" for n in providers], values, times + 100 * part
        )
        if part == 3:
            with tempfile.TemporaryDirectory() as folder:
                stream.save(Path(folder) / "state.npz")
                stream = TrustStream.load(
                    Path(folder) / "state.npz", rt.make_trust_model(model), **settings
                )
        found.append([stream.rater_trust(), stream.provider_trust(), stream.rounds])
    stream.finish()
    return [found, stream.rater_trust(), stream.provider_trust()]


def rated(arguments: list[str]) -> Any:
    """The files of `roletrust rate` for a log."""
    with tempfile.TemporaryDirectory() as folder:
        path, columns = Path(folder) / "log.csv", [column.tolist() for column in ratings(9, 900)]
        lines = [f"a{a},a{b},{value},{when}" for a, b, value, when in zip(*columns, strict=True)]
        path.write_text("\n".join(["rater,ratee,rating,time", *lines, ""]))
        return rate([str(path), "--scale", "1", "5", *arguments])


def sparse() -> Iterator[Case]:
    """Sparse games, and the same scenario on a grid."""
    groups = [
        {"role": "SR", "count": 40, "noise": 0.1},
        {"role": "SP", "count": 12, "ability": [0.3, 1.0]},
    ]
    fields: dict[str, Any] = {
        "agents": groups,
        "access": {"kind": "encounters", "providers": 3},
        "values": [1.0, 2.0],
    }
    market = rt.Scenario.model_validate({**fields, "ratings": {"lost": 0.2}, "max_cycles": 20})
    city = rt.make_scenario("city").change(max_cycles=4)
    for model in CENTRAL:
        for kind in (rt.SparseGame, rt.Game):
            yield f"market {model} {kind.__name__}", lambda m=model, k=kind: walked(k(market, m))
        yield f"city {model} SparseGame", lambda m=model: walked(rt.SparseGame(city, m))


def walked(game: rt.Game) -> Any:
    """All rounds of a game: trust, ratings, qualities and rewards."""
    attacks = {
        "sp_0": rt.make_attacker("on-off", period=4),
        "sr_3": rt.make_attacker("bad-mouthing"),
    }
    policy, random, found = rt.JointPolicy(game, attacks), game.random(0), []
    state = game.start(game.draw(random, start=True))
    memory = policy.begin(random, ())
    for _ in range(game.scenario.max_cycles):
        actions, memory = policy.checked_act(state, memory, random)
        state, rewards = game.step(state, actions, game.draw(random))
        found.append(
            [
                *game.published(state),
                game.agent_trust(state),
                rewards,
                state.ratings,
                state.rated,
                state.quality,
            ]
        )
    return found


def boards() -> Iterator[Case]:
    """The leaderboard of the suite `quick`: a few models beside each other, and each one alone."""
    yield "five models", lambda: board(["role-trust", "mean", "median", "beta", "travos"])
    for model in rt.trust_models():
        yield model, lambda m=model: board([m])


def journals() -> Iterator[Case]:
    """Journals of a growing team, and their replays."""
    for model in rt.trust_models():
        yield model, lambda m=model: kept_journal(m)


def kept_journal(model: str) -> Any:
    """A journal of 20 rounds; newcomers come twice, and ratings are missing."""
    random, teams, rounds = np.random.default_rng(0), [], []
    for number in range(20):
        size = 3 + number // 8
        teams.append((tuple(f"r{n}" for n in range(size)), tuple(f"p{n}" for n in range(size))))
        table = [
            [float(x) if x < 0.85 else None for x in row] for row in random.random((size, size))
        ]
        rounds.append({f"r{n}": row for n, row in enumerate(table)})
    with tempfile.TemporaryDirectory() as folder:
        return journal(rt.make_trust_model(model), Path(folder) / "journal.jsonl", rounds, teams)


def zoo() -> Iterator[Case]:
    """The attackers that come with the project."""
    for name in zoo_names():
        yield name, lambda n=name: zoo_scores(n)


GROUPS = [
    {"role": "SR", "count": 4, "noise": 0.1},
    {"role": "SP", "count": 4},
    {"role": "SR", "noise": 0.1, "reserve": 3},
    {"role": "SP", "reserve": 3},
    {"role": "SR+SP", "count": 2, "noise": 0.1},
]
FACTS = {"accomplices": (0, 4), "length": 30, "wakes_at": 0.5, "start": 3}


def attacks() -> Iterator[Case]:
    """Every scripted attack, on NumPy and on torch."""
    for name in rt.attackers():
        for library, like in LIKES.items():
            for model in ("role-trust", "wary-role-trust", "travos"):
                if name != "learned":
                    yield (
                        f"{name} {library} {model}",
                        lambda n=name, k=like, m=model: attacked(n, k, m),
                    )


def attacked(name: str, like: Any, model: str) -> Any:
    """The record of games in which a provider, a rater, or an agent of both roles attacks, whoever
    can."""
    fields = {
        "agents": GROUPS,
        "values": [1.0, 5.0],
        "access": {"kind": "choice", "providers": 3, "temperature": 0.2},
    }
    game, found = rt.Game(rt.Scenario.model_validate({**fields, "max_cycles": 30}), model, like), []
    for agent in ("sr_3", "sp_3", "sr_4", "sp_4", "srsp_1"):
        try:
            players = rt.JointPolicy(game, {agent: attacker(name, FACTS)})
            found.append([agent, rt.record(players, game.random(3), (2,))])
        except ValueError:  # it does not play this role, or needs a reserve
            continue
    assert found, name
    return found


def searches() -> Iterator[Case]:
    """What the search methods find with a small budget."""
    crowd = {
        "scenario": "crowd-10x10",
        "max_cycles": 10,
        "compromised": ("sr_8", "sr_9", "sp_9"),
        "objective": "damage",
    }
    alone = {
        "scenario": "paper-3x3",
        "max_cycles": 20,
        "compromised": ("sp_2",),
        "objective": "exploit",
    }
    certain = {**alone, "noise": 0.0, "perturbations": ()}
    budgets = {"SAC": 3_000, "evolution": 80_000, "evolution strategy": 40_000}
    for name in search_names():
        for task, arguments in (("crowd", crowd), ("alone", alone), ("certain", certain)):
            yield (
                f"{name} {task}",
                lambda n=name, a=arguments: searched(n, a, budgets.get(n, 12_000)),
            )


def tables() -> Iterator[Case]:
    """The tables of numbers in the documentation."""
    for path in sorted(DOCS.rglob("*.csv*")):
        yield str(path.relative_to(DOCS)), path.read_bytes


SECTIONS: dict[str, Callable[[], Iterator[Case]]] = {
    section.__name__: section
    for section in (
        *(games, faces, edges, streams, sparse, journals),
        *(zoo, attacks, searches, tables, boards),
    )
}


# The digests.


def digest(value: Any) -> str:
    """The SHA-256 of numbers, in hexadecimal: dtypes, shapes and bits, in order, without the names
    of fields."""
    sha = hashlib.sha256()

    def add(value: Any) -> None:
        if isinstance(value, dict):
            value = [[name, value[name]] for name in value]
        if isinstance(value, torch.Tensor):
            value = value.numpy()
        if isinstance(value, np.ndarray):
            sha.update(
                f"{value.dtype}{value.shape}".encode() + np.ascontiguousarray(value).tobytes()
            )
        elif isinstance(value, list | tuple):
            sha.update(f"[{len(value)}".encode())
            for one in value:
                add(one)
        elif isinstance(value, bytes):
            sha.update(value)
        elif value is None or isinstance(value, str | bool | int | float | np.generic):
            sha.update(repr(value).encode() + b";")
        else:
            raise TypeError(f"a case has a {type(value).__name__}, which has no digest")

    add(value)
    return sha.hexdigest()


def compute(section: str, sample: int, wanted: set[str] | None = None) -> dict[str, str]:
    """The digests of a section; a failure is one too."""
    found: dict[str, str] = {}
    cases = [
        (name, run) for name, run in SECTIONS[section]() if zlib.crc32(name.encode()) % sample == 0
    ]
    cases = [(name, run) for name, run in cases if wanted is None or name in wanted]
    began = time.perf_counter()
    for number, (name, run) in enumerate(cases, 1):
        try:
            found[name] = digest(run())
        except Exception as error:
            found[name] = f"{type(error).__name__}: {error}"
            print(f"\n{section}: {name}: {found[name]}", file=sys.stderr)
        print(
            f"\r{section}: {number} of {len(cases)}, {time.perf_counter() - began:.0f} s",
            end="",
            file=sys.stderr,
        )
    print(file=sys.stderr)
    return found


def write(path: Path, sections: list[str], sample: int) -> int:
    """Write digests, complete or not at all after each section."""
    stored = json.loads(path.read_text()) if path.exists() else {}
    for section in sections:
        stored[section] = compute(section, sample)
        path.with_suffix(".part").write_text(json.dumps(stored, indent=1) + "\n")
        os.replace(path.with_suffix(".part"), path)
    return 0


def compare(path: Path, sections: list[str], sample: int) -> int:
    """Name the cases whose digests differ and those that are gone; 1 if any, but for tables that
    left."""
    stored, wrong = json.loads(path.read_text()), 0
    for section in sections:
        before = {
            name: one
            for name, one in stored.get(section, {}).items()
            if zlib.crc32(name.encode()) % sample == 0
        }
        after = compute(
            section, sample, None if section == "tables" else set(before)
        )  # a table may have moved
        differ = [name for name in before if name in after and after[name] != before[name]]
        gone = [name for name in before if name not in after and before[name] not in after.values()]
        lines = [f"{section}: {name} differs" for name in differ] + [
            f"{section}: {name} is gone" for name in gone
        ]
        print(*lines, f"{section}: {len(before) - len(lines)} of {len(before)} equal", sep="\n")
        wrong += len(differ) + (0 if section == "tables" else len(gone))
    return int(wrong > 0)


def main() -> int:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=inspect.getdoc(sys.modules[__name__]),
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("command", choices=("write", "compare"))
    parser.add_argument("file", type=Path)
    parser.add_argument(
        "--only", action="append", choices=SECTIONS, help="a section; it may be given again"
    )
    parser.add_argument("--sample", type=int, default=1, metavar="N", help="one case in N")
    parser.add_argument(
        "--quick", action="store_const", dest="sample", const=25, help="one case in 25"
    )
    chosen = parser.parse_args()
    command = {"write": write, "compare": compare}[chosen.command]
    return command(chosen.file, chosen.only or list(SECTIONS), chosen.sample)


if __name__ == "__main__":
    sys.exit(main())
