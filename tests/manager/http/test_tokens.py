import base64
import json
import math
import string
from hashlib import sha256

import jwt
import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from pages import HOUSE, blocks
from refusals import refuses

from roletrust_manager.http.tokens import (
    MAX_TOKEN,
    Claims,
    Leave,
    Rating,
    Registration,
    has_work,
    key_as_text,
    key_of_text,
    read_token,
    sign_token,
    with_work,
)

KEY = Ed25519PrivateKey.from_private_bytes(bytes(32))
RATING = Rating(iss="ann", sub="did:web:bob", aud="trust", iat=1764181371.123457, rating=0.9)
REGISTRATION = Registration(
    iss="ann", aud="trust", iat=1764181371.5, key=key_as_text(KEY.public_key())
)


BASE64URL = string.ascii_uppercase + string.ascii_lowercase + string.digits + "-_"


def token_with(**changes):
    """Return a rating as another library signs it, with changed claims."""
    claims = RATING.model_dump(exclude_none=True) | changes
    return jwt.api_jws.encode(json.dumps(claims).encode(), KEY, algorithm="EdDSA")


def test_a_token_returns_as_its_claims_and_as_what_was_signed():
    token = sign_token(RATING, KEY)
    claims, envelope = read_token(token, Rating)
    assert claims == RATING
    assert envelope[:3] == ("ann", 1_764_181_371_123_457_000, token.rpartition(".")[0].encode())
    KEY.public_key().verify(envelope.signature, envelope.signed)
    assert key_of_text(REGISTRATION.key) == KEY.public_key()


def test_a_token_of_another_library_is_read():
    claims, envelope = read_token(token_with(iat=1764181371, task=7), Rating)
    assert claims == RATING.model_copy(update={"iat": 1764181371})
    assert envelope.stamp == 1_764_181_371_000_000_000


def test_optional_claims_are_written_only_if_the_token_has_them():
    _, payload, _ = sign_token(RATING, KEY).split(".")
    names = set(json.loads(base64.urlsafe_b64decode(payload + "===")))
    assert names == {"kind", "iss", "aud", "iat", "sub", "rating"}
    for jti in ("a", "é" * 64):
        claims = RATING.model_copy(update={"jti": jti})
        assert read_token(sign_token(claims, KEY), Rating)[0].jti == jti


def test_the_audience_may_be_an_array_with_one_name():
    assert read_token(token_with(aud=["trust"]), Rating)[0] == RATING
    for aud in ([], ["trust", "other"], [["trust"]], [7], {"trust": 1}, ["b b"], None):
        with pytest.raises(ValueError, match="aud"):
            read_token(token_with(aud=aud), Rating)


def test_a_token_has_one_spelling():
    token = sign_token(RATING, KEY)
    parts = token.split(".")
    for at, part in enumerate(parts):
        last = BASE64URL.index(part[-1])
        others = [part[:-1] + BASE64URL[last ^ 1]] if len(part) % 4 else []
        others += [f"{part}{'=' * (-len(part) % 4)}"] if len(part) % 4 else []
        others += [part + "=", part + "==", part + "\n", " " + part, f"{part[:4]}\n{part[4:]}"]
        others += [f"{part[:4]}!{part[4:]}", f"{part[:4]}={part[4:]}", part + "é"]
        for other in others:
            with pytest.raises(ValueError):  # noqa: PT011 - PyJWT refuses it, or the reader
                read_token(".".join([*parts[:at], other, *parts[at + 1 :]]), Rating)
    assert read_token(token, Rating)[0] == RATING


def test_the_claims_of_the_guide_are_a_rating():
    (claims,) = blocks(HOUSE / "docs/guide/manager.md", "json")
    assert Rating.model_validate_json(claims).model_dump(exclude_none=True) == json.loads(claims)


def test_what_is_no_token_of_the_kind_is_refused():
    claims = RATING.model_dump(exclude_none=True)
    head, payload, _ = sign_token(RATING, KEY).split(".")
    none = base64.urlsafe_b64encode(b'{"alg":"none"}').decode().rstrip("=")
    cases = [
        ("garbage", Rating, ("JSON",)),
        (f"{head}.{payload}", Rating, ("JSON",)),
        (f"{none}.{payload}.", Rating, ("EdDSA",)),
        (
            jwt.encode(claims, "x" * 32, algorithm="HS256"),
            Rating,
            ("EdDSA",),
        ),
        ("x" * (MAX_TOKEN + 1), Rating, ("4,096", "4,097")),
        (sign_token(RATING, KEY), Registration, ("kind", "rating", "register")),
        (sign_token(RATING, KEY), Leave, ("kind", "rating", "leave")),
    ]
    for change in (
        {"iss": "../ann"},
        {"sub": "b b"},
        {"rating": "0.9"},
        {"rating": float("nan")},
        {"rating": True},
        {"iat": -1.0},
        {"iat": True},
        {"exp": "1764181371"},
        {"exp": True},
        {"exp": float("inf")},
        {"nbf": float("nan")},
        {"nbf": [1]},
        {"jti": ""},
        {"jti": "x" * 65},
        {"jti": 7},
    ):
        value = next(iter(change.values()))
        named = () if isinstance(value, float) and not math.isfinite(value) else tuple(change)
        cases.append((token_with(**change), Rating, named))
    for token, kind, words in cases:
        with refuses(ValueError, *words):
            read_token(token, kind)


def test_the_work_is_of_the_manager_the_agent_its_key_and_the_time():
    found = with_work(REGISTRATION, 8)
    text = "\n".join(["trust", "ann", REGISTRATION.key, "1764181371500000", str(found.work)])
    assert sha256(text.encode()).digest()[0] == 0
    assert has_work(found, 8)
    assert not has_work(found, 60)
    assert has_work(REGISTRATION, 0)
    others = (
        {"aud": "other"},
        {"iss": "bob"},
        {"key": "A" * 43},
        {"iat": 1764181372.5},
        {"work": found.work + 1},
    )
    kept = [has_work(found.model_copy(update=change), 8) for change in others]
    assert not any(kept)


def test_all_kinds_are_claims():
    assert {kind.model_fields["kind"].default for kind in Claims.__subclasses__()} == {
        "register",
        "rating",
        "rotate",
        "leave",
    }
