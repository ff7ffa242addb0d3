"""The answers as a page of Markdown."""

from collections.abc import Mapping
from typing import Any

_INTRODUCTION = """\
What Su and Saint-Jore ([EWSN 2023](https://hal.science/hal-04161463)) claim or leave open, measured. The trust model is
theirs, `role-trust`, where no other one is named. What is compared was played with the same luck; numbers are means
with 95% intervals over the games. A sentence is made of the numbers by a rule: a difference whose interval holds 0 is
not shown, neither more nor less. Every interval stands for itself; of twenty differences that are none, one is shown
by chance. `roletrust_experiments.findings` says what is measured, and where; `roletrust findings` writes a table of the
numbers of each picture beside it.
"""


def page(answers: Mapping[str, Mapping[str, Any]]) -> str:
    """The page.

    Args:
        answers: by the question's name: `question`, `sentence`, and `command`, which answers it again.
    """
    parts = ["# The paper, answered\n", _INTRODUCTION]
    for name, answer in answers.items():
        parts += [
            f"## {answer['question']}\n",
            f"{answer['sentence']}\n",
            f"![{answer['question']}](findings/{name}.png)\n",
            f"    {answer['command']}\n",
        ]
    return "\n".join(parts)
