"""Who a rater is: ed25519 keys, one pair for each name (Bernstein et al. 2012)."""

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

_PRIVATE, _PUBLIC = ".key", ".pub"


def make_keys(folder: Path, names: Iterable[str]) -> list[str]:
    """Make a pair of keys for each name that has none: `NAME.key`, for its owner's eyes only, and `NAME.pub`.

    Returns:
        The names that got new ones.

    Raises:
        ValueError: a name cannot be that of a file, or a private key that is there is none.
        OSError: the folder cannot be written to.
    """
    names = list(dict.fromkeys(names))
    for name in names:
        if not name.isidentifier():
            raise ValueError(f"{name!r} is no name of an agent; use letters, digits and '_', such as sr_0")
    folder.mkdir(parents=True, exist_ok=True)
    made = [name for name in names if not (folder / f"{name}{_PRIVATE}").exists()]
    for name in made:
        key = Ed25519PrivateKey.generate()
        private = key.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
        file = os.open(folder / f"{name}{_PRIVATE}", os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(file, "wb") as opened:
            opened.write(private)
        _publish(key, folder / f"{name}{_PUBLIC}")
    for name in names:  # one whose making was cut short has no public key yet
        if not (folder / f"{name}{_PUBLIC}").exists():
            _publish(_private(folder / f"{name}{_PRIVATE}"), folder / f"{name}{_PUBLIC}")
    return made


def _publish(key: Ed25519PrivateKey, path: Path) -> None:
    """Write the public key of a private one."""
    public = key.public_key().public_bytes(serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo)
    path.write_bytes(public)


class Signer:
    """Signs as a rater.

    Args:
        folder: with the keys.
        name: of the rater.

    Raises:
        ValueError: there is no private key of that name, others may read it, or it is none.
    """

    def __init__(self, folder: Path, name: str) -> None:
        path = folder / f"{name}{_PRIVATE}"
        if not path.exists():
            raise ValueError(f"there is no private key {path}; `roletrust live keys` makes one")
        if path.stat().st_mode & 0o077:
            raise ValueError(f"{path} can be read by others; only its owner may, as after `chmod 600 {path}`")
        self._key = _private(path)

    def sign(self, data: bytes) -> bytes:
        """The signature of some bytes."""
        return self._key.sign(data)


class PublicKeys:
    """The public keys of a folder: the raters that are known. See `Keyring`.

    Raises:
        ValueError: there is none in the folder, or one is no key.
    """

    def __init__(self, folder: Path) -> None:
        self._keys = {path.stem: _public(path) for path in sorted(folder.glob(f"*{_PUBLIC}"))}
        if not self._keys:
            raise ValueError(f"there is no public key in {folder}; `roletrust live keys` makes some")

    @property
    def names(self) -> tuple[str, ...]:
        """Whose keys there are."""
        return tuple(self._keys)

    def __contains__(self, rater: object) -> bool:
        """See `Keyring`."""
        return rater in self._keys

    def verifies(self, rater: str, signed: bytes, signature: bytes) -> bool:
        """See `Keyring.verifies`."""
        try:
            self._keys[rater].verify(signature, signed)
        except InvalidSignature:
            return False
        return True


def _private(path: Path) -> Ed25519PrivateKey:
    key: object = None
    with suppress(ValueError, TypeError, UnsupportedAlgorithm):
        key = serialization.load_pem_private_key(path.read_bytes(), password=None)
    if not isinstance(key, Ed25519PrivateKey):
        raise ValueError(f"{path} is no private key of the kind ed25519")
    return key


def _public(path: Path) -> Ed25519PublicKey:
    key: object = None
    with suppress(ValueError, UnsupportedAlgorithm):
        key = serialization.load_pem_public_key(path.read_bytes())
    if not isinstance(key, Ed25519PublicKey):
        raise ValueError(f"{path} is no public key of the kind ed25519")
    return key
