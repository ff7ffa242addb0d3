"""Mermaid's flowcharts without Mermaid, which would have to be fetched: a table of the arrows."""

import re

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

_ARROW = re.compile(r"^ *(\S+) --> (\S+)$", flags=re.MULTILINE)


class Arrows(SphinxDirective):
    """Show a flowchart as a table with a row for each node that has outgoing arrows."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return the table. See `docutils.parsers.rst.Directive.run`."""
        found: dict[str, list[str]] = {}
        for start, end in _ARROW.findall("\n".join(self.content)):
            found.setdefault(start, []).append(end)
        rows = [f"| `{start}` | {', '.join(f'`{end}`' for end in ends)} |" for start, ends in found.items()]
        return self.parse_text_to_nodes("\n".join(["| folder | imports from |", "| --- | --- |", *rows]))
