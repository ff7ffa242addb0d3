"""The README as a package index shows it: its links are absolute, for there it has no repository
around it.
"""

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

_CODE = r"^```.*?^```$|`[^`\n]+`"
_LINK = re.compile(
    rf"(?P<code>{_CODE})|(?P<picture>!?)\[(?P<text>[^\]]*)\]\((?P<path>(?!https?://|#)[^)\s]+)\)\n?",
    re.MULTILINE | re.DOTALL,
)


def absolute(text: str, repository: str | None) -> str:
    """Return Markdown with absolute links.

    Args:
        text: Markdown with links relative to the repository.
        repository: Address of the repository; without one, pictures are left out and links become
            plain text.
    """

    def replaced(link: re.Match[str]) -> str:
        if link["code"]:
            return link[0]
        end = "\n" if link[0].endswith("\n") else ""
        if repository is None:
            return "" if link["picture"] else link["text"] + end
        kind = "raw" if link["picture"] else "blob"
        return f"{link['picture']}[{link['text']}]({repository.rstrip('/')}/{kind}/HEAD/{link['path']}){end}"  # noqa: E501

    return _LINK.sub(replaced, text)


class AbsoluteReadme(MetadataHookInterface):
    """Set the field `readme`, with links into the repository that `project.urls` names."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add the README to the metadata. See `MetadataHookInterface.update`."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        urls = metadata.get("urls", {})
        metadata["readme"] = {
            "content-type": "text/markdown",
            "text": absolute(text, urls.get("Repository")),
        }
