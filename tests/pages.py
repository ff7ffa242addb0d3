"""The pages that people write: their blocks, the commands in them, and how both are tried."""

import re
import shlex
import tomllib
from pathlib import Path

import typer

from roletrust_env.benchmarking.suite_files import suites
from roletrust_env.game.policy import registry as attackers
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.trust.remote import KINDS as REMOTE
from roletrust_env.world.presets import scenarios
from roletrust_experiments.cli import app

HOUSE = Path(__file__).parent.parent
TUTORIALS = sorted((HOUSE / "docs/tutorials").glob("*.md"))
WRITTEN = [HOUSE / "README.md", HOUSE / "CONTRIBUTING.md", *sorted((HOUSE / "docs").glob("*.md"))]
WRITTEN += [
    *sorted((HOUSE / "docs/how").glob("*.md")),
    *sorted((HOUSE / "docs/guide").glob("*.md")),
    *TUTORIALS,
]

_SHELL = (
    "pip",
    "python",
    "make",
    "ruff",
    "mypy",
    "lint-imports",
    "pytest",
    "cat",
    "curl",
    "docker",
    "echo",
    "head",
    "ls",
    "source",
)
_OWN = re.compile(r"[\w.]+:[A-Z]\w*")  # a class of the reader's own


def blocks(page: Path, *languages: str) -> list[str]:
    """The fenced blocks of some languages."""
    found = re.findall(
        r"^```(\S+)\n(.*?)^```$", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
    )
    return [text for language, text in found if language in languages]


def prose(page: Path) -> str:
    """A page without its fenced blocks."""
    return re.sub(
        r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
    )


def cells(page: Path) -> list[str]:
    """The cells of a tutorial, without what is said of their pictures."""
    return [
        re.sub(r"\A---\n.*?\n---\n", "", cell, flags=re.DOTALL)
        for cell in blocks(page, "{code-cell}")
    ]


def written_file(page: Path, name: str) -> str:
    """What a tutorial writes to a file."""
    return next(cell for cell in cells(page) if cell.startswith(f"%%writefile {name}\n")).partition(
        "\n"
    )[2]


def run(page: Path) -> dict:
    """What is defined after the Python blocks of a page ran, one after the other."""
    names = {"__name__": page.stem}
    for block in blocks(page, "python"):
        exec(compile(block, page.name, "exec"), names)
    return names


def commands(page: Path) -> list[str]:
    """The lines for a shell: of fenced blocks, of cells, and of indented blocks that call one of
    our commands."""
    shell = [
        *blocks(page, "bash"),
        *(cell.partition("\n")[2] for cell in cells(page) if cell.startswith("%%bash\n")),
    ]
    lines = [line for block in shell for line in block.replace("\\\n", " ").splitlines()]
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    lines += re.findall(r"^ {4}((?:roletrust|make|pip|python -m) .*)$", text, flags=re.MULTILINE)
    return [line.strip() for line in lines if line.strip()]


def refused(line: str) -> str:
    """What is wrong with a line for a shell; empty if all that it names is there."""
    program, *words = shlex.split(line, comments=True)
    if program == "roletrust":
        return _refused_by_us(words)
    if program == "make":
        missing = [
            word
            for word in words
            if "=" not in word
            and not re.search(rf"^{word}:", (HOUSE / "Makefile").read_text(), re.MULTILINE)
        ]
        return f"no targets {missing}" if missing else ""
    if program in ("pip", "uv"):
        known = tomllib.loads((HOUSE / "pyproject.toml").read_text())["project"][
            "optional-dependencies"
        ]
        extras = {
            word: re.findall(r"\w+", named)
            for word in words
            for named in re.findall(r"\[(.*)\]", word)
        }
        missing = [word for word, wanted in extras.items() if not known.keys() >= set(wanted)]
        return f"no extras {missing}" if missing else ""
    if words[:2] == ["-m", "studies"]:
        known = [path.stem for path in (HOUSE / "experiments" / "studies").glob("*.py")]
        return "" if words[2:3] == [] or words[2] in known else f"no study {words[2]}"
    return "" if program in _SHELL else f"unknown program {program}"


def _refused_by_us(words: list[str]) -> str:
    command, context, name = typer.main.get_command(app), None, "roletrust"
    try:
        while True:
            context = command.make_context(name, list(words), parent=context)
            if not hasattr(context.command, "resolve_command"):
                break
            name, command, words = context.command.resolve_command(
                context, [*context._protected_args, *context.args]
            )
    except Exception as error:  # whatever the parser raises
        return f"{type(error).__name__}: {error}"
    known = {
        "model": [*trust_models.names(), "all", *REMOTE],
        "attack": attackers.names(),
        "scenario": list(scenarios()),
        "suite": list(suites()),
    }
    given = ((key, value) for key in known for value in _several(context.params.get(key)))
    wrong = [f"{key} {value}" for key, value in given if not _is_known(value, known[key])]
    return f"unknown: {', '.join(wrong)}" if wrong else ""


def _several(value: object) -> list[str]:
    return [
        str(part)
        for part in (value if isinstance(value, list | tuple) else [value] if value else [])
    ]


def _is_known(value: str, names: list[str]) -> bool:
    """Return whether a value names what there is, also before parameters or behind an agent, or the
    reader's own."""
    named = value.partition("=")[2] if "=" in value.partition(":")[0] else value
    return (
        named.partition(":")[0] in names
        or named.endswith((".toml", ".yaml"))
        or _OWN.match(named) is not None
    )


def anchors(page: Path) -> set[str]:
    """The headings of a page as GitHub and MyST link to them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
