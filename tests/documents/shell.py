"""Scripts of the documents, run by a shell as a reader's would be; `testbench` is answered by
processes that have loaded the bench already, unless a script needs ones that it can stop.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copytree
from tempfile import TemporaryDirectory

from tests.documents.blocks import ROOT
from tests.patience import PATIENCE_S
from tests.processes import bench

CLIENT = """\
import json, os, socket, sys
with socket.socket(socket.AF_UNIX) as asked:
    asked.connect(sys.argv[1])
    asked.sendall(json.dumps([os.getcwd(), sys.argv[2:]]).encode())
    asked.shutdown(socket.SHUT_WR)
    code, out, err = json.loads(b"".join(iter(lambda: asked.recv(65536), b"")))
sys.stdout.write(out)
sys.stderr.write(err)
sys.exit(code)
"""


def run_script(script: str, folder: Path, own_processes: bool = False) -> tuple[int, str, str]:
    """Run a script in a folder: its exit code, and what it printed.

    Args:
        script: For bash.
        folder: Where; the shipped protocols and the examples are there, as in the repository.
        own_processes: Whether each `testbench` is a process of the script, which it can stop.
    """
    for name in ("protocols", "examples"):
        if not (folder / name).exists():
            copytree(ROOT / name, folder / name)  # not linked: commands write into them
    with TemporaryDirectory() as place, _answering(Path(place) / "bench") as address:
        client = Path(place) / "client.py"
        client.write_text(CLIENT, encoding="utf-8")
        asked = f'"{sys.executable}" -m testbench'
        if not own_processes:
            asked = f'"{sys.executable}" -S -I "{client}" "{address}"'
        else:
            script = f"set -m\ntrap 'kill $(jobs -p) 2>/dev/null || true' EXIT\n{script}"
        apart = f'testbench_process() {{ "{sys.executable}" -m testbench "$@"; }}\n'
        python = f'python() {{ "{sys.executable}" -W error "$@"; }}\n'
        done = subprocess.run(
            ["bash", "-c", f'testbench() {{ {asked} "$@"; }}\n{apart}{python}{script}'],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            check=False,
            timeout=4 * PATIENCE_S,
        )
    return done.returncode, done.stdout, done.stderr


@contextmanager
def _answering(address: Path) -> Iterator[Path]:
    """A socket that runs one command a connection."""
    server = socket.socket(socket.AF_UNIX)
    server.bind(str(address))
    server.listen()
    thread = threading.Thread(target=_serve, args=(server,), daemon=True)
    thread.start()
    try:
        yield address
    finally:
        server.shutdown(socket.SHUT_RDWR)
        server.close()
        thread.join(PATIENCE_S)


def _serve(server: socket.socket) -> None:
    while True:
        try:
            connection, _ = server.accept()
        except OSError:
            return
        with connection:
            with connection.makefile("rb") as asked:
                folder, words = json.load(asked)
            done = bench(*words, cwd=Path(folder))
            answer = [done.returncode, done.stdout, done.stderr]
            connection.sendall(json.dumps(answer).encode())
