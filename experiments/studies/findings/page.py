"""The answers as a page of Markdown."""

from collections.abc import Mapping
from typing import Any

_INTRODUCTION = """\
This page answers with measurements what Su and Saint-Jore ([EWSN 2023](https://hal.science/hal-04161463)) claim or
leave open. The trust model is theirs, `role-trust`, unless another one is named. Compared games use the same random
numbers. The numbers are means with 95% intervals over the games. A rule turns the numbers into sentences: a difference
whose interval contains 0 is not shown, and the sentence says "neither more nor less". Intervals are not corrected for
multiple comparisons: of twenty differences that do not exist, one is shown by chance. The code is in
`experiments/studies/findings`; `python -m studies.findings` also writes a table of the numbers of each figure.
"""


def page(answers: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the page.

    Args:
        answers: Answers by name of the question, each with `question`, `sentence` and the `command` that repeats it.
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
