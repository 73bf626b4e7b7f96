"""The process that drives an arm; started by `link.Link`, never by a person.

One loop at the streaming rate with absolute deadlines: take samples, look at the controller's
state, advance the step under way, feed the controller's watchdog where it has one. Whatever goes
wrong, the arm is stopped first and reported afterwards.
"""

from __future__ import annotations

import faulthandler
import gc
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from testbench.clock import Clock, SystemClock
from testbench.drivers.arms.client import ArmClient, ArmFault, Row
from testbench.drivers.arms.helper import Helper
from testbench.drivers.arms.onset import LEAD_S, Onset
from testbench.drivers.arms.outbox import Outbox
from testbench.drivers.arms.settings import STOP_RAD_S2, LinkSettings, Motion
from testbench.drivers.arms.standing import REST_RAD_S, RestWatch, Standing

SENT_KEPT_S = 0.4
"""Targets sent within this time are compared with what is reached: longer than lookahead and servo
lag together [s].
"""
SETTLED_FOR_S = 0.05
"""A pose counts as reached once the joints are at rest in it for so long [s]."""
STALE_S = 0.05
"""An error of following is none when the newest sample is older: then it is the controller's
silence [s].
"""
SEEN_S = 1.5
"""An arm that was told to stop must be seen at rest within this time [s]; else it is stopped from
outside.
"""
LOOK_AFTER_S = 0.05
"""Whether the client library is stuck is looked at this often [s]."""
LOST_S = 0.2
"""A command over a connection that is lost is given this time to come back [s]."""
STUCK_EXIT = 70
FLUSH_S = 1.0
"""The last words to the bench have this long to be sent [s]."""
Bench = Connection | Outbox
PATIENCE = 3.0
"""A move may take this many times as long as planned, and 5 s."""
LATE_NS = 1_000_000
"""A deadline missed by more counts as an overrun [ns]."""
HAND_OVER_S = 0.05
"""Samples go to the bench this often [s]."""

SAYING_S = 0.5
"""While nothing is recorded the bench hears at least this often that the arm is looked after
[s].
"""
CONNECTING = {
    "step_started": "connecting_started",
    "step_settled": "",
    "step_ended": "connecting_ended",
}
"""What the events of a step are called on the way to a step that does not follow on the one
before.
"""
REALTIME_PRIORITY = 20
"""Of the first-in-first-out class: above every ordinary process, below the kernel's own threads."""


class Stopped(Exception):
    """The bench asked for a stop."""


