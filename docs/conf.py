"""Settings of the site, which `make docs` builds offline. `docs/_ext/site_pages` writes its
reference.
"""

import re
import sys
from pathlib import Path

import mcp.types  # noqa: F401 - it cannot be imported while autodoc says TYPE_CHECKING

from roletrust_env import __version__

_DOCS = Path(__file__).parent
sys.path.insert(0, str(_DOCS / "_ext"))
sys.path.insert(1, str(_DOCS.parent / "experiments"))  # studies, which are not installed

project, author, release = "RoleTrust", "The RoleTrust authors", __version__
copyright = "the RoleTrust authors, MIT licence"
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinxcontrib.bibtex",
    "sphinx_design",
    "site_pages",
]
# The report, the paper for JOSS, what a release needs, and tables that a page includes.
exclude_patterns = ["_ext/**", "leaderboards/standard*", "listening/*.md", "paper.md", "release/**"]
for _page in _DOCS.glob("*.md"):
    exclude_patterns += re.findall(
        r"^```\{include\} (\w\S+)", _page.read_text(encoding="utf-8"), re.MULTILINE
    )
smartquotes = False
highlight_language = "none"  # formulas are no code
default_role = "py:obj"  # `Policy.quality` in a docstring leads to it

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 3
myst_fence_as_directive = ["mermaid"]

# Tutorials run when their text changes; `-D nb_execution_mode=off` shows them without what they
# print.
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 600
nb_merge_streams = True

bibtex_bibfiles = ["references.bib"]
html_math_renderer = "mathml"  # of site_pages

autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

html_theme = "furo"
html_title = f"RoleTrust {release}"
html_static_path = ["_static", "reference/films"]
html_css_files = ["site.css"]
html_favicon = "_static/icon.svg"
html_use_index = False  # there is a search
html_domain_indices = False
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    # Blues that colour-blind people tell from the text, readable on white and on black.
    "light_css_variables": {"color-brand-primary": "#00578a", "color-brand-content": "#00578a"},
    "dark_css_variables": {"color-brand-primary": "#56b4e9", "color-brand-content": "#56b4e9"},
}
