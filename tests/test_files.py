"""Files that version f785aa31 wrote: they load as they did, or are refused by their version.

A file that a later version refuses names its format in the error; it is then in `REFUSED`.
"""

import shutil
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from roletrust_agents.learned.policy import play_task
from roletrust_agents.learned.saved import load_attacker
from roletrust_env import TrustStream, make_trust_model
from roletrust_env.benchmarking.store import ResultStore as Results
from roletrust_manager.dds.team_trust import replay_rounds
from roletrust_manager.http.manager import TrustManager
from roletrust_manager.http.requests import Settings
from roletrust_manager.journal.lines import read_journal
from roletrust_manager.journal.sql import JournalStore

FILES = Path(__file__).parent / "files" / "f785aa31"

REFUSED: dict[str, type[Exception]] = dict.fromkeys(
    (
        *("results.sqlite", "stream-role-trust.npz", "journal.jsonl", "manager.sqlite"),
        *("stream-leave-one-out.npz", "stream-beta.npz"),
    ),
    ValueError,
)
"""Files of another format than that of this version, and the error that names it."""


def stream(model: str) -> Callable[[Path], float]:
    def load(folder: Path) -> float:
        path = folder / f"stream-{model}.npz"
        found = TrustStream.load(path, make_trust_model(model), scale=(1, 5), every=7.0)
        return float(np.mean([*found.rater_trust().values(), *found.provider_trust().values()]))

    return load


def journal(folder: Path) -> float:
    path = folder / "journal.jsonl"
    rounds = list(read_journal(path))
    replayed = replay_rounds(make_trust_model("role-trust"), iter(rounds), rounds[0].team, path)
    assert tuple(replayed.trust) == tuple(rounds[-1].trust)
    return float(np.mean([value for side in replayed.trust for value in side]))


def manager(folder: Path) -> float:
    settings = Settings(every=600.0, work=4, scale=(1.0, 5.0))
    with closing(
        TrustManager(JournalStore(str(folder / "manager.sqlite")), "role-trust", settings)
    ) as one:
        return float(len(one.members()))


def attacker(folder: Path) -> float:
    saved = load_attacker(folder / "provider-3x3")
    return float(play_task(saved.task(), saved.network, games=4, seed=0).mean())


def results(folder: Path) -> float:
    with Results(folder / "results.sqlite") as store:
        return float(len(store.all()))


CASES: dict[str, tuple[Callable[[Path], float], float]] = {
    "stream-role-trust.npz": (stream("role-trust"), 0.5390675775838869),
    "stream-leave-one-out.npz": (stream("leave-one-out"), 0.3232049800576827),
    "stream-beta.npz": (stream("beta"), 0.8007153382777862),
    "journal.jsonl": (journal, 0.45264372676547165),
    "manager.sqlite": (manager, 3.0),
    "provider-3x3.json": (attacker, 0.2399201817708672),
    "results.sqlite": (results, 0.0),
}
"""What reads a file, and a number that it then gives, as f785aa31 computed it."""


@pytest.mark.parametrize("name", CASES)
def test_a_file_of_the_version_before_loads_or_is_refused_by_its_version(name, tmp_path):
    folder = shutil.copytree(FILES, tmp_path / "files")
    load, number = CASES[name]
    if name in REFUSED:
        with pytest.raises(REFUSED[name]) as error:
            load(folder)
        assert "format" in str(error.value)
    else:
        assert load(folder) == pytest.approx(number, abs=1e-6)
