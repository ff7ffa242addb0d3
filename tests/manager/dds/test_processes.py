"""Processes of the live system: they end with the process that started them, and say what they wait
for."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from domains import own_dds_domain

pytestmark = pytest.mark.live

PATIENCE_S = 120.0
HERE = Path(__file__).parent

NODES = """
from roletrust_manager.dds.nodes.run_loop import run_until_signal
from roletrust_manager.robots.processes import NodeProcesses

def run(path):
    with run_until_signal() as active:
        path.write_text(str(os.getpid()))
        while active:
            time.sleep(0.01)

if __name__ == "__main__":
    with NodeProcesses() as nodes:
        nodes.start("one", run, path=Path("one"))
        nodes.begin("one")
        time.sleep(600)
"""

GUEST = """
from guests import guest

DEAF = "import os, pathlib, signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN);"
DEAF += "pathlib.Path('one').write_text(str(os.getpid())); time.sleep(600)"
with guest([sys.executable, "-c", DEAF]):
    time.sleep(600)
"""


@pytest.mark.parametrize("script", [NODES, GUEST], ids=["node", "guest"])
def test_a_process_ends_with_its_parent(script, tmp_path):
    path = tmp_path / "parent.py"
    path.write_text(
        f"import os, sys, time\nfrom pathlib import Path\nsys.path.append({str(HERE)!r})\n{script}"
    )
    parent = subprocess.Popen([sys.executable, path], cwd=tmp_path)
    try:
        until(
            lambda: (tmp_path / "one").exists() and (tmp_path / "one").read_text(),
            "the process does not start",
        )
    finally:
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    child = int((tmp_path / "one").read_text())
    try:
        until(lambda: not is_running(child), "the process goes on")
    finally:
        if is_running(child):
            os.kill(child, signal.SIGKILL)


def until(holds, why):
    end = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < end, why
        time.sleep(0.01)


def is_running(process):
    """Return whether a process runs; one that has ended may still wait to be reaped."""
    try:
        os.kill(process, 0)
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["manager", "journal"], "manager: begins journal, and waits for ratings"),
        (["agent", "sr_0"], "sr_0: runs until Ctrl-C"),
        (["agent", "sp_0"], "sp_0: runs until Ctrl-C"),
        (["record", "bag"], "record: records into bag, until Ctrl-C"),
        (["view", "--set", "port=0"], "Watch the team on http://localhost:"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_no_command_waits_without_a_word(arguments, line, tmp_path, monkeypatch):
    command = [
        sys.executable,
        "-c",
        "from roletrust_experiments import main; main()",
        "robots",
        *arguments,
    ]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    monkeypatch.setenv("BROWSER", "true")  # a program that does nothing
    with own_dds_domain(), subprocess.Popen(command, cwd=tmp_path, **pipes) as process:
        patience = threading.Timer(PATIENCE_S, process.kill)
        patience.start()
        assert any(line in shown for shown in process.stdout)
        patience.cancel()
        process.terminate()
