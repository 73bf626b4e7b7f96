"""The truth of a sensor as a mapping states it: in the rows of its samples, or elsewhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from testbench.formats.any_table import Table
from testbench.formats.axes import AxisMap
from testbench.formats.mapped.axes import enu_orientations
from testbench.formats.mapped.build import Build
from testbench.formats.mapped.columns import columns_of, titles_of
from testbench.formats.mapped.files import Place
from testbench.formats.mapped.times import stamps_of
from testbench.formats.mapped.together import Together
from testbench.formats.mapping import TruthColumns
from testbench.formats.stamps import LOWEST_OF_TRUTH_HZ, Asking
from testbench.formats.tables.samples_stream import Quantities, SampleStream
from testbench.formats.tables.source import Columns, Kind
from testbench.formats.truth.reference import collect, reference_truth
from testbench.model.kinematics import Pose
from testbench.records.session.samples import Truth


def _truth_titles(place: Place, spec: TruthColumns, table: Table) -> list[str]:
    """The columns of a truth as w, x, y, z."""
    titles = titles_of(place, table, spec.columns, spec.array)
    return titles if spec.order == "wxyz" else [titles[3], *titles[:3]]


def truth_in_rows(build: Build, main: Table) -> list[str]:
    """The columns of a truth that stands in the rows of the samples, as w, x, y, z.

    Args:
        build: The sensor.
        main: Table of its samples.
    """
    spec = build.spec.truth
    if spec is None or spec.file is not None:
        return []
    return _truth_titles(build.place.inside("truth"), spec, main)


def mapped_truth(
    build: Build, together: Together, stream: SampleStream, axes: AxisMap, in_rows: list[str]
) -> Truth:
    """The truth of a sensor.

    Args:
        build: The sensor, with a truth in its mapping.
        together: Its rows.
        stream: Its samples.
        axes: Of the sensor.
        in_rows: Columns of the truth, where it stands in these rows.

    Raises:
        InputError: The unit of its times cannot be right.
        FileProblems: Its file does not fit the mapping, or is malformed.
    """
    spec, place = build.spec.truth, build.place.inside("truth")
    assert spec is not None
    table, stamps, origin = together.main, together.stamps, stream.origin_ns
    titles = in_rows
    like: SampleStream | None = stream if together.source is table else None
    if spec.file is not None:
        file = together.main.file.parent / Path(spec.file).name
        given = [own for own in build.files.given if own.name == file.name]
        table = build.files.table(given[0] if given else file, spec.text)
        key = "truth.time.unit: UNIT in the mapping"
        asking = Asking(f"{table.file}", flag=key, lowest_hz=LOWEST_OF_TRUTH_HZ)
        stamps = stamps_of(place, table, spec.time, spec.rate_hz, None, asking)
        like = None
        settings = place.document.value.estimate
        # who wants no clock fitted says that the times are on one clock
        same_clock = spec.same_clock or (settings is not None and not settings.align_clock)
        origin = stream.first_time_ns() if same_clock else None
        titles = _truth_titles(place, spec, table)
    else:
        build.notice("structure.truth_in_rows")
    judged = [] if spec.judged is None else [spec.judged]
    marks = columns_of(place.inside("judged"), table, judged) if judged else []

    def convert(columns: Columns) -> Quantities:
        q = enu_orientations(columns, titles, spec)
        return Quantities(
            None, None, None, q, np.nan_to_num(columns[marks[0]]) != 0 if marks else None
        )

    kinds: dict[str, Kind] = dict.fromkeys([*titles, *marks], "float")
    own = SampleStream(table, kinds, convert, stamps.timeline, origin_ns=origin)
    chunks = list(own.with_rows_of(like))
    time, q = collect(chunks)
    counted = np.concatenate([chunk.saturated for chunk in chunks]) if marks else None
    # without a mounting, the body is the sensor with the axes of the file
    mounting = (
        Pose.from_placement(spec.mounting).quaternion
        if spec.mounting.rotation_deg
        else axes.q_file_from_sensor
    )
    return reference_truth(build.name, time, q, mounting, counted, build.findings)
