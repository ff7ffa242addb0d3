"""Tables in Markdown."""

from collections.abc import Collection, Iterable, Sequence


def markdown_table(
    headings: Sequence[str], rows: Iterable[Sequence[str]], names: int | Collection[str]
) -> str:
    """Return a table in Markdown.

    Args:
        headings: Headings.
        rows: Cells of each row. A bar is written as an entity, for it would end the cell.
        names: Number of leading columns with text, or the headings of these columns; the others
            have numbers and are aligned to the right.
    """
    texts = headings[:names] if isinstance(names, int) else names
    lines = [headings, ["---" if name in texts else "---:" for name in headings], *rows]
    return "\n".join(
        f"| {' | '.join(cell.replace('|', '&#124;') for cell in line)} |" for line in lines
    )