class Worker:
    """The loop, which goes by the client's clock.

    Args:
        connection: To the bench.
        client: Of the controller.
        settings: As the bench said.
    """

    def __init__(self, connection: Bench, client: ArmClient, settings: LinkSettings):
        self.connection, self.client, self.settings = connection, client, settings
        self.period_ns = round(1e9 / settings.control_hz)
        self.origin_ns: int | None = None
        self.queue: list[Motion] = []
        self.more_to_come = True
        self.rows: list[tuple[Any, ...]] = []
        self.heard = self.handed = client.now()
        self.paused = self.holding = False
        self.cycles = self.overruns = self.missed = self.latest_ns = 0
        self.lateness = np.zeros(2001, dtype=np.int64)  # histogram, 10 us a bin
        self.sent: list[np.ndarray] = []
        self.streamed: np.ndarray | None = None
        self.onset = Onset()
        self.stopping = False
        self.realtime = os.sched_getscheduler(0) == os.SCHED_FIFO

    def serve(self) -> None:
        """Do what the bench asks until it lets go."""
        while True:
            try:
                message = self._next_request()
            except ArmFault as fault:
                self._fault(fault.kind, str(fault))
                while (
                    self.connection.recv()[0] != "close"
                ):  # whatever else is asked for was asked before the fault was heard of
                    pass
                return
            if message[0] == "close":
                return
            if message[0] == "approach":
                self._guarded([message[1]], "approached")
            elif message[0] == "run":
                self.origin_ns = message[1]
                self.client.clock.begin()
                self._guarded([], "done")

    def _next_request(self) -> tuple[Any, ...]:
        """Between motions: samples go on while the bench records."""
        while True:
            if self.connection.poll(0.02):
                message = self.connection.recv()
                if message[0] in {"approach", "run", "close"}:
                    return tuple(message)
            self.client.keep_alive()
            self._keep(self.client.samples())
            if self.origin_ns is not None:
                self._hand_over()

    def _guarded(self, motions: list[Motion], finished: str) -> None:
        """Run motions; a fault stops the arm and is told."""
        self.queue, self.more_to_come = motions, finished == "done"
        self.heard = self.client.now()
        gc.disable()
        try:
            self._loop(self._steps())
            self._hand_over(force=True)
            self._say(finished, self.client.q.copy())
        except Stopped as stop:
            self._say("stopped", str(stop), self._stop_arm())
        except ArmFault as fault:
            self._fault(fault.kind, str(fault))
        except (EOFError, BrokenPipeError, ConnectionError):
            self._stop_arm()
            raise
        except Exception as error:  # a bug must not leave the arm moving
            self._fault("driver", f"the driver of the arm failed: {type(error).__name__}: {error}")
        finally:
            gc.enable()

    def _fault(self, kind: str, message: str) -> None:
        """Stop the arm, then tell of a fault and when it was found."""
        found_ns = self.client.now_ns()
        self._say("fault", kind, message, found_ns, self._stop_arm())

    def give_up(self) -> None:
        """The client library does not come back from a command: stop the arm without it, tell of
        it, and end this process. Called from another thread, while the loop waits for the library.
        """
        found_ns, stuck_s, lost = self.client.now_ns(), self.client.stuck_for, self.client.lost
        kind, said = "slow_response", f"no command was answered within {stuck_s:.1f} s"
        if lost:
            kind, said = "disconnect", f"the connection to the controller was lost: {lost}"
        standing = self.client.stop_from_outside(STOP_RAD_S2)
        with suppress(OSError):
            self.connection.send(("timing", self.timing()))
            self.connection.send(("fault", kind, said, found_ns, standing))
        if isinstance(self.connection, Outbox):
            self.connection.flush(FLUSH_S)
        os._exit(STUCK_EXIT)

    def _say(self, *message: Any) -> None:
        self._hand_over(force=True)
        self.connection.send(("timing", self.timing()))
        self.connection.send(message)

    def timing(self) -> dict[str, Any]:
        """How the deadlines were kept."""
        total = np.cumsum(self.lateness)
        count = int(total[-1])
        at = (
            [float(np.searchsorted(total, share * count)) * 10e-6 for share in (0.5, 0.99)]
            if count
            else [0.0, 0.0]
        )
        return {
            "cycles": self.cycles,
            "overruns": self.overruns,
            "late_median_s": at[0],
            "late_p99_s": at[1],
            "late_max_s": round(1e-9 * self.latest_ns, 6),
            "samples_missed": self.missed,
            "clock_unsure_s": round(1e-9 * self.client.clock.unsure_ns, 6),
            "realtime_priority": self.realtime,
        }

    def _loop(self, steps: Iterator[None]) -> None:
        """One turn a control period, each at its own absolute deadline."""
        due = self.client.now_ns()
        for _ in steps:
            due += self.period_ns
            late = self.client.now_ns() - due
            if late < 0:
                self.client.time.sleep(-late * 1e-9)
                late = self.client.now_ns() - due
            self.cycles += 1
            self.latest_ns = max(self.latest_ns, late)
            self.lateness[min(max(late, 0) // 10_000, 2000)] += 1
            if late > LATE_NS:
                self.overruns += 1
            if (
                late > 50 * self.period_ns
            ):  # a stall: the rhythm begins anew, what was missed is not made up in a burst
                due += late
            self._keep(self.client.samples())
            self.client.check()
            self._listen()
            self._hand_over()

    def _listen(self) -> None:
        now = self.client.now()
        while self.connection.poll():
            message = self.connection.recv()
            self.heard = now
            if message[0] == "stop":
                raise Stopped(message[1])
            if message[0] == "close":
                raise EOFError
            if message[0] == "motion":
                self.queue.append(message[1])
            elif message[0] == "no_more":
                self.more_to_come = False
            elif message[0] in {"pause", "resume"}:
                self.paused = message[0] == "pause"
        if now - self.heard > self.settings.host_silence:
            raise ArmFault(
                "host_silence", f"the bench was silent for {self.settings.host_silence:g} s"
            )

    def _keep(self, rows: list[Row]) -> None:
        if self.origin_ns is None:
            return
        clock = self.client.clock
        for row in rows:
            host, stamp, *told, target, missed = row
            self.missed += missed
            cause = self.onset.cause(target)
            if cause is not None:
                lead = clock.not_before(stamp, cause)
                host = max(host, clock.at(stamp))
                if lead > LEAD_S:
                    self._tell("arm_time_doubtful", cause, {"lead_s": round(lead, 4)})
            sent = target if self.streamed is None else self.streamed
            self.rows.append((host - self.origin_ns, stamp, *told, sent.copy()))
        for step in clock.steps():
            self._tell("arm_time_step", step.host_ns, {"by_s": round(1e-9 * step.by_ns, 4)})

    def _hand_over(self, force: bool = False) -> None:
        now = self.client.now()
        if self.rows and (force or now - self.handed > HAND_OVER_S):
            columns = [np.array(column) for column in zip(*self.rows, strict=True)]
            self.connection.send(("samples", columns))
            self.rows, self.handed = [], now
        elif now - self.handed > SAYING_S:
            self.connection.send(("alive",))
            self.handed = now

    def _steps(self) -> Iterator[None]:
        """All motions, one turn of the loop at a time."""
        while True:
            while self.paused and self.origin_ns is not None:  # between steps, the arm at rest
                if not self.holding:
                    self.holding = True
                    self._event("paused", -1)
                self.client.keep_alive()
                yield
            if self.holding:
                self.holding = False
                self._event("resumed", -1)
            if not self.queue:
                if not self.more_to_come:
                    return
                self.client.keep_alive()
                yield
                continue
            motion = self.queue.pop(0)
            if motion.kind == "stream":
                self.client.begin_stream()
            self.onset.expect(self.client.now_ns())
            self._event("step_started", motion.index)
            yield from {"move": self._move, "stream": self._stream, "hold": self._hold}[
                motion.kind
            ](motion)
            self._event("step_settled", motion.index)
            yield from self._dwell(motion.dwell)
            self._event("step_ended", motion.index)

    def _move(self, motion: Motion) -> Iterator[None]:
        self.client.move(motion.target, motion.speed, motion.acceleration)
        slowest = max(self.client.slider, 0.01)
        yield from self._settle(motion, PATIENCE * motion.duration / slowest + 5.0)

    def _settle(self, motion: Motion, limit: float) -> Iterator[None]:
        """Wait until the joints rest at the target."""
        end, since = self.client.now() + limit, None
        while True:
            now = self.client.now()
            near = float(np.abs(self.client.q_smooth - motion.target).max()) < self.settings.settled
            still = float(np.abs(self.client.v).max()) < REST_RAD_S
            since = (since or now) if near and still else None
            if since is not None and now - since > SETTLED_FOR_S:
                return
            if now > end:
                away = np.abs(self.client.q - motion.target)
                worst = f"{self._joint(away)} is {np.degrees(away.max()):.3f} deg away"
                raise ArmFault("not_reached", f"a pose was not reached in time; {worst}")
            self._compare(self.client.q_target[None])
            self._keep_target()
            yield

    def _keep_target(self) -> None:
        """Between moves the controller is only kept awake; while streaming, the last target is sent
        again.
        """
        if self.streamed is None:
            self.client.keep_alive()
        else:
            self.client.stream(self.streamed)

    def _stream(self, motion: Motion) -> Iterator[None]:
        """Send the path's targets at the times they are planned for; late turns skip, they never
        bunch.
        """
        assert motion.path is not None
        begin, last = self.client.now_ns(), len(motion.path) - 1
        window = round(SENT_KEPT_S * self.settings.control_hz)
        self.sent = []
        while True:
            k = min((self.client.now_ns() - begin + self.period_ns // 2) // self.period_ns, last)
            self.streamed = motion.path[k]
            self.client.stream(self.streamed)
            self.sent = [*self.sent[-window + 1 :], self.streamed]
            self._compare(np.array(self.sent))
            yield
            if k == last:
                break
        yield from self._settle(motion, 5.0)
        self.client.stop_stream(STOP_RAD_S2)
        self.streamed = None

    def _compare(self, sent: np.ndarray) -> None:
        """Watch the error of following: against whatever was sent lately, so that lag alone is no
        error.
        """
        errors = np.abs(sent - self.client.q)
        nearest = int(errors.max(axis=1).argmin())
        error = float(errors[nearest].max())
        if error <= self.settings.tracking:
            return
        silence = self.client.silent_for
        if silence > STALE_S:  # where the arm is nobody knows: it may well be where it was sent
            raise ArmFault(
                "report_silence",
                f"the controller sent no data for {1000 * silence:.0f} ms of a motion",
            )
        joint = self._joint(errors[nearest])
        raise ArmFault(
            "tracking_error", f"{joint} is {np.degrees(error):.2f} deg from where it was sent"
        )

    def _joint(self, errors: np.ndarray) -> str:
        """Name of the joint whose error is largest; errors of shape (n,)."""
        worst, names = int(errors.argmax()), self.settings.joint_names
        return names[worst] if worst < len(names) else f"joint {worst + 1}"

    def _hold(self, motion: Motion) -> Iterator[None]:
        yield from ()

    def _dwell(self, seconds: float) -> Iterator[None]:
        end = self.client.now() + seconds
        while self.client.now() < end:
            self.client.keep_alive()
            yield

    def _event(self, name: str, index: int) -> None:
        name = CONNECTING.get(name, name) if index < 0 else name
        if self.origin_ns is not None and name:
            self._tell(name, self.client.now_ns(), {"index": index} if index >= 0 else {})

    def _tell(self, name: str, host_ns: int, details: dict[str, Any]) -> None:
        assert self.origin_ns is not None
        self.connection.send(("event", host_ns - self.origin_ns, name, details))

    def _stop_arm(self) -> Standing:
        """Bring the arm to rest by every way there is, record until it rests, and say what was seen
        of it.
        """
        self.stopping = True
        self.client.stop(STOP_RAD_S2)
        watch, end = RestWatch(), self.client.now() + SEEN_S
        while self.client.now() < end and self.client.listening:
            with suppress(Exception):
                rows = self.client.samples()
                self._keep(rows)
                for row in rows:
                    watch.look(1e-9 * row[1], row[3], self.client.may_move)
                if watch.standing is Standing.AT_REST:
                    break
            self.client.time.sleep(0.002)
        self.streamed = None
        if watch.standing.stopped:
            return watch.standing
        with suppress(OSError):
            self.connection.send(("alive",))
        seen = self.client.stop_from_outside(STOP_RAD_S2)
        return watch.standing if seen is Standing.UNKNOWN else seen


def main(descriptor: int) -> None:
    """Serve the bench at the other end of a socket, then end this process."""
    helper = Helper([descriptor])
    faulthandler.enable()  # what a library's crash leaves on stderr is kept with the session
    with suppress(OSError):  # where the system lets it; the loop sleeps nearly all of its time
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(REALTIME_PRIORITY))
    bench = Outbox(Connection(descriptor))
    serve(bench, SystemClock(), helper)
    bench.flush(FLUSH_S)
    os._exit(
        0
        # the destructors of client libraries may wait half a second each for connections that are
        # closed by now
    )


def serve(connection: Bench, time: Clock, helper: Helper | None = None) -> None:
    """Drive an arm as the bench asks, from its settings until it lets go.

    Args:
        connection: To the bench.
        time: What everything here goes by.
        helper: Of a process in which there is nothing else.
    """
    _, kind, settings = connection.recv()
    client: ArmClient = kind(settings, time)
    client.own_process, client.helper = helper is not None, helper
    try:
        _serve(connection, client, settings)
    finally:
        client.close()


def _serve(connection: Bench, client: ArmClient, settings: LinkSettings) -> None:
    try:
        try:
            connection.send(("info", client.connect()))
        except ArmFault as fault:
            connection.send(("fault", fault.kind, str(fault), client.now_ns()))
            return
        worker = Worker(connection, client, settings)
        if client.own_process:
            threading.Thread(target=_look_after, args=(worker,), daemon=True).start()
        worker.serve()
    except (EOFError, ConnectionError):
        client.stop(STOP_RAD_S2)


def _look_after(worker: Worker) -> None:
    """End this process where its client library is stuck in a command, with the arm stopped."""
    client = worker.client
    while worker.stopping or client.stuck_for < (LOST_S if client.lost else worker.settings.stuck):
        client.time.sleep(LOOK_AFTER_S)
    worker.give_up()


if __name__ == "__main__":
    main(int(sys.argv[1]))
