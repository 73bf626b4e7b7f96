"""Findings on the times of a recording: units, rates, stamps that are not in order, clocks."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, WARNING, Template

_OWN_ZERO = "the host time of each sensor begins at 0 with its own first sample"
_ONE_BY_ONE = "import them one by one if they must not be compared, or give them Unix times"

TEMPLATES = {
    "time.epoch": Template(
        NOTE,
        "the column {column} states no unit and holds numbers about {about:.4g}",
        "by their size these are Unix times in {unit}",
        "{answer} states another unit",
    ),
    "time.unit_unstated": Template(
        NOTE,
        "the column {column} states no unit and is taken for {unit}",
        "",
        "{answer} states another one",
    ),
    "time.rate_differs": Template(
        WARNING,
        "the time stamps say {measured_hz:.4g} Hz, --rate says {stated_hz:.4g} Hz",
        "--rate is believed",
        "leave --rate out to believe the stamps",
    ),
    "time.header_rate_differs": Template(
        WARNING,
        "the time stamps say {measured_hz:.4g} Hz, the header says {stated_hz:.4g} Hz",
        "the stamps are believed",
        "--rate HZ states the rate, --unit time=UNIT the unit of the stamps",
    ),
    "time.mapping_rate_differs": Template(
        WARNING,
        "the time stamps say {measured_hz:.4g} Hz, rate_hz of the mapping says {stated_hz:.4g} Hz",
        "the stamps are believed",
        "correct rate_hz or time.unit of the mapping, or state the rate with --rate HZ",
    ),
    "time.by_rate": Template(
        NOTE,
        "the times are made by --rate and not by the column {column}",
        "only holes are taken from it",
        "leave --rate out to have the times of the file",
    ),
    "time.holes_by_rate": Template(
        WARNING,
        "the column {column} shows {holes} holes, the longest of {longest} samples",
        "they are kept in the times that --rate makes",
        "leave --rate out to have the times of the file",
    ),
    "time.gaps": Template(
        NOTE,
        "{count} {count:gap|gaps} between samples, {total_s:.2f} s in all, the longest of "
        "{longest_s:.2f} s at {at_s:.2f} s",
        "samples were lost there; what filters do about it depends on how long a gap is",
    ),
    "time.rows_lost": Template(
        WARNING,
        "gyroscope and accelerometer jump at once in {count} {count:place|places}, the first after "
        "{at_s:.2f} s, between readings that go on smoothly on either side",
        "rows are missing there{how_long}, or stand twice, and neither stamps nor a counter tell: "
        "how it turned meanwhile is lost, and all that follows comes at a wrong time",
        "record it with stamps or a counter, or cut the file there",
    ),
    "time.repeated": Template(
        WARNING,
        "{count} {count:row repeats|rows repeat} the stamp and every value of an earlier one, the "
        "first after {at_s:.2f} s",
        "they are left out",
    ),
    "time.grouped": Template(
        WARNING,
        "the samples share their stamps in groups of {group} (up to {most}), {groups} of them",
        "a stamp is taken for that of the last sample of its packet, and the others are spread "
        "evenly over the time since the packet before",
        "--rate HZ spaces all samples by a rate of your own",
    ),
    "time.shared": Template(
        WARNING,
        "{count} {count:sample has|samples have} the stamp of the one before but other values, the "
        "first after {at_s:.2f} s",
        "they are spread evenly up to the next stamp, or from the one before",
    ),
    "time.stale": Template(
        WARNING,
        "the first {count} {count:row has|rows have} stamps over an hour before the others",
        "they are left over from another recording and left out",
    ),
    "time.glitch": Template(
        WARNING,
        "{count} {count:stamp|stamps} in {places} {places:place lies|places lie} out of order by "
        "up to {worst_s:.3g} s, the first after {at_s:.2f} s, and the time then goes on as before",
        "these stamps are taken for faults of the logger and replaced by even ones",
        "if samples are missing there, cut the file",
    ),
    "time.reordered": Template(
        WARNING,
        "{count} {count:row|rows} in {places} {places:place stands|places stand} out of order, the "
        "first after {at_s:.2f} s, and fit in by their stamps",
        "they are put in the order of time",
    ),
    "time.restart": Template(
        WARNING,
        "the time goes back and does not return in {count} {count:place|places}, the first after "
        "{at_s:.2f} s",
        "it is taken to go on there at the rate of --rate",
        "if the recording began again there, cut the file in two",
    ),
    "time.wrapped": Template(
        NOTE,
        "the time began again from 0 {wraps} {wraps:time|times}, where a counter of {bits} bits "
        "does",
        "it is taken to go on",
    ),
    "time.hour": Template(
        WARNING,
        "the local time jumps by {hours:+d} h, to within a sample, after {at_s:.2f} s",
        "that is taken for a change to or from daylight saving time, and the time goes on",
        "if the recording really paused for an hour, cut the file there",
    ),
    "time.by_column": Template(NOTE, "its times are those of the column {column}"),
    "time.by_counter": Template(
        NOTE,
        "its times are made by the counter {column}",
        "at {rate_hz:g} Hz, by {who}",
        "--rate HZ states another rate",
    ),
    "time.by_rows": Template(
        NOTE,
        "the file holds no times",
        "they are made by the rows, at {rate_hz:g} Hz, by {who}; rows that are missing show only "
        "where readings jump",
        "--rate HZ states another rate",
    ),
    "time.of_recorder": Template(
        NOTE,
        "the headers of its messages have no stamps",
        "its times are those at which the messages were recorded",
        "--rate HZ spaces the samples by a rate of your own",
    ),
    "time.spread": Template(
        NOTE,
        "its stamps tell whole {unit} only",
        "the samples are spread evenly over these, at {rate_hz:.6g} Hz, which the stamps tell to "
        "{within_hz:.2g} Hz",
        "--rate HZ states another rate",
    ),
    "time.nominal": Template(
        NOTE,
        "its stamps tell whole {unit} only, and are too few to tell the rate",
        "the samples are spread evenly over these, at the nominal {rate_hz:.6g} Hz",
        "--rate HZ states another rate",
    ),
    "date.unknown": Template(
        NOTE,
        "the date of the recording is unknown",
        "of several stored calibrations none can be chosen as the nearest in time, and one made "
        "from it bears the date of the import",
        "state it with --recorded-at 2021-08-20",
    ),
    "clock.common": Template(
        NOTE,
        "{sensors} sensors share one clock, {clock}",
        "they keep their offsets: the last begins {latest_s:.3f} s after the first, whose first "
        "sample is host time 0",
    ),
    "clock.own": Template(
        WARNING,
        "the times of the files are no Unix times, and tell of no other clock that they share",
        _OWN_ZERO,
        _ONE_BY_ONE,
    ),
    "clock.power_up": Template(
        WARNING,
        "the times of the files count since each device was switched on",
        _OWN_ZERO,
        f"{_ONE_BY_ONE} (Timestamp_Unix of Shimmer)",
    ),
    "clock.seconds": Template(
        WARNING,
        "each device has a clock of its own, which its stamps tell to a second",
        _OWN_ZERO,
        "import them one by one if they must not be compared",
    ),
    "clock.unsynced": Template(
        WARNING,
        "the headers of the files do not say Synced",
        _OWN_ZERO,
        "import them one by one if they must not be compared, or synchronise the sensors in the "
        "app before they record",
    ),
    "clock.stations": Template(
        WARNING,
        "the files are no recordings of one name with one rate, or lack PacketCounter",
        _OWN_ZERO,
        _ONE_BY_ONE,
    ),
    "clock.apart": Template(
        WARNING,
        "by their clock, {clock}, {sensor} begins {apart_s:.0f} s after {ended} has ended",
        "they were not recorded together, and the host time of each sensor begins at 0 with its "
        "own first sample",
    ),
    "clock.truth": Template(
        NOTE,
        "the truth has Unix times like the samples, and begins {offset_s:+.3f} s after them",
        "it keeps that offset",
        "--truth-offset S is added to it",
    ),
    "clock.truth_apart": Template(
        WARNING,
        "the truth has Unix times like the samples, but begins {apart_s:.0f} s {how}",
        "they do not overlap, and the truth is taken to begin with the samples",
        "--truth-offset S shifts it",
    ),
}
