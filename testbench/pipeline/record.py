"""Record devices alone, without an arm."""

from __future__ import annotations

from testbench.drivers.session_time import SessionTime
from testbench.execution.device_recorder import record_devices
from testbench.execution.devices import open_devices, scan_devices
from testbench.execution.options import RunOptions
from testbench.pipeline.arm import refuse_missing_devices
from testbench.pipeline.request import RecordRequest
from testbench.pipeline.watcher import Watcher
from testbench.records.session.session import Session


def record(asked: RecordRequest, watcher: Watcher | None = None) -> Session:
    """Record devices into a session.

    Args:
        asked: Which devices, for how long.
        watcher: Who looks on.

    Raises:
        InputError: Nothing to record, or something cannot be meant.
        DriverError: A device cannot be opened (nothing is written then), failed, or no device gave
            a sample.
        RunInterrupted: Interrupted before the duration was over; the session is kept.
    """
    watcher = watcher or Watcher()
    refuse_missing_devices(asked.serial, asked.dots)
    devices = open_devices(
        list(asked.serial),
        list(asked.dots),
        SessionTime(watcher.clock),
        asked.dot_payload,
        asked.dot_rate_hz,
        synchronise_dots=asked.dot_sync,
    )
    length = "until Ctrl-C" if asked.duration_s is None else f"for {asked.duration_s:g} s"
    watcher.notify(f"connecting {', '.join(devices.imus)}, then recording {length}")
    options = RunOptions(
        clock=watcher.clock, progress=watcher.progress, say=watcher.say, opened=watcher.opened
    )
    return record_devices(devices, asked.logs, asked.duration_s, asked.name, options)


__all__ = ["record", "scan_devices"]
