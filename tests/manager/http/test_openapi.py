"""The description of the trust manager by OpenAPI: what it says holds for examples, for edge cases
and at random."""

import asyncio
import os
import subprocess
import sys
from pathlib import Path

import httpx2
import pytest
from load import register
from served import served

pytest.importorskip("schemathesis", reason="`make test` does without it")
from requests_of_agents import AGENTS

EXAMPLES = 12  # of each operation


@pytest.mark.slow
def test_the_description_holds(tmp_path: Path):
    """Whatever is sent: no error of the server, and only the statuses, forms and headers that are
    described."""
    command = [
        Path(sys.executable).with_name("schemathesis"),
        "run",
        "--checks",
        "all",
        "--generation-deterministic",
    ]
    options = [
        "--max-examples",
        EXAMPLES,
        "--warnings",
        "off",
        "--no-color",
        "--exclude-path",
        "/events",
    ]  # has no end
    hooks = {"SCHEMATHESIS_HOOKS": "requests_of_agents", "PYTHONPATH": os.pathsep.join(sys.path)}
    with served(tmp_path / "trust.sqlite", "--every", 1, "--set", "quota=20") as manager:
        asyncio.run(register(manager.port, AGENTS[:2]))
        done = subprocess.run(
            [*map(str, [*command, *options]), f"{manager.url}/openapi.json"],
            cwd=tmp_path,
            env=os.environ | hooks,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        about, refusals = (httpx2.get(f"{manager.url}/{path}").json() for path in ("", "refusals"))
    print(done.stdout.splitlines()[-1], about, refusals)
    assert about["ratings"] > 0
