"""Seals: signatures of manifests, which state the hashes of the raw files.

A seal is the Ed25519 signature (RFC 8032) of the bytes of manifest.json: 64 bytes in a file beside
it, and nothing else, so that any other program checks it as well. Keys are PEM: private ones PKCS 8
(RFC 5958) without a password, public ones SubjectPublicKeyInfo (RFC 8410).
"""

from __future__ import annotations

import os
import stat
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbench.exceptions import InputError, SessionError
from testbench.extras import missing_extra
from testbench.records.disk.replacing import replaced_file, stored, stored_where_asked
from testbench.records.session.layout import MANIFEST, SEAL
from testbench.records.session.manifest import RunStatus
from testbench.records.session.raw_files import check_raw_files, refuse_changed
from testbench.records.session.session import Session

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import (
        Ed25519PrivateKey,
        Ed25519PublicKey,
    )

PUBLIC_SUFFIX = ".pub"
OWNER_ONLY = 0o600
LARGEST_KEY = 100_000
"""Bytes of a file that is read as a key; one of Ed25519 has 120."""
EXTRA = "seal"


def new_keys(private: Path) -> Path:
    """Make a pair of keys: the private one for its owner alone, the public one beside it.

    Args:
        private: File for the private key; the other is called the same with `.pub`.

    Returns:
        The file of the public key.

    Raises:
        InputError: One of them exists, lies in a session, or cannot be written.
        StorageError: The disk is full.
    """
    serialization, ed25519, _ = _library()
    public = private.with_name(private.name + PUBLIC_SUFFIX)
    _refuse_inside(private)
    for file in (private, public):
        if os.path.lexists(file):
            raise InputError(f"{file} exists already; it is kept, not replaced")
    key = ed25519.Ed25519PrivateKey.generate()
    secret = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    shown = key.public_key().public_bytes(
        serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo
    )
    _write_key(private, secret, OWNER_ONLY)
    try:
        _write_key(public, shown)
    except BaseException:
        private.unlink(missing_ok=True)  # it has sealed nothing yet
        raise
    return public


def seal(session: Session, key: Path) -> Path:
    """Sign the manifest of a session whose raw files are what it states.

    Args:
        session: Closed.
        key: File of the private key.

    Returns:
        The file of the signature, in place of an earlier one.

    Raises:
        InputError: The key cannot be used, lies in a session, or others may read it.
        SessionError: The session is not closed, states no hashes, or a raw file differs from them.
        StorageError: The disk does not take it.
    """
    secret = _private_key(key)
    if session.status is RunStatus.RUNNING:
        raise SessionError(f"{session.path} is not closed: {session.what_to_do_cut_off}")
    refuse_unstated(session)
    refuse_changed(session, check_raw_files(session), remedy="")
    file = session.path / SEAL
    with stored(file), replaced_file(file) as partial:
        partial.write_bytes(secret.sign((session.path / MANIFEST).read_bytes()))
    return file


def refuse_unstated(session: Session) -> None:
    """Refuse a session whose manifest states no hashes.

    Args:
        session: The recording.

    Raises:
        SessionError: It states none.
    """
    if not session.manifest.files:
        raise SessionError(
            f"{session.path / MANIFEST} states no hashes of raw files, so that nothing can be "
            "verified"
        )


def is_sealed(session: Session) -> bool:
    """Whether there is a seal, of whomever."""
    return os.path.lexists(session.path / SEAL)


def refuse_broken_seal(session: Session, public: Path) -> None:
    """Refuse a session that was not sealed by the owner of a key, or was changed since.

    Args:
        session: The recording.
        public: File of the public key, from whoever is trusted and never from the session.

    Raises:
        InputError: The key cannot be used, or lies in a session.
        SessionError: There is no seal, or it is not of this manifest by this key.
    """
    _refuse_inside(public)
    key, file = _public_key(public), session.path / SEAL
    if not file.is_file():
        raise SessionError(f"{session.path} is not sealed: it has no {SEAL}")
    *_, invalid = _library()
    try:
        key.verify(_read_key(file), (session.path / MANIFEST).read_bytes())
    except invalid:
        raise SessionError(
            f"{file} is no signature of {MANIFEST} by {public}: another key sealed it, or the "
            "manifest was changed since"
        ) from None


def _library() -> tuple[Any, Any, type[Exception]]:
    """The modules of keys and their files, and what is raised for a signature that does not fit."""
    try:
        from cryptography.exceptions import InvalidSignature
        from cryptography.hazmat.primitives import serialization
        from cryptography.hazmat.primitives.asymmetric import ed25519
    except ModuleNotFoundError:
        raise InputError(missing_extra("seals need", EXTRA)) from None
    return serialization, ed25519, InvalidSignature


def _private_key(file: Path) -> Ed25519PrivateKey:
    serialization, ed25519, _ = _library()
    _refuse_inside(file)
    content = _read_key(file)
    if stat.S_IMODE(file.stat().st_mode) & ~OWNER_ONLY:
        raise InputError(f"{file} is not for its owner alone: chmod 600 {file}")
    with suppress(ValueError, TypeError):
        key = serialization.load_pem_private_key(content, None)
        if isinstance(key, ed25519.Ed25519PrivateKey):
            return key
    raise InputError(
        f"{file} is no private key of Ed25519 in PEM without a password; `testbench seal "
        "--new-key` makes one"
    )


def _public_key(file: Path) -> Ed25519PublicKey:
    serialization, ed25519, _ = _library()
    content = _read_key(file)
    with suppress(ValueError, TypeError):
        key = serialization.load_pem_public_key(content)
        if isinstance(key, ed25519.Ed25519PublicKey):
            return key
    raise InputError(f"{file} is no public key of Ed25519 in PEM, as `seal --new-key` writes it")


def _read_key(file: Path) -> bytes:
    try:
        if not file.is_file():
            raise InputError(f"{file} is no file")
        with file.open("rb") as stream:
            return stream.read(LARGEST_KEY)
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror or error}") from None


def _write_key(file: Path, content: bytes, mode: int = 0o666) -> None:
    with stored_where_asked(file), replaced_file(file, anew=True, mode=mode) as partial:
        partial.write_bytes(content)


def _refuse_inside(file: Path) -> None:
    """Refuse a key that is handed on with a session, or comes with one.

    Raises:
        InputError: It lies in one.
    """
    for folder in (file.absolute().parent, *file.resolve().parents):
        if (folder / MANIFEST).is_file():
            raise InputError(f"{file} lies in the session {folder}; keys are kept elsewhere")
