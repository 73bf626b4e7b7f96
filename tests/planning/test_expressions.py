"""Expressions: the same arithmetic as Python's, and nothing but arithmetic."""

import keyword
import math
import time
import warnings

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbench.exceptions import ExpressionError
from testbench.planning.expressions import (
    CONSTANTS,
    FUNCTIONS,
    LONGEST,
    UnknownVariable,
    evaluate_expression,
)
from testbench.records.specs.protocol import RESERVED_NAMES

VARIABLES = {"flexion_deg": 35.0, "misalignment_deg": -20.0, "x": 0.125, "half": 0.5}

numbers = st.one_of(
    st.integers(0, 1000).map(str),
    st.floats(0, 1000, allow_nan=False).map(lambda value: f"{value:.4g}"),
    st.just("1e-3"),
)
operands = st.one_of(numbers, st.sampled_from([*VARIABLES, *CONSTANTS]))
spaces = st.sampled_from(["", " "])


def compound(inner):
    return st.one_of(
        st.tuples(inner, spaces, st.sampled_from("+-*/"), spaces, inner).map("".join),
        inner.map("({})".format),
        inner.map("-{}".format),
        st.tuples(st.sampled_from(["abs", "round"]), inner).map(
            lambda parts: f"{parts[0]}({parts[1]})"
        ),
        inner.map("sqrt(abs({}))".format),
        st.tuples(st.sampled_from(["min", "max"]), inner, inner).map(
            lambda parts: f"{parts[0]}({parts[1]}, {parts[2]})"
        ),
    )


expressions = st.recursive(operands, compound, max_leaves=8).filter(
    lambda text: len(text) <= LONGEST
)


@settings(deadline=None, max_examples=300)
@given(expressions)
def test_the_value_is_the_one_python_computes(text):
    names = {
        **VARIABLES,
        **CONSTANTS,
        "sqrt": math.sqrt,
        "abs": abs,
        "round": round,
        "min": min,
        "max": max,
    }
    try:
        expected = float(eval(text, {"__builtins__": {}}, names))
    except (ZeroDivisionError, OverflowError, ValueError):
        expected = math.nan
    if math.isfinite(expected):
        assert evaluate_expression(text, VARIABLES) == pytest.approx(expected, rel=1e-12, abs=1e-12)
    else:
        with pytest.raises(ExpressionError):
            evaluate_expression(text, VARIABLES)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("180 + misalignment_deg", 160),
        ("90 - misalignment_deg", 110),
        ("2 * flexion_deg / 7", 10),
        ("-flexion_deg", -35),
        ("- -3", 3),
        (" 1 + 2 ", 3),
        ("1e-3", 0.001),
        ("pi / pi", 1),
        ("round(2.6)", 3),
        ("max(1, 2, 3)", 3),
        ("1 - 2 - 3", -4),
        ("8 / 4 / 2", 1),
        ("+".join(["1"] * 100), 100),
        (12, 12),
        (-0.5, -0.5),
    ],
)
def test_arithmetic_gives_the_expected_number(text, value):
    found = evaluate_expression(text, VARIABLES)
    assert found == value
    assert type(found) is float


