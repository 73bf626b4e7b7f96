"""A summary as JUnit XML, the elements and attributes that build servers read.

The schema is that of Jenkins' xUnit plugin (junit-10.xsd), of which GitLab, GitHub actions and
others read a part.
"""

from __future__ import annotations

import re
from xml.etree import ElementTree

from testbench.reporting.summaries.summary import Summary

NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that no XML may hold (XML 1.0, section 2.2)."""


def junit_text(summary: Summary) -> str:
    """A summary as JUnit XML; what failed is a failure, never an error.

    Args:
        summary: What was found.
    """
    counts = {
        "tests": str(len(summary.cases)),
        "failures": str(sum(case.outcome == "failed" for case in summary.cases)),
        "errors": "0",
        "time": f"{summary.seconds:.3f}",
    }
    suites = ElementTree.Element("testsuites", {"name": "testbench"} | counts)
    skipped = str(sum(case.outcome == "skipped" for case in summary.cases))
    named = {"name": _text(summary.title)} | counts | {"skipped": skipped}
    if summary.started:
        named["timestamp"] = summary.started[:19]  # xs:dateTime, without a zone
    suite = ElementTree.SubElement(suites, "testsuite", named)
    properties = ElementTree.SubElement(suite, "properties")
    for name, value in summary.facts.items():
        ElementTree.SubElement(properties, "property", {"name": _text(name), "value": _text(value)})
    for case in summary.cases:
        place = {"classname": _text(summary.title), "name": _text(case.name), "time": "0.000"}
        element = ElementTree.SubElement(suite, "testcase", place)
        message = {"message": _text(case.message)}
        if case.outcome == "failed":
            failure = ElementTree.SubElement(element, "failure", message | {"type": "limit"})
            failure.text = _text(case.message)
        elif case.outcome == "skipped":
            ElementTree.SubElement(element, "skipped", message)
        else:
            ElementTree.SubElement(element, "system-out").text = _text(case.message)
    out = ElementTree.SubElement(suite, "system-out")
    out.text = _text("\n".join(summary.sentences))
    ElementTree.indent(suites)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(suites, "unicode") + "\n"
    )


def _text(words: str) -> str:
    return NO_XML.sub("?", words)
