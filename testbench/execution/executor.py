"""The stage `execute`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from testbench.clock import SystemClock
from testbench.drivers.arms.base import SteppingArm
from testbench.drivers.arms.catalogue import SIM, make_arm, session_time
from testbench.drivers.arms.entry import WantedArm
from testbench.execution.loop import RunLoop
from testbench.execution.options import RunOptions
from testbench.execution.recorder import RunRecorder, recorded_ns
from testbench.execution.run_progress import ProgressMeter
from testbench.execution.sensors import Sensors
from testbench.records.session.manifest import SensorRecord
from testbench.records.session.plan import Plan
from testbench.records.session.session import Session


def execute(
    plan: Plan,
    logs: str | Path | None = None,
    seed: int | None = None,
    options: RunOptions | None = None,
) -> Session:
    """Run a plan on the simulated arm and record it.

    Args:
        plan: A checked motion.
        logs: Folder that sessions are made in; that of the options if None.
        seed: Of every random number of the simulation, the same seed gives the same raw files; that
            of the options if None.
        options: The rest.

    Raises:
        RunInterrupted: The operator pressed Ctrl-C; the session is kept and closed as interrupted.
        DriverError: The arm or a sensor failed; the session is kept and closed as an error.
    """
    options = options or RunOptions()
    options = replace(
        options,
        logs=options.logs if logs is None else logs,
        seed=options.seed if seed is None else seed,
    )
    clock = options.clock or SystemClock()
    time = session_time(SIM.name, clock, options.speed, recorded_ns(options.resumed))
    arm = make_arm(SIM.name, plan, WantedArm(seed=options.seed), time)
    return execute_on_arm(plan, arm, Sensors.simulated(plan, options.seed, arm.felt), options)


def execute_on_arm(
    plan: Plan, arm: SteppingArm, sensors: Sensors, options: RunOptions | None = None
) -> Session:
    """Run a plan on an arm of any kind, and record it.

    Args:
        plan: A checked motion.
        arm: Not yet connected; it is let go in every case.
        sensors: On it; they are let go in every case.
        options: The rest; speed, clock and resumption are a simulated arm's.

    Raises:
        ArmRefused: The arm must not be driven; nothing moved and there is no session.
        DriverError: A live sensor delivers nothing, or no controller answers; nothing moved. Or
            arm, sensor or guard ended the run; the arm was stopped, the session is kept and closed
            as an error. Its notes say what to do.
        RunInterrupted: The operator stopped it; the session is kept.
    """
    options = options or RunOptions()
    try:
        sensors.listen()
        arm.connect()
        if arm.notice:
            options.notify(arm.notice)
        arm.check_way(plan, options.steps)
        recorder = RunRecorder(plan, arm, sensors, options)
        options.opened(recorder.path)
        meter = ProgressMeter(plan, recorder.steps, options.progress)
        return RunLoop(arm, sensors, recorder, meter, options, plan).run()
    finally:
        arm.close()
        sensors.close()


def simulated_sensors(plan: Plan) -> dict[str, SensorRecord]:
    """How the manifest describes the sensors of a simulated run."""
    return Sensors.simulated(plan, 0).described()
