"""The bibliography has a title for every source, and texts lead to it."""

import inspect
import re

import pytest
from built import HOUSE
from pybtex.database import parse_file

from roletrust_env.trust.model import registry as models
from roletrust_env.trust.models.log_models import LOG_MODELS
from roletrust_experiments.site.references import cited

BIBLIOGRAPHY = HOUSE / "docs" / "references.bib"


def test_every_entry_has_a_title_and_a_valid_doi():
    for key, entry in parse_file(str(BIBLIOGRAPHY)).entries.items():
        assert entry.fields["title"], key
        assert re.fullmatch(r"10\.\d{4,}/\S+", entry.fields.get("doi", "10.1000/none")), key


@pytest.mark.parametrize("name", models.names())
def test_every_source_of_a_model_is_there(name):
    source = getattr(models.factory(name), "source", "")
    assert bool(cited(source or "", BIBLIOGRAPHY)) == bool(source)
    assert inspect.isclass(models.factory(name))


@pytest.mark.parametrize("name", LOG_MODELS)
def test_every_source_of_a_neighbouring_field_is_there(name):
    source = getattr(LOG_MODELS[name], "source", "")
    assert len(cited(source, BIBLIOGRAPHY)) == bool(source)


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("Jøsang, Hayward and Pope (2006)", ["josang2006"]),
        ("with the weightings of Yu et al. (2006) and Laureti et al. (2006)", ["yu2006", "laureti2006"]),
        ("Irissappane, Jiang and Zhang (2012)", ["irissappane2012"]),
        ("de Kerchove and Van Dooren (2010)", ["kerchove2010"]),
        ("Huber. Later, in 1964, nothing", []),
        ("nobody (1999)", []),
    ],
)
def test_cited(text, keys):
    assert cited(text, BIBLIOGRAPHY) == keys
