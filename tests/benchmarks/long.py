"""Everything that is asked by the hundred, one campaign after the other: `make long`. Stopped, it
goes on where it was; docs/validation.md holds what it printed.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

from tests.benchmarks.arm_times import bench_arm_times
from tests.benchmarks.comparisons import bench_comparisons
from tests.benchmarks.coverage import bench_coverage
from tests.benchmarks.crash_points import bench_crash_points
from tests.benchmarks.crashes import bench_crashes
from tests.benchmarks.damaged_sessions import bench_damaged_sessions
from tests.benchmarks.documents import bench_documents
from tests.benchmarks.faults import bench_faults
from tests.benchmarks.full_disks import bench_full_disks
from tests.benchmarks.intervals import bench_intervals
from tests.benchmarks.joints_of_people import bench_joints
from tests.benchmarks.lack_of_fit import bench_lack_of_fit
from tests.benchmarks.lasting_errors import bench_lasting_errors
from tests.benchmarks.looks import bench_looks
from tests.benchmarks.mutated_imports import bench_mutated_imports
from tests.benchmarks.mutations import bench_mutations
from tests.benchmarks.networks import bench_networks
from tests.benchmarks.placements import bench_placements
from tests.benchmarks.same_part import bench_same_part

CAMPAIGNS: list[Callable[[], bool]] = [
    bench_arm_times,
    bench_intervals,
    bench_comparisons,
    bench_coverage,
    bench_crashes,
    bench_crash_points,
    bench_full_disks,
    bench_damaged_sessions,
    bench_documents,
    bench_faults,
    bench_joints,
    bench_lack_of_fit,
    bench_lasting_errors,
    bench_looks,
    bench_mutations,
    bench_mutated_imports,
    bench_networks,
    bench_placements,
    bench_same_part,
]


def main() -> bool:
    """Run all; whether every figure is as it should be."""
    passed = [campaign() for campaign in CAMPAIGNS]
    return all(passed)


if __name__ == "__main__":
    sys.exit(not main())