REFUSED = {
    "an attribute": "x.real",
    "an attribute of a number": "(1).__class__",
    "an import": "__import__('os')",
    "a call by way of an attribute": "().__class__.__bases__",
    "another function": "open(1)",
    "eval": "eval(x)",
    "a function of a function": "min(max)(1)",
    "a named argument": "max(1, 2, key=abs)",
    "a starred argument": "max(*x)",
    "a comprehension": "[x for x in x]",
    "a generator": "min(x for x in x)",
    "a lambda": "lambda: 1",
    "an assignment": "(y := 3)",
    "a statement": "x = 1",
    "two statements": "1; 2",
    "a power": "9**9**9",
    "a whole division": "7 // 2",
    "a remainder": "7 % 2",
    "a shift": "1 << 100",
    "a bit": "1 | 2",
    "a complement": "~1",
    "a comparison": "1 < 2",
    "a condition": "1 if x else 2",
    "a logical word": "x and 1",
    "a negation": "not x",
    "a text": "'a'",
    "a formatted text": "f'{x}'",
    "bytes": "b'a'",
    "an index": "x[0]",
    "a tuple": "1, 2",
    "a list": "[1]",
    "a mapping": "{1: 2}",
    "a set": "{1}",
    "a truth value": "True",
    "none": "None",
    "an ellipsis": "...",
    "an imaginary number": "1j",
    "await": "await x",
    "yield": "(yield)",
    "a comment": "1 # 2",
    "a line end": "1 +\n2",
    "a continuation": "1 + \\\n2",
    "a zero byte": "1\x00",
    "a full-width digit": "\uff11",
    "a letter that looks like another": "\u0445",
    "nothing": "",
    "blanks": "   ",
    "an open bracket": "(1",
    "a closed bracket": "1)",
    "an operator alone": "+",
    "a missing operator": "1 2",
    "a number that runs into a word": "1if x else 2",
    "an unknown variable": "y",
    "a function that is not called": "sqrt",
    "too few values": "min(1)",
    "no value": "abs()",
    "too many values": "sqrt(1, 2)",
    "a rounding to digits": "round(1.5, 1)",
    "a division by zero": "1 / (x - x)",
    "a root of less than nothing": "sqrt(-1)",
    "infinity": "1e999",
    "infinity by multiplication": "1e300 * 1e300",
    "infinity minus infinity": "1e999 - 1e999",
    "infinity rounded": "round(1e999)",
    "deep brackets": "(" * 99 + "1" + ")" * 99 + "!",
    "many signs": "-" * 150 + "1",
    "nested calls": "abs(" * 40 + "1" + ")" * 39,
    "a long text": "1" + " + 1" * 100,
    "a very long text": "1" * 1_000_000,
    "very deep brackets": "(" * 100_000,
}


@pytest.mark.parametrize("text", REFUSED.values(), ids=REFUSED.keys())
def test_whatever_is_not_arithmetic_is_refused_at_once(text):
    start = time.process_time()
    with pytest.raises(ExpressionError) as caught:
        evaluate_expression(text, VARIABLES)
    assert time.process_time() - start < 0.2
    assert str(caught.value)


def test_nothing_is_ever_executed(monkeypatch):
    ran = []
    monkeypatch.setitem(VARIABLES, "trap", 1.0)
    monkeypatch.setattr("builtins.open", lambda *_: ran.append("open"))
    for text in (
        "open(1)",
        "open('x')",
        "min(open(1), 2)",
        "trap.bit_length()",
        "exec('ran')",
        "print(1)",
    ):
        with pytest.raises(ExpressionError):
            evaluate_expression(text, VARIABLES)
    assert ran == []


@settings(deadline=None, max_examples=500)
@given(
    st.one_of(st.text(max_size=40), st.text(alphabet="0123456789.eE+-*/(), xjlifn_", max_size=40))
)
def test_any_text_has_a_finite_value_or_is_refused_without_a_warning(text):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            assert math.isfinite(evaluate_expression(text, VARIABLES))
        except ExpressionError as error:
            assert str(error)  # noqa: PT017 - whether it is refused depends on the text


def test_a_number_that_is_not_finite_is_refused():
    for number in (math.inf, -math.inf, math.nan):
        with pytest.raises(ExpressionError, match="not a finite number"):
            evaluate_expression(number, {})


def test_an_unknown_variable_is_named_with_those_that_exist():
    with pytest.raises(UnknownVariable) as caught:
        evaluate_expression("90 - flex", {"flexion_deg": 1.0})
    assert caught.value.name == "flex"
    assert str(caught.value) == "unknown variable 'flex' in '90 - flex'; known: flexion_deg, pi"


def test_the_words_of_the_language_are_those_no_variable_may_be_called():
    assert set(RESERVED_NAMES) == {*FUNCTIONS, *CONSTANTS}
    assert not any(keyword.iskeyword(name) for name in RESERVED_NAMES)


def test_the_same_expression_follows_its_variables():
    assert [evaluate_expression("2 * x", {"x": float(x)}) for x in range(4)] == [0, 2, 4, 6]
