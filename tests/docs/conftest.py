"""The tests of the site need what makes it, which `make test` does not install."""

from importlib.util import find_spec

collect_ignore = (
    [] if find_spec("sphinx") else ["test_browser.py", "test_site.py", "test_site_pages.py"]
)
