import stat

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
from refusals import refuses

from roletrust_manager.admission.keys import PublicKeys, Signer, make_keys


def test_a_signature_is_that_of_its_rater_and_of_its_bytes(tmp_path):
    assert make_keys(tmp_path, ["sr_0", "sr_1"]) == ["sr_0", "sr_1"]
    known, signature = PublicKeys(tmp_path), Signer(tmp_path, "sr_0").sign(b"text")
    assert known.names == ("sr_0", "sr_1")
    assert "sr_0" in known
    assert "sr_2" not in known
    assert known.verifies("sr_0", b"text", signature)
    assert not known.verifies("sr_1", b"text", signature)
    assert not known.verifies("sr_0", b"other", signature)
    assert not known.verifies("sr_0", b"text", b"short")


def test_private_keys_are_for_their_owner_only(tmp_path):
    make_keys(tmp_path, ["sr_0"])
    path = tmp_path / "sr_0.key"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    path.chmod(0o640)
    with refuses(ValueError, "sr_0.key", "600"):
        Signer(tmp_path, "sr_0")


def test_existing_keys_are_not_changed(tmp_path):
    make_keys(tmp_path, ["sr_0"])
    before = (tmp_path / "sr_0.key").read_bytes()
    assert make_keys(tmp_path, ["sr_0", "sr_1"]) == ["sr_1"]
    assert (tmp_path / "sr_0.key").read_bytes() == before


@pytest.mark.parametrize("name", ["../sr_0", "sr 0", "", "sr/0"])
def test_an_invalid_name_makes_no_keys(tmp_path, name):
    with refuses(ValueError, repr(name)):
        make_keys(tmp_path / "keys", ["sr_0", name])
    assert not (tmp_path / "keys").exists()


def test_missing_and_invalid_keys_are_refused(tmp_path):
    with refuses(ValueError, "sr_0.key"):
        Signer(tmp_path, "sr_0")
    with refuses(ValueError, tmp_path):
        PublicKeys(tmp_path)
    for name in ("sr_0.key", "sr_0.pub"):
        (tmp_path / name).write_text("nonsense")
        (tmp_path / name).chmod(0o600)
    with refuses(ValueError, "sr_0.key", "ed25519"):
        Signer(tmp_path, "sr_0")
    with refuses(ValueError, "sr_0.pub", "ed25519"):
        PublicKeys(tmp_path)


def test_a_lost_public_key_is_made_again_from_the_private_one(tmp_path):
    make_keys(tmp_path, ["sr_0"])
    public = (tmp_path / "sr_0.pub").read_bytes()
    (tmp_path / "sr_0.pub").unlink()
    assert make_keys(tmp_path, ["sr_0"]) == []
    assert (tmp_path / "sr_0.pub").read_bytes() == public


def test_a_public_key_with_which_everybody_signs_is_none(tmp_path):
    make_keys(tmp_path, ["sr_0"])
    point = Ed25519PublicKey.from_public_bytes(bytes([1]) + bytes(31))
    form = serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo
    (tmp_path / "sr_0.pub").write_bytes(point.public_bytes(*form))
    with refuses(ValueError, "sr_0.pub", "ed25519"):
        PublicKeys(tmp_path)
