"""Tables in Markdown, and texts of others in them."""

from collections.abc import Collection, Iterable, Sequence
from html import escape


def markdown_table(
    headings: Sequence[str], rows: Iterable[Sequence[str]], names: int | Collection[str]
) -> str:
    """Return a table in Markdown.

    Args:
        headings: Headings.
        rows: Cells of each row, in Markdown. A bar is written as an entity, for it would end the
            cell.
        names: Number of leading columns with text, or the headings of these columns; the others
            have numbers and are aligned to the right.
    """
    texts = headings[:names] if isinstance(names, int) else names
    lines = [headings, ["---" if name in texts else "---:" for name in headings], *rows]
    return "\n".join(
        f"| {' | '.join(cell.replace('|', '&#124;') for cell in line)} |" for line in lines
    )


def plain(text: str) -> str:
    """Return a text for Markdown in which it is neither markup nor HTML.

    Example:
        >>> plain("<b>x")
        '&lt;b&gt;x'
    """
    for mark in "\\`*[]":
        text = text.replace(mark, f"\\{mark}")
    return escape(" ".join(text.split()), quote=False)


def code(text: str) -> str:
    """Return a name as code in Markdown.

    Example:
        >>> code("mean"), code("a`b")
        ('`mean`', '<code>a&#96;b</code>')
    """
    if not set(text) & set("`|\n\r"):
        return f"`{text}`"
    return f"<code>{escape(text, quote=False).replace('`', '&#96;').replace('|', '&#124;')}</code>"


class ShownAsMarkdown:
    """Base class of results that Python prints as a notebook shows them."""

    def _repr_markdown_(self) -> str:
        raise NotImplementedError

    def __repr__(self) -> str:
        """Return the text that a notebook shows."""
        return self._repr_markdown_()
