"""Files of interrupted runs: what is damaged is refused in one line that names the file and what to do."""

import json

import pytest

from roletrust_env.storage.untrusted import UntrustedModel
from studies.attackers.runs import of_kind, read_runs, write_runs

pytestmark = pytest.mark.slow

SETTINGS = {"command": "roletrust test", "games": (1, 2)}


class Kept(UntrustedModel):
    value: float


RUNS = {"a|1": {"value": 0.5}, "b|2": {"value": 1.0}}


def test_runs_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "runs.json"
    assert read_runs(path, SETTINGS, of_kind(Kept)) == {}
    write_runs(path, SETTINGS, RUNS)
    assert read_runs(path, SETTINGS, of_kind(Kept)) == RUNS


def text(made_with=SETTINGS, runs=RUNS):
    return json.dumps({"made_with": made_with, "runs": runs})


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("null", "it is no object with made_with and runs"),
        ("[]", "it is no object with made_with and runs"),
        ("", "Expecting value"),
        (text()[:-9], "Unterminated string"),
        ("[" * 200_000, "nested too deeply"),
        ('{"runs": ' * 900 + "1" + "}" * 900, "it has no object made_with"),
        (b"\xff\xfe", "codec can't decode"),
        ("{}", "it has no object made_with"),
        (text(made_with=["games"]), "it has no object made_with"),
        (text(runs=None), "it has no object runs"),
        (text(runs=[["a", {}]]), "it has no object runs"),
        (text(runs={"a|1": None}), "run 'a|1': it is no object"),
        (text(runs={"a|1": {}}), "run 'a|1': field value is missing"),
        (text(runs={"a|1": {"value": float("nan")}}), "NaN, which is not a number"),
        (text(runs={"a|1": {"value": "0.5"}}), "run 'a|1': value is '0.5'"),
        (text(runs={"a|1": {"value": [0.5]}}), "run 'a|1': value is [0.5]"),
        (text(runs={"a|1": {"value": 1, "more": 2}}), "run 'a|1': more is 2"),
    ],
)
def test_a_damaged_file_is_one_line(tmp_path, content, told):
    path = tmp_path / "runs.json"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ValueError, match=r"runs\.json holds no runs") as error:
        read_runs(path, SETTINGS, of_kind(Kept))
    message = str(error.value)
    assert message.startswith(f"{path} holds no runs of this command: ")
    assert told in message
    assert message.endswith("; give --force to begin again, or another --out")
    assert "\n" not in message
    assert len(message) < 1000


def test_runs_with_other_settings_are_refused_and_not_checked(tmp_path):
    path = tmp_path / "runs.json"
    path.write_text(text(made_with={**SETTINGS, "games": 3}, runs={"a|1": {}}))
    with pytest.raises(ValueError, match=r"runs\.json holds runs with another games; give --force"):
        read_runs(path, SETTINGS, of_kind(Kept))
