"""Start the viewer on a recording: a window, a browser, or nothing but a picture; nothing is left
running.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from urllib.parse import quote

from testbench.exceptions import BenchError
from testbench.frames import NANOSECONDS
from testbench.records.disk.replacing import replaced_file, stored_where_asked
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.layout import RECORDING
from testbench.records.session.session import Session
from testbench.reporting.viewer.recording import save_recording
from testbench.reporting.viewer.timeline import TIMELINE

LOOPBACK = "127.0.0.1"
EVERYWHERE = ("0.0.0.0", "::")
WEB_PORT = 9090
START_TIMEOUT, TIMELINE_TIMEOUT = 30.0, 30.0
"""How long the viewer may take to answer, and then to load so much that it knows the timelines
[s].
"""
REFUSALS = (ConnectionError, RuntimeError)
"""What the viewer's client raises: the first for everything that the viewer itself refuses
(rerun-sdk 0.41), the second for what it cannot ask for.
"""
ASKS = 8
"""How often a picture is asked for: the viewer gives up on one that it has not painted within 15 s
(rerun-sdk 0.41, `ViewerClient.save_screenshot`), which software drawing on a busy machine exceeds.
"""


class ViewerError(BenchError):
    """The viewer could not be started, or could not draw."""


@dataclass(frozen=True)
class Where:
    """Where a session is looked at: in a window, or on a page that is served.

    Attributes:
        web: Serve to browsers instead of opening a window.
        port: Of the page; one that is free if None, 9090 where it is.
        bind: Address of this machine that is listened at.
    """

    web: bool = False
    port: int | None = None
    bind: str = LOOPBACK


@dataclass(frozen=True)
class Doors:
    """How a viewer is started, and how it is reached.

    Attributes:
        options: Of the viewer.
        listens: Host and port that what is drawn is sent to.
        page: To open in a browser; empty where there is a window.
    """

    options: list[str]
    listens: tuple[str, int]
    page: str = ""

    @property
    def proxy(self) -> str:
        """The same as rerun spells it."""
        host, port = self.listens
        return f"rerun+http://{_in_address(host)}:{port}/proxy"


def doors(where: Where) -> Doors:
    """Ports that are free, and the address that they have."""
    port = free_port()
    options = ["--bind", where.bind, "--port", str(port)]
    near = LOOPBACK if where.bind in EVERYWHERE else where.bind
    if not where.web:
        return Doors(options, (near, port))
    page = where.port or (WEB_PORT if _is_free(WEB_PORT) else free_port())
    host = _in_address(socket.gethostname() if where.bind in EVERYWHERE else where.bind)
    options += ["--serve-web", "--web-viewer-port", str(page)]
    if where.bind != LOOPBACK:  # a page from elsewhere is let in by its name only
        options += ["--cors-allow-origin", f"http://{host}:{page}"]
    source = quote(f"rerun+http://{host}:{port}/proxy", safe="")
    return Doors(options, (near, port), f"http://{host}:{page}/?url={source}")


def _in_address(host: str) -> str:
    """A host as addresses spell it."""
    return f"[{host}]" if ":" in host else host


def view(
    session: Session,
    where: Where | None = None,
    estimate: Estimate | None = None,
    evaluation: Evaluation | None = None,
    announce: Callable[[str], None] | None = None,
) -> None:
    """Show a session until the viewer is closed, or until Ctrl-C.

    Args:
        session: The recording; session.rrd is written into its folder.
        where: In a window if None.
        estimate: As `save_recording` takes it.
        evaluation: Of its errors, as `save_recording` takes it.
        announce: Told where to look: the file, or the address of the page.

    Raises:
        ViewerError: The viewer is not installed, or ended with an error.
    """
    path = save_recording(session, session.path / RECORDING, estimate, evaluation)
    found = doors(where or Where())
    quiet = bool(found.page)  # its own words name several addresses
    with running_viewer([*found.options, str(path)], quiet) as process, ended_by_signal():
        if announce is not None:
            announce(found.page or str(path))
        try:
            code = process.wait()
        except KeyboardInterrupt:
            return
    if code != 0:
        raise ViewerError(
            f"the viewer ended with code {code}; without a screen use --web, --save or "
            "--screenshot; a port may be taken"
        )


@dataclass(frozen=True)
class Picture:
    """What a picture shows.

    Attributes:
        time_s: Instant, from the start of the session [s]; two thirds into its longest section if
            None.
        size: Width and height [pixels].
        only: The one pane that is drawn; all if None.
    """

    time_s: float | None = None
    size: tuple[int, int] = (1920, 1200)
    only: str | None = None


def screenshot(
    session: Session,
    path: str | Path,
    estimate: Estimate | None = None,
    evaluation: Evaluation | None = None,
    picture: Picture | None = None,
) -> Path:
    """Draw what the viewer shows into a PNG, without a screen.

    Args:
        session: The recording.
        path: The .png file to write.
        estimate: As `save_recording` takes it.
        evaluation: Of its errors, as `save_recording` takes it.
        picture: What it shows; the usual if None.

    Returns:
        The path.

    Raises:
        ViewerError: There is no Vulkan driver to draw with, or the viewer failed otherwise.
        NotFoundError: There is no such pane.
        InputError: The place cannot be written to.
        StorageError: The disk is full.
    """
    path, picture = Path(path), picture or Picture()
    with tempfile.TemporaryDirectory(prefix="testbench_view_") as folder:
        drawn, file = Path(folder) / "picture.png", Path(folder) / RECORDING
        recording = save_recording(session, file, estimate, evaluation, picture.only)
        port, (width, height) = free_port(), picture.size
        options = ["--bind", LOOPBACK, "--port", str(port), "--headless"]
        options += ["--window-size", f"{width}x{height}", str(recording)]
        time_s = _telling_time(session) if picture.time_s is None else picture.time_s
        with running_viewer(options, quiet=True) as process:
            _draw(process, port, drawn, time_s)
        with stored_where_asked(path), replaced_file(path) as partial:
            shutil.copyfile(drawn, partial)
    return path


def _draw(process: subprocess.Popen[bytes], port: int, path: Path, time_s: float) -> None:
    """Ask a running viewer for a picture once it has loaded and drawn everything."""
    from rerun.experimental import ViewerClient

    client, loaded = None, False
    pause = threading.Event()  # nothing sets it: a wait that a clock in a test could replace
    waited = 0.0
    while client is None or not loaded:
        if process.poll() is not None:
            raise ViewerError(
                f"the viewer ended with code {process.returncode} before it drew anything; drawing "
                "without a screen needs Vulkan (Debian: libvulkan1 and mesa-vulkan-drivers)"
            )
        if waited > START_TIMEOUT:
            raise ViewerError(f"the viewer did not answer within {START_TIMEOUT:.0f} s")
        try:
            client = client or ViewerClient.connect(f"rerun+http://{LOOPBACK}:{port}/proxy")
            state = client.get_state()
            loaded = bool(state.recordings) and not state.loading
        except (*REFUSALS, OSError):
            client = None
        pause.wait(0.2)
        waited += 0.2
    _go_to(client, time_s, pause)
    pause.wait(2.0)
    _paint(client, path)


def _paint(client: Any, path: Path) -> None:
    """Have the viewer write what it shows.

    Each time it is asked for a file of its own: an earlier one may still be on its way.

    Raises:
        ViewerError: It refuses, is never done in time, or wrote nothing.
    """
    for ask in range(ASKS):
        own = path.with_name(f"{path.stem}-{ask}{path.suffix}")
        try:
            client.save_screenshot(str(own))
        except TimeoutError:
            continue
        except REFUSALS as error:
            raise _refused(error) from None
        if not own.is_file():
            raise ViewerError(f"the viewer wrote no picture to {own}")
        own.replace(path)
        return
    raise ViewerError(
        f"the viewer painted no picture in {ASKS} attempts of 15 s; where the machine is busy, try "
        "again later"
    )


def _go_to(client: Any, time_s: float, pause: threading.Event) -> None:
    """Set the time of the picture [s].

    A recording that is still being loaded has no timelines for a while.

    Raises:
        ViewerError: It still has none after `TIMELINE_TIMEOUT`, or the viewer refuses for another
            reason.
    """
    waited = 0.0
    while True:
        try:
            return client.set_time(TIMELINE, duration=time_s, play_state="paused")
        except TimeoutError:  # after 15 s of its own, as for a picture
            waited += 15.0
        except REFUSALS as error:
            if "timeline" not in str(error):
                raise _refused(error) from None
        if waited > TIMELINE_TIMEOUT:
            raise ViewerError(
                f"the viewer has not loaded the recording within {TIMELINE_TIMEOUT:.0f} s; where "
                "the machine is busy, try again later"
            )
        pause.wait(0.2)
        waited += 0.2


def _refused(error: Exception) -> ViewerError:
    """Why it could not draw: the first line, for what follows is the transport's."""
    lines = str(error).strip().splitlines()
    return ViewerError(f"the viewer could not draw: {lines[0] if lines else 'it says nothing'}")


