"""Bluetooth for synchronous drivers: bleak in a thread's event loop, and search for Xsens DOTs."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Coroutine
from types import ModuleType
from typing import Any, TypeVar

from testbench.drivers.imus.xsens_dot_payload import ADDRESS_PREFIX, ADVERTISED_NAMES, COMPANY_ID
from testbench.exceptions import BenchError, DriverError
from testbench.extras import missing_extra

SCAN_S = 5.0
"""Length of a search [s]; a DOT advertises several times a second."""
T = TypeVar("T")


def import_bleak() -> ModuleType:
    """The package bleak.

    Raises:
        DriverError: It is not installed; names the extra.
    """
    try:
        import bleak
    except ImportError:
        raise DriverError(missing_extra("Bluetooth devices need", "ble")) from None
    return bleak


class BluetoothLoop:
    """An event loop in a thread, shared by all Bluetooth devices of a session.

    Args:
        client: Class with the interface of `bleak.BleakClient`; bleak's own if None.
        scanner: Likewise of `bleak.BleakScanner`.
    """

    def __init__(self, client: Any = None, scanner: Any = None):
        if client is None or scanner is None:
            bleak = import_bleak()
            client, scanner = client or bleak.BleakClient, scanner or bleak.BleakScanner
        self.client, self.scanner = client, scanner
        self.loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="bluetooth", daemon=True)
        self._thread.start()

    def call(self, work: Coroutine[Any, Any, T], timeout_s: float) -> T:
        """Run a coroutine in the loop and wait for it.

        Raises:
            DriverError: It failed or took too long.
        """
        if not self._thread.is_alive():
            work.close()
            raise DriverError("Bluetooth was closed already")
        future = asyncio.run_coroutine_threadsafe(work, self.loop)
        try:
            return future.result(timeout_s)
        except BenchError:
            raise
        except TimeoutError:
            future.cancel()
            raise DriverError(f"Bluetooth did not answer within {timeout_s:g} s") from None
        except Exception as error:  # bleak and its backends raise errors of many kinds
            raise DriverError(f"Bluetooth failed: {describe_error(error)}") from None

    def scan(self, duration_s: float = SCAN_S) -> list[dict[str, Any]]:
        """Xsens DOTs that can be heard: `address`, `name`, `rssi_dBm`, strongest first.

        Raises:
            DriverError: There is no working Bluetooth adapter.
        """
        return self.call(find_dots(self.scanner, duration_s), duration_s + 15)

    def close(self) -> None:
        """End the loop; a second call does nothing."""
        if self._thread.is_alive():
            self.loop.call_soon_threadsafe(self.loop.stop)
            self._thread.join(5)

    def _run(self) -> None:
        asyncio.set_event_loop(self.loop)
        try:
            self.loop.run_forever()
        finally:
            left = asyncio.all_tasks(self.loop)
            for task in left:
                task.cancel()
            self.loop.run_until_complete(asyncio.gather(*left, return_exceptions=True))
            self.loop.close()


async def find_dots(scanner: Any, duration_s: float) -> list[dict[str, Any]]:
    """Listen for advertisements of DOTs: by company, by name, or by address."""
    heard = await scanner.discover(timeout=duration_s, return_adv=True)
    found = []
    for device, advertisement in heard.values():
        name = advertisement.local_name or device.name or ""
        known = (
            COMPANY_ID in (advertisement.manufacturer_data or {}),
            name.lower().startswith(ADVERTISED_NAMES),
            device.address.upper().startswith(ADDRESS_PREFIX),
        )
        if any(known):
            found.append({"address": device.address, "name": name, "rssi_dBm": advertisement.rssi})
    return sorted(found, key=lambda dot: (-(dot["rssi_dBm"] or -999), dot["address"]))


def describe_error(error: BaseException) -> str:
    """What an error says, or its kind if it says nothing."""
    if isinstance(error, FileNotFoundError):
        return "this machine runs no Bluetooth service (BlueZ on the D-Bus system bus)"
    return str(error) or type(error).__name__
