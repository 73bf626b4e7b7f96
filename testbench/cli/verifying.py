"""The commands `verify` and `seal`: whether a session is what was recorded, and by whom."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbench.cli.options import JsonOption, SessionArgument
from testbench.cli.output import say, say_json

SEALED, UNCHECKED, NONE = "sealed by this key", "not checked", "none"


def verify(
    session: SessionArgument,
    key: Annotated[
        Path | None,
        typer.Option(
            "--key",
            metavar="FILE",
            help="Public key that the session must be sealed by; from whom you trust, never from "
            "the session.",
        ),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Compare every raw file with its hash, read anew, and the manifest with its seal."""
    from testbench.records.session.raw_files import check_raw_files, refuse_changed
    from testbench.records.session.seal import is_sealed, refuse_broken_seal, refuse_unstated
    from testbench.records.session.session import Session

    opened = Session(session)
    refuse_unstated(opened)
    found = check_raw_files(opened)
    refuse_changed(opened, found, remedy="")
    if key is not None:
        refuse_broken_seal(opened, key)
    state = SEALED if key is not None else UNCHECKED if is_sealed(opened) else NONE
    if json:
        say_json({"session": str(session), "files": found.names, "seal": state})
        return
    say(f"{session}: {len(found.names)} raw files are what was recorded")
    if state == SEALED:
        say(f"seal: by the owner of {key}")
    elif state == UNCHECKED:
        say("seal: there is one, of whom is not known; name the public key with --key")
    else:
        say("seal: none, so that files and hashes may have been changed together")


def seal(
    session: Annotated[
        Path | None, typer.Argument(help="Folder of a session that is closed.")
    ] = None,
    key: Annotated[
        Path | None, typer.Option("--key", metavar="FILE", help="Private key to sign with.")
    ] = None,
    new_key: Annotated[
        Path | None,
        typer.Option(
            "--new-key",
            metavar="FILE",
            help="Make a private key in this file, and its public key in FILE.pub, instead.",
        ),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Sign the manifest of a session, which states the hashes of all that was recorded."""
    from testbench.exceptions import InputError
    from testbench.records.session.seal import new_keys
    from testbench.records.session.seal import seal as seal_session
    from testbench.records.session.session import Session

    if new_key is not None:
        if session is not None or key is not None:
            raise InputError("--new-key makes keys, and seals nothing; seal with --key then")
        public = new_keys(new_key)
        if json:
            say_json({"private_key": str(new_key), "public_key": str(public)})
            return
        say(f"private key: {new_key}, for you alone")
        say(f"public key: {public}, for whoever verifies")
        return
    if session is None or key is None:
        raise InputError("name a session and --key, or --new-key to make keys first")
    file = seal_session(Session(session), key)
    if json:
        say_json({"session": str(session), "seal": str(file)})
    else:
        say(f"sealed: {file}")