def _telling_time(session: Session) -> float:
    """Two thirds into the longest section, where there is most to see [s]."""
    steps = session.steps
    if not steps:
        return (session.manifest.duration_s or 0.0) * 0.6
    spans: dict[str, tuple[int, int]] = {}
    for step in steps:
        begin, _ = spans.get(step.section, (step.start_ns, 0))
        spans[step.section] = (begin, step.end_ns)
    begin, end = max(spans.values(), key=lambda span: span[1] - span[0])
    return (begin + 2 * (end - begin) / 3) / NANOSECONDS


@contextmanager
def ended_by_signal() -> Iterator[None]:
    """Let a polite request to end (SIGTERM) stop the wait like Ctrl-C, so that the viewer ends too.

    In the main thread only.
    """

    def stop(signum: int, frame: object) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)


@contextmanager
def running_viewer(options: list[str], quiet: bool) -> Iterator[subprocess.Popen[bytes]]:
    """The viewer as a child process that ends with the block."""
    with tempfile.TemporaryDirectory(prefix="testbench_viewer_") as folder:
        output = subprocess.DEVNULL if quiet else None
        command = [str(viewer_program()), *options]
        process = subprocess.Popen(
            command, env=_environment(Path(folder)), stdout=output, stderr=output
        )
        try:
            yield process
        finally:
            if process.poll() is None:
                process.terminate()
                try:
                    process.wait(5.0)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


