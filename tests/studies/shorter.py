"""A bench on which studies run shorter copies of the shipped protocols.

What a study does with its runs is the same for a tenth of the poses; how long they take is not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from testbench.pipeline.analyse import Result
from testbench.pipeline.request import Request
from testbench.studies.bench import StudyBench, kept_result


@dataclass(frozen=True)
class ShortBench(StudyBench):
    """A bench with files in place of shipped protocols.

    Attributes:
        shorter: Files by the name of what they stand for.
        reported: Protocols whose first session gets a report.
        made: Sessions that were run before, by protocol, one a part: they are not run again.
    """

    shorter: Mapping[str, Path] = field(default_factory=dict)
    reported: tuple[str, ...] = ()
    made: Mapping[str, Sequence[Path]] = field(default_factory=dict)

    def request(self, protocol: str | Path, seed: int, report: bool = True) -> Request:
        file = self.shorter.get(str(protocol), protocol)
        return super().request(file, seed, report and str(protocol) in self.reported)

    def results(self, protocol: str | Path, filters: Sequence[str] | None = None) -> list[Result]:
        if not self.own and str(protocol) in self.made:
            return [kept_result(path) for path in self.made[str(protocol)]]
        return super().results(protocol, filters)
