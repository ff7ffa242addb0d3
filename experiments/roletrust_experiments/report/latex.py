"""The leaderboard as a table for LaTeX."""

import re

from roletrust_env.benchmarking.leaderboard import Leaderboard, row_texts

_SPECIAL = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "<": r"\textless{}",
        ">": r"\textgreater{}",
        "|": r"\textbar{}",
        **{letter: f"\\{letter}" for letter in "&%$#_{}"},
    }
)
_TEXTS = ("model", "worst attack")


def escape(text: str) -> str:
    r"""Return a text that LaTeX prints as it is.

    Example:
        >>> print(escape("mine:share=30%_[a]"))
        mine:share=30\%\_[a]
    """
    return text.translate(_SPECIAL)


def latex_table(leaderboard: Leaderboard, command: str) -> str:
    """Return a `tabular` over both columns of a paper, in the lines of the package booktabs.

    Args:
        leaderboard: Leaderboard.
        command: Command that writes the table.
    """
    columns = leaderboard.columns
    kinds = "".join("l" if name in _TEXTS else "r" for name in columns)
    rows = [row_texts(row, " ± ") for row in leaderboard.rows]
    about = f"Suite {leaderboard.suite.name}: {leaderboard.caption}. Made by {command}"
    lines = [
        f"% {' '.join(about.split())}",  # a name with a line break would end the comment
        r"% Needs \usepackage{booktabs}. For both columns, at 7 inches:",
        r"% \begin{table*} \footnotesize \setlength{\tabcolsep}{4pt} \input{leaderboard} \caption{...} \end{table*}",
        rf"\begin{{tabular}}{{@{{}}{kinds}@{{}}}}",
        r"\toprule",
        _line(list(columns)),
        r"\midrule",
        *(_line([_cell(name, texts[name]) for name in columns]) for texts in rows),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines) + "\n"


def _cell(column: str, text: str) -> str:
    """Return a cell; the minus of a number is no hyphen."""
    if column in _TEXTS:
        return escape(text)
    return re.sub(r"-(?=\d)", "$-$", escape(text)).replace("±", r"$\pm$")


def _line(cells: list[str]) -> str:
    return " & ".join(cells) + r" \\"