def viewer_program() -> Path:
    """The viewer's own binary: killing the `rerun` command, which wraps it, would leave it running.

    Raises:
        ViewerError: The package holds none for this machine.
    """
    package = find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise ViewerError("rerun-sdk is not installed")
    folder = Path(package.origin).parent
    for name in ("rerun", "rerun.exe"):
        if (folder / name).is_file():
            return folder / name
    raise ViewerError(f"rerun-sdk holds no viewer for this machine (looked in {folder})")


def _environment(folder: Path) -> dict[str, str]:
    """The environment with a configuration of the viewer's own, in which its usage statistics are
    off.
    """
    file = folder / "rerun" / "analytics.json"
    file.parent.mkdir()
    # All five entries are needed: with one missing the viewer takes the file for damaged and turns
    # its statistics on.
    settings = {"analytics_enabled": False, "analytics_id": "none", "metadata": {}}
    paths = {"config_file_path": str(file), "data_dir_path": str(folder / "statistics")}
    file.write_text(json.dumps({**settings, **paths}), encoding="utf-8")
    return {**os.environ, "XDG_CONFIG_HOME": str(folder)}


def free_port() -> int:
    """A port of this machine that nothing listens on."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def _is_free(port: int) -> bool:
    """Whether nothing of this machine listens on a port."""
    with socket.socket() as probe:
        return probe.connect_ex((LOOPBACK, port)) != 0
