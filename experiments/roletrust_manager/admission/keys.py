"""Keys of the manager, raters and cameras: one ed25519 pair for each name (Bernstein et al.
2012).
"""

import os
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

NAME = r"[_A-Za-z][_A-Za-z0-9.@:+-]{0,199}"
"""Names of agents as a regular expression: they are names of files, too, and none looks like
another."""

_PRIVATE, _PUBLIC = ".key", ".pub"
_PRIME = 2**255 - 19  # of the field of ed25519


def check_name(name: str) -> None:
    """Raise an error if a text is no name of an agent.

    Raises:
        ValueError: It is not as `NAME`.
    """
    if not re.fullmatch(NAME, name):
        raise ValueError(
            f"{name!r} is no name of an agent: up to 200 letters, digits and _.-@:+, a letter first"
        )


def is_forgeable(key: Ed25519PublicKey) -> bool:
    """Return whether anybody can sign with a public key: it is of small order, or not in its
    canonical form.

    The order divides 8 where y is 0, 1, -1, or a root of d y^4 + 2 y^2 = 1 with d = -121665 /
    121666, from the formula of doubling (Bernstein et al., "High-Speed High-Security Signatures",
    2012).
    """
    y = int.from_bytes(key.public_bytes_raw(), "little") % 2**255
    return y >= _PRIME or y * (y**2 - 1) * (121665 * y**4 - 243332 * y**2 + 121666) % _PRIME == 0


def make_keys(folder: Path, names: Iterable[str], *, replace: bool = False) -> list[str]:
    """Make a pair of keys for each name that has none: `NAME.key`, readable by its owner only, and
    `NAME.pub`.

    Args:
        folder: Folder for the keys; it is created if it does not exist.
        names: Names of agents, or `manager`.
        replace: Whether to replace a public key that is there without its private key.

    Returns:
        The names that got a new pair.

    Raises:
        ValueError: A name is not as `NAME`, an existing private key is invalid, or a public key
            would be replaced. Then no key is made.
        OSError: The folder cannot be written.
    """
    names = list(dict.fromkeys(names))
    for name in names:
        check_name(name)
    new = [name for name in names if not (folder / f"{name}{_PRIVATE}").exists()]
    alone = [name for name in new if (folder / f"{name}{_PUBLIC}").exists()]
    if alone and not replace:
        raise ValueError(
            f"{folder} has the public key of {', '.join(alone)} without its private key: a new "
            "pair would replace it, "
            "and messages signed with the old private key would be refused; --replace does that"
        )
    folder.mkdir(parents=True, exist_ok=True)
    for name in new:
        key = Ed25519PrivateKey.generate()
        private = key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
        file = os.open(folder / f"{name}{_PRIVATE}", os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(file, "wb") as opened:
            opened.write(private)
        _write_public(key, folder / f"{name}{_PUBLIC}")
    for name in names:  # an interrupted run may have left out the public key
        if not (folder / f"{name}{_PUBLIC}").exists():
            _write_public(_read_private(folder / f"{name}{_PRIVATE}"), folder / f"{name}{_PUBLIC}")
    return new


def _write_public(key: Ed25519PrivateKey, path: Path) -> None:
    """Write the public key that belongs to a private one."""
    public = key.public_key().public_bytes(
        serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo
    )
    path.write_bytes(public)


class Signer:
    """Signs messages with the private key of an agent or of the manager.

    Raises:
        ValueError: The private key does not exist, can be read by others, or is invalid.
    """

    def __init__(self, folder: Path, name: str) -> None:
        path = folder / f"{name}{_PRIVATE}"
        if not path.exists():
            raise ValueError(f"there is no private key {path}; `roletrust robots keys` makes one")
        if path.stat().st_mode & 0o077:
            raise ValueError(
                f"{path} can be read by others; restrict it to its owner with `chmod 600 {path}`"
            )
        self.key = _read_private(path)

    def sign(self, data: bytes) -> bytes:
        """Return the signature of some bytes."""
        return self.key.sign(data)


class KnownKeys:
    """Public keys by name, as a `Keyring` of the known senders.

    Args:
        keys: Public keys by name; those that are added later count, too.
    """

    def __init__(self, keys: Mapping[str, Ed25519PublicKey]) -> None:
        self._keys = keys

    def __contains__(self, sender: object) -> bool:
        """Return whether there is a key of that name, see `Keyring`."""
        return sender in self._keys

    def verifies(self, sender: str, signed: bytes, signature: bytes) -> bool:
        """Return whether a signature is valid, see `Keyring.verifies`."""
        try:
            self._keys[sender].verify(signature, signed)
        except InvalidSignature:
            return False
        return True


class PublicKeys(KnownKeys):
    """The public keys in a folder, as a `Keyring` of the known senders.

    Args:
        folder: Folder with the keys.
        needed: Names that must have a key.

    Raises:
        ValueError: The folder has no public key or lacks a needed one, or one is invalid.
    """

    def __init__(self, folder: Path, needed: Iterable[str] = ()) -> None:
        super().__init__(
            {path.stem: _read_public(path) for path in sorted(folder.glob(f"*{_PUBLIC}"))}
        )
        if not self._keys:
            raise ValueError(
                f"there is no public key in {folder}; `roletrust robots keys` makes some"
            )
        missing = [name for name in needed if name not in self._keys]
        if missing:
            raise ValueError(
                f"there is no public key of {', '.join(missing)} in {folder}; `roletrust robots "
                "keys` makes it"
            )

    @property
    def by_name(self) -> Mapping[str, Ed25519PublicKey]:
        """The keys."""
        return self._keys

    @property
    def names(self) -> tuple[str, ...]:
        """Names that have a key."""
        return tuple(self._keys)


def _read_private(path: Path) -> Ed25519PrivateKey:
    key: object = None
    with suppress(ValueError, TypeError, UnsupportedAlgorithm):
        key = serialization.load_pem_private_key(path.read_bytes(), password=None)
    if not isinstance(key, Ed25519PrivateKey):
        raise ValueError(f"{path} is not a private ed25519 key")
    return key


def _read_public(path: Path) -> Ed25519PublicKey:
    key: object = None
    with suppress(ValueError, UnsupportedAlgorithm):
        key = serialization.load_pem_public_key(path.read_bytes())
    if not isinstance(key, Ed25519PublicKey) or is_forgeable(key):
        raise ValueError(f"{path} is not a public ed25519 key")
    return key
