"""A market of four raters and three providers, in which two raters lie: quickly trained in, and its
trainings."""

from typing import Any

TASK: dict[str, Any] = {
    "scenario": "market",
    "compromised": ("sr_2", "sr_3"),
    "objective": "mislead",
    "max_cycles": 10,
    "agents": [
        {"role": "SR", "count": 4, "noise": 0.05},
        {"role": "SP", "count": 3, "ability": [0.3, 1.0]},
    ],
}


def run(training, steps):
    """Train for some steps, with the validations that are due."""
    for _ in range(steps):
        training.step()
        if training.due():
            training.validate()
    return training


def assert_continues(begun, steps):
    """A training that is taken up again ends like one that was not stopped.

    Args:
        begun: Function that returns the training at its beginning.
        steps: Steps before the stop, and after it.
    """
    whole, part, again = run(begun(), 2 * steps), run(begun(), steps), begun()
    again.restore(part.state())
    again.best, again.rounds = part.best, part.rounds
    run(again, steps)
    assert whole.weights.tolist() == again.weights.tolist()
    assert whole.state() == again.state()
