"""Studies: questions asked of whole runs, whose tables stand beside published ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from testbench.exceptions import InputError, NotFoundError

if TYPE_CHECKING:
    from testbench.pipeline.request import StudyRequest
    from testbench.records.results.study import StudyRecord
    from testbench.studies.bench import StudyBench


@dataclass(frozen=True)
class KeptStudy:
    """What a study found, and where that is kept.

    Attributes:
        record: What it found.
        folder: Of the record.
        report: The page.
    """

    record: StudyRecord
    folder: Path
    report: Path


@dataclass(frozen=True)
class Study:
    """A study that can be asked for by name.

    Each takes a protocol or a recording of the user's in place of its own data.

    Attributes:
        module: Has the function `run`.
        options: What may be set of it, by name, with what it means.
    """

    name: str
    description: str
    module: str
    options: Mapping[str, str] = field(default_factory=dict)

    def run(self, bench: StudyBench) -> StudyRecord:
        """Run it; its module is loaded now.

        Of data of the user's there is no published column, for the publication says nothing of
        them.

        Raises:
            InputError: The bench has both a protocol and a session of the user's.
            NotFoundError: The study has no such option; lists those that it has.
        """
        self._refuse(bench)
        function: Callable[[StudyBench], StudyRecord] = import_module(self.module).run
        record = replace(function(bench), name=self.name)
        if bench.session is not None:
            from testbench.records.session.session import Session

            record = replace(record, simulated=bool(Session(bench.session).simulated))
        return record.without_published() if bench.own else record

    def _refuse(self, bench: StudyBench) -> None:
        for option in bench.options:
            if option not in self.options:
                raise NotFoundError(f"option of {self.name}", option, list(self.options))
        if bench.protocol is not None and bench.session is not None:
            raise InputError("--protocol runs something, --session runs nothing: name one of them")

    def keep(self, bench: StudyBench) -> KeptStudy:
        """Run it, and keep its record and its report in a folder beside the sessions.

        Raises:
            InputError: As for `run`, or the folder cannot be made.
        """
        from testbench.reporting.study_report import study_report
        from testbench.studies.folder import new_folder

        record = self.run(bench)
        folder = new_folder(bench.logs, self.name, bench.clock)
        record.save(folder)
        return KeptStudy(record, folder, study_report(record, folder))


_OF_TURNS = {
    "every": "only one sample of so many is taken while the sensor turns",
    "stages": "where integrators get the rates inside a step: measured, interpolated or constant",
}
STUDIES = {
    study.name: study
    for study in (
        Study(
            "gimvebo",
            "Integrators in the calibration of a gyroscope on a gimbal, beside tables 4.1 to 4.7 "
            "of Botina & Vergara 2018",
            "testbench.studies.gimvebo.study",
            _OF_TURNS,
        ),
        Study(
            "beta_zeta",
            "The two gains of Madgwick's filter on a leg, beside the sweeps of de Miguel Pueyo "
            "2024, and what a true bias state gains",
            "testbench.studies.beta_zeta.study",
        ),
        Study(
            "misalignment",
            "Misaligned segments: theory, its fits, every sequence, and a session beside them",
            "testbench.studies.elbow.misalignment",
        ),
        Study(
            "reference-1",
            "Joint angles of an elbow played by a UR3e, beside section 4 and tables 5.1 to 5.10 of "
            "Castellanos Alonso 2023",
            "testbench.studies.elbow.study",
        ),
        Study(
            "reference-2",
            "The study beta_zeta under the name of its publication, de Miguel Pueyo 2024",
            "testbench.studies.beta_zeta.study",
        ),
        Study(
            "reference-3",
            "The study gimvebo under the name of its publication, Botina & Vergara 2018",
            "testbench.studies.gimvebo.study",
            _OF_TURNS,
        ),
        Study(
            "reference-4",
            "Gait cycles, path and yaw drift of a walker, beside Cabezuelo Gutiérrez 2019",
            "testbench.studies.pedestrian.study",
        ),
        Study(
            "reference-5",
            "The Kalman filter of a kinematic chain, beside tables 4.1 to 4.4 of Quijano & "
            "Valencia 2018",
            "testbench.studies.chain.study",
        ),
    )
}
"""Every study by its name."""


def get_study(name: str) -> Study:
    """A study by its name.

    Raises:
        NotFoundError: No such study; lists those that exist.
    """
    if name not in STUDIES:
        raise NotFoundError("study", name, list(STUDIES))
    return STUDIES[name]


def wanted_studies(asked: StudyRequest) -> list[Study]:
    """The studies that a request asks for, in the order in which they are run.

    Raises:
        NotFoundError: No such study; lists those that exist.
        InputError: Those of the publications run their own protocols, and other data are named.
    """
    if asked.name is not None:
        return [get_study(asked.name)]
    if asked.protocol is not None or asked.session is not None:
        raise InputError(
            "--reproduce runs the protocols of the publications and takes neither --protocol nor "
            "--session"
        )
    return references()


def references() -> list[Study]:
    """The studies that stand for one publication each, in order."""
    return [study for name, study in sorted(STUDIES.items()) if name.startswith("reference-")]
