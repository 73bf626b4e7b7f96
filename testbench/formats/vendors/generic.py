"""Any table of samples, by a mapping in YAML: CSV, TSV and other text, Parquet, MATLAB, HDF5."""

from __future__ import annotations

from pathlib import Path

from testbench.exceptions import InputError
from testbench.formats.common_clock import share_clock
from testbench.formats.mapped.angles import give_mapped_angles
from testbench.formats.mapped.build import Build
from testbench.formats.mapped.chain import chain_of
from testbench.formats.mapped.files import Files, Meant, Place, fitting, inside, sensors_meant
from testbench.formats.mapped.sensor import Mapped, mapped_sensor
from testbench.formats.mapping import MappingSpec, find_mapping
from testbench.formats.names import sensor_name, stem_without_stamp
from testbench.formats.options import Options
from testbench.formats.recording import Recording
from testbench.formats.suitable import suitable_analysis
from testbench.records.disk.yaml_file import YamlDocument
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.specs.exclusion import unknown_sensors
from testbench.records.specs.protocol import Analysis, Body, Segment
from testbench.records.specs.protocol_chain import ChainEstimation


# Long by the steps from a mapping to its sensors, one after the other.
def read(files: list[Path], options: Options) -> Recording:
    """Read files as a mapping says.

    Args:
        files: Samples; the first may be the mapping itself.
        options: The mapping, and answers it leaves open.

    Raises:
        InputError: No mapping or no files, or a unit or rate is open.
        FileProblems: The mapping or a file is malformed.
    """
    name = options.mapping_name()
    if name is None and files and files[0].suffix.lower() in {".yaml", ".yml"}:
        name, files = str(files[0]), files[1:]
    if name is None:
        raise InputError(
            "the generic format needs a mapping: --mapping map.yaml, or the name of one that ships "
            "with the bench; `testbench import --guess FILE` writes one to begin with"
        )
    if not files:
        raise InputError("no file of samples was given beside the mapping")
    document = find_mapping(name)
    spec = document.value
    files = [own for given in files for own in inside(given)]
    beside = [file for file in files if fitting(spec.beside, [file])]
    encoding = options.encoding_or(None)
    layout = spec.text if encoding is None else spec.text.model_copy(update={"encoding": encoding})
    opened = Files(files, layout)
    meant = sensors_meant(document, files)
    for file in files:  # a file that cannot be read is refused before what the mapping says of it
        if file not in beside:
            opened.table(file)
    opened.used.clear()
    mapped = {
        one.name: mapped_sensor(
            Build(
                Place(document, ("sensors", one.key)), spec.sensors[one.key], one, opened, options
            )
        )
        for one in meant
    }
    if spec.hemisphere is not None:
        for one in mapped.values():
            one.sensor.details["hemisphere"] = spec.hemisphere
    left = sorted(file.name for file in beside if file not in opened.used)
    angles = spec.truth_angles
    of_truth = [] if angles is None else [file for file in files if file.name == angles.file]
    unused = [file.name for file in files if file not in [*opened.used, *beside, *of_truth]]
    if unused:
        raise InputError(f"{', '.join(sorted(unused))}: no sensor of the mapping reads it")
    chain, kept = chain_of(document, list(mapped))
    analysis = _analysis(document, meant, mapped, chain)
    findings = [
        finding("structure.mapping", file=document.file.name, description=spec.description),
        *([finding("structure.files_unread", files=left)] if left else []),
        *_closed(opened),
        *_shared(mapped),
    ]
    if len({file for one in mapped.values() for file, _ in one.read}) > 1:
        sensors = {name: one.sensor for name, one in mapped.items()}
        findings += share_clock(sensors)
    recording = Recording(
        sensor_name(stem_without_stamp(files[0].stem)),
        spec.description,
        {name: one.sensor for name, one in mapped.items()},
        analysis,
        findings=findings,
        texts=kept,
    )
    give_mapped_angles(recording, document, opened)
    return recording


def _analysis(
    document: YamlDocument[MappingSpec],
    meant: list[Meant],
    mapped: dict[str, Mapped],
    chain: ChainEstimation | None,
) -> Analysis:
    """What suits the sensors, and what the mapping says of estimate, body and intervals."""
    spec = document.value
    heads = [one.sensor.head() for one in mapped.values()]
    truths = [spec.sensors[one.key].truth for one in meant]
    elsewhere = any(t is not None and t.file is not None and not t.same_clock for t in truths)
    analysis = suitable_analysis(
        [head for head in heads if head is not None],
        own_clock=elsewhere,
        truth=any(truth is not None for truth in truths),
    )
    estimate = spec.estimate or analysis.estimate
    _check_names(document, list(mapped))
    estimate = estimate.model_copy(
        update={"exclude": [*estimate.exclude, *spec.exclude], "chain": chain}
    )
    body = None
    if spec.segments or spec.joints:
        segments = {
            name: segment if isinstance(segment, Segment) else Segment(name=segment)
            for name, segment in spec.segments.items()
        }
        body = Body(segments=segments, joints=spec.joints, alignment=spec.alignment)
    return analysis.model_copy(update={"estimate": estimate, "body": body})


def _check_names(document: YamlDocument[MappingSpec], sensors: list[str]) -> None:
    """Refuse parts of a mapping that speak of sensors that there are not."""
    spec, spoken = document.value, list[tuple[str, tuple[str | int, ...]]]()
    spoken += [(name, ("segments", name)) for name in spec.segments]
    spoken += [(name, ("alignment", "forward", name)) for name in spec.alignment.forward]
    for name, joint in spec.joints.items():
        spoken.append((joint.proximal, ("joints", name, "proximal")))
        spoken.append((joint.distal, ("joints", name, "distal")))
    for i, exclusion in enumerate(spec.exclude):
        unknown = unknown_sensors([exclusion], sensors)
        spoken += [(sensor, ("exclude", i, "sensors")) for sensor in unknown]
    for sensor, place in spoken:
        if sensor not in sensors:
            told = f"there is no sensor '{sensor}'; the sensors are {', '.join(sensors)}"
            raise document.problem(told, *place)


def _closed(files: Files) -> list[Finding]:
    """What only MATLAB opens in the files."""
    found = []
    for file in sorted(files.used):
        closed = getattr(files.table(file), "closed", ())
        if closed:
            found.append(finding("structure.closed", file=file.name, objects=list(closed)))
    return found


def _shared(mapped: dict[str, Mapped]) -> list[Finding]:
    """Columns that more than one sensor reads."""
    found, names = [], list(mapped)
    for i, first in enumerate(names):
        for second in names[i + 1 :]:
            both = sorted(mapped[first].read & mapped[second].read)
            if both:
                columns, file = [title for _, title in both], both[0][0].name
                found.append(
                    finding(
                        "structure.shared_columns",
                        first=first,
                        second=second,
                        columns=columns,
                        file=file,
                    )
                )
    return found
