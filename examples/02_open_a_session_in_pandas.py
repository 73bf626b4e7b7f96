"""A session's files in pandas: what the gyroscope of a sensor reads beside what the arm says it
went through.

Takes the folder of a session, or the newest one in logs/.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd

session = (
    Path(sys.argv[1]) if len(sys.argv) > 1 else max(Path("logs").glob("*/manifest.json")).parent
)
manifest = json.loads((session / "manifest.json").read_text())
sensor = next(iter(manifest["sensors"]))
print(
    f"{manifest['session']}: {manifest['status']}, {manifest['duration_s']:.1f} s, sensors "
    f"{', '.join(manifest['sensors'])}"
)

imu = pd.read_parquet(session / f"imu_{sensor}.parquet")
truth = pd.read_parquet(session / f"truth_{sensor}.parquet")
print(
    f"{sensor}: {len(imu)} samples, {imu['saturated'].sum()} saturated, "
    f"{imu['counter'].diff().gt(1).sum()} gaps"
)

# The sensor's clock is its own: bring its samples to the host's with what `testbench estimate`
# fitted.
clock = json.loads((session / "estimate" / "estimate.json").read_text())["sensors"][sensor]["clock"]
imu["host_time_ns"] = (imu["device_time_ns"] - 1e9 * clock["offset_s"]) / (
    1 + 1e-6 * clock["drift_ppm"]
)
imu["time_s"] = imu["host_time_ns"] / 1e9

expected = pd.DataFrame(index=imu["time_s"])
measured = imu.set_index("time_s")[[f"gyr_{axis}_rad_s" for axis in "xyz"]]
for axis in "xyz":
    expected[axis] = np.interp(
        imu["host_time_ns"], truth["host_time_ns"], truth[f"rate_{axis}_rad_s"]
    )
difference = np.degrees(measured.to_numpy() - expected)
print("\ngyroscope minus kinematics [deg/s]")
print(difference.describe().loc[["mean", "std", "min", "max"]].round(3))
