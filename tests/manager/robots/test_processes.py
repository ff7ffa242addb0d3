"""Nodes as processes of one program: a node that fails or ends too early is named."""

from contextlib import nullcontext
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from refusals import refuses

from roletrust_manager.robots.processes import NodeProcesses, _Process


@pytest.mark.parametrize(
    ("name", "code", "words"),
    [("sr_0", 0, ("sr_0",)), ("sp_0", -9, ("sp_0", "-9")), ("sp_0", 0, None), ("sr_0", None, None)],
)
def test_a_node_that_ends_too_early_is_named(name, code, words):
    nodes = NodeProcesses()
    nodes._processes[name] = _Process(
        SimpleNamespace(exitcode=code), SimpleNamespace(poll=lambda: False)
    )
    with nullcontext() if words is None else refuses(ValueError, *words):
        nodes.check("sp_0")


@pytest.mark.parametrize(
    ("code", "words"),
    [(0, None), (-9, ("recorder", "-9")), (None, ("recorder",))],
)
def test_a_node_that_fails_at_the_end_is_named(code, words):
    with (
        nullcontext() if words is None else refuses(ValueError, *words),
        NodeProcesses() as nodes,
    ):
        node = Mock(exitcode=code)
        nodes._processes["recorder"] = _Process(node, Mock(poll=lambda: False))
    node.terminate.assert_called_once()
    node.kill.assert_called_once()
