"""Options that several commands share, and what they mean."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from testbench.pipeline.request import AnalysisRequest
    from testbench.records.session.session import Session
    from testbench.records.specs.injected_error import InjectedError


def typed_plateaus(given: list[str]) -> dict[str, list[float]]:
    """Angles by joint, as `--plateaus` gives them.

    Raises:
        InputError: One is not written as it must be, or a joint is given twice.
    """
    from testbench.exceptions import InputError

    found: dict[str, list[float]] = {}
    for text in given:
        joint, _, angles = text.partition("=")
        try:
            values = [float(angle) for angle in angles.split(",")]
        except ValueError:
            values = []
        if not joint.strip() or not values or joint.strip() in found:
            raise InputError(
                f"--plateaus {text}: write it once a joint, as JOINT=DEG,DEG,..., e.g. "
                "elbow=30.1,17.2,29.5"
            )
        found[joint.strip()] = values
    return found


def injected_errors(given: list[str]) -> list[InjectedError]:
    """Errors to put into a recording, as `--inject` gives them.

    Raises:
        InputError: One is not written as it must be.
    """
    from testbench.exceptions import InputError
    from testbench.records.specs.injected_error import InjectedError

    found = []
    for text in given:
        whose, _, angles = text.partition("=")
        sensor, dot, start = whose.strip().partition(".")
        try:
            off = [float(angle) for angle in angles.split(",")]
        except ValueError:
            off = []
        if not sensor or start not in ("start" if dot else "",) or len(off) != 3:
            raise InputError(
                f"--inject {text}: write it as SENSOR=YAW,PITCH,ROLL or "
                "SENSOR.start=YAW,PITCH,ROLL, e.g. forearm.start=0,0,5"
            )
        found.append(
            InjectedError(sensor=sensor, of="start" if start else "sensor", yaw_pitch_roll_deg=off)
        )
    return found


def complete_protocol(incomplete: str) -> list[str]:
    """Names of protocols that begin so."""
    from testbench.records.specs.shipped import shipped_folder

    return [
        path.stem
        for path in shipped_folder("protocols").glob("*.yaml")
        if path.stem.startswith(incomplete)
    ]


def complete_robot(incomplete: str) -> list[str]:
    """Names of robots that begin so."""
    from testbench.records.specs.robot import list_robots

    return [name for name in list_robots() if name.startswith(incomplete)]


def complete_filter(incomplete: str) -> list[str]:
    """Names of filters that begin so."""
    from testbench.records.specs.protocol import FILTER_NAMES

    return [name for name in FILTER_NAMES if name.startswith(incomplete)]


def complete_filters(incomplete: str) -> list[str]:
    """The last name of a list with commas, as it may go on, with what stands before it."""
    before, comma, last = incomplete.rpartition(",")
    taken = before.split(",")
    return [f"{before}{comma}{name}" for name in complete_filter(last) if name not in taken]


PROTOCOL = typer.Argument(
    help="Protocol file, or the name of one that ships with the bench.",
    autocompletion=complete_protocol,
)
ProtocolArgument = Annotated[str, PROTOCOL]
SessionArgument = Annotated[Path, typer.Argument(help="Folder of a session.")]
RobotOption = Annotated[
    str | None,
    typer.Option(
        "--robot",
        help="Robot name, robot.yaml or URDF, in place of the protocol's.",
        autocompletion=complete_robot,
    ),
]
LogsOption = Annotated[Path, typer.Option("--logs", help="Folder that sessions are made in.")]
SensorOption = Annotated[
    str | None,
    typer.Option("--sensor", help="Which sensor; needed where the session has several."),
]
FiltersOption = Annotated[
    str | None,
    typer.Option(
        "--filters",
        help="Orientation filters, separated by commas: names, or path/to/file.py:ClassName.",
        autocompletion=complete_filters,
    ),
]
PlateausOption = Annotated[
    list[str] | None,
    typer.Option(
        "--plateaus",
        metavar="JOINT=DEG,DEG,...",
        help="Angles that a person read while the joint was held still, plateau by plateau; may be "
        "repeated.",
    ),
]
InjectOption = Annotated[
    list[str] | None,
    typer.Option(
        "--inject",
        metavar="SENSOR[.start]=YAW,PITCH,ROLL",
        help="Put an error into a sensor's orientation, or into the orientation that its segment "
        "is believed to start in, in degrees; nothing is written then. May be repeated.",
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="FILTER.PARAMETER=VALUE",
        help="Set a parameter of a filter, whatever protocol or tuning say; may be repeated.",
    ),
]
CalibrationOption = Annotated[
    Path | None,
    typer.Option(
        "--calibration",
        help="Stored calibration, or a folder of them: each sensor takes its own nearest in time.",
    ),
]
TunedOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--tuned",
        help="Parameters that `testbench tune` found (.json); once for each filter that was tuned.",
    ),
]
CompareOption = Annotated[
    str | None,
    typer.Option(
        "--compare",
        metavar="FILTER",
        help="Compare every filter with this one, such as 'device'; it is not taken for the truth.",
        autocompletion=complete_filter,
    ),
]
SequenceOption = Annotated[
    str | None,
    typer.Option(
        "--sequence",
        metavar="SEQUENCE",
        help="Of the Euler angles of sensors without truth, such as ZYX; else ZYX, or ZXY where "
        "that is in gimbal lock.",
    ),
]
RepeatsOption = Annotated[
    Path | None,
    typer.Option(
        "--repeats",
        metavar="FOLDER",
        help="Folder with further sessions of the same protocol: their scatter tells what another "
        "part, mounting or power-up changes.",
    ),
]
MarkdownOption = Annotated[
    Path | None,
    typer.Option(
        "--markdown", metavar="FILE", help="Write a summary in Markdown, as for a job on GitHub."
    ),
]
JunitOption = Annotated[
    Path | None,
    typer.Option(
        "--junit", metavar="FILE", help="Write JUnit XML for build servers, a case each limit."
    ),
]
ReturnedOption = Annotated[
    bool,
    typer.Option(
        "--returned",
        help="The sensors ended at rest as they began: what their orientation changed by is an "
        "error.",
    ),
]
NoVerifyOption = Annotated[
    bool,
    typer.Option(
        "--no-verify", help="Take raw files as they are, whatever hashes the manifest states."
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON object instead of tables.")
]


def session_of(path: Path, no_verify: bool = False) -> Session:
    """The session of a command, whose raw files are what was recorded unless nobody asks.

    Raises:
        SessionError: The folder is no session, or raw files differ from its hashes.
    """
    from testbench.records.session.raw_files import open_for_analysis

    return open_for_analysis(path, not no_verify)


def entries_of(text: str | None) -> tuple[str, ...] | None:
    """The entries of a comma-separated list; None where the option was left away."""
    if text is None:
        return None
    return tuple(entry.strip() for entry in text.split(",") if entry.strip())


def filter_parameters(given: list[str] | None) -> dict[str, dict[str, float]]:
    """Parameters by filter and name, as `--set` gives them.

    Raises:
        InputError: One is not written as FILTER.PARAMETER=VALUE, or is set twice.
    """
    from testbench.exceptions import InputError

    found: dict[str, dict[str, float]] = {}
    for text in given or []:
        place, equals, value = text.partition("=")
        name, dot, parameter = (part.strip() for part in place.rpartition("."))
        if not (equals and dot and name and parameter):
            raise InputError(
                f"--set {text}: write it as FILTER.PARAMETER=VALUE, e.g. madgwick_marg.beta=0.12"
            )
        try:
            number = float(value)
        except ValueError:
            raise InputError(f"--set {text}: '{value.strip()}' is no number") from None
        if parameter in found.setdefault(name, {}):
            raise InputError(f"--set gives {name}.{parameter} twice; which one?")
        found[name][parameter] = number
    return found


def analysis_request(
    filters: str | None,
    parameters: list[str] | None,
    calibration: Path | None,
    tuned: list[Path] | None,
    report: bool = True,
) -> AnalysisRequest:
    """How to analyse, as the options of a command say."""
    from testbench.pipeline.request import AnalysisRequest

    return AnalysisRequest(
        filters=entries_of(filters),
        parameters=filter_parameters(parameters),
        calibrations=optional(calibration),
        tunings=tuple(map(str, tuned or ())),
        report=report,
    )


def beside(
    asked: AnalysisRequest, repeats: Path | None, no_verify: bool = False
) -> AnalysisRequest:
    """A request with a folder of further sessions of the same protocol."""
    update = {"repeats": None if repeats is None else str(repeats), "verify": not no_verify}
    return asked.model_copy(update=update)


def summed_up(asked: AnalysisRequest, markdown: Path | None, junit: Path | None) -> AnalysisRequest:
    """A request with the summaries that are to be written."""
    return asked.model_copy(update={"markdown": optional(markdown), "junit": optional(junit)})


def described_by(
    asked: AnalysisRequest, compare: str | None, sequence: str | None, returned: bool
) -> AnalysisRequest:
    """A request with how sensors without truth are described.

    Raises:
        InputError: No such Euler sequence.
    """
    from typing import get_args

    from testbench.exceptions import NotFoundError
    from testbench.records.specs.strict import EulerSequence

    known = list(get_args(EulerSequence))
    if sequence is not None and sequence not in known:
        raise NotFoundError("Euler sequence", sequence, known)
    update = {"compare": compare, "euler_sequence": sequence, "returned": returned}
    return asked.model_copy(update=update)


def analysis_words(asked: AnalysisRequest) -> list[str]:
    """The options that say how to analyse, as they are typed."""
    words = [] if asked.filters is None else ["--filters", ",".join(asked.filters)]
    for name, parameters in asked.parameters.items():
        for parameter, value in parameters.items():
            words += ["--set", f"{name}.{parameter}={value!r}"]
    words += [] if asked.calibrations is None else ["--calibration", asked.calibrations]
    words += [word for tuning in asked.tunings for word in ("--tuned", tuning)]
    return words if asked.report else [*words, "--no-report"]


def optional(path: Path | None) -> str | None:
    """A path as requests hold it; None where the option was left away."""
    return None if path is None else str(path)


def exit_code(evaluation: Any) -> int:
    """0 pass or no limits, 1 when a limit was broken or what it limits could not be measured."""
    return int(evaluation.limited and evaluation.outcome in {"fail", "not_measured"})
