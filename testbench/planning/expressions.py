"""Arithmetic on a protocol's variables: + - * / ( ) and a few functions; never `eval`."""

from __future__ import annotations

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable, Mapping
from functools import lru_cache

from testbench.exceptions import ExpressionError

LONGEST = 200
DEEPEST = 100

FUNCTIONS: dict[str, Callable[..., float]] = {
    "abs": abs,
    "min": min,
    "max": max,
    "round": round,
    "sqrt": math.sqrt,
}
CONSTANTS = {"pi": math.pi}
_MANY = {"min", "max"}  # the others take one argument
_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_UNARY: dict[type[ast.unaryop], Callable[[float], float]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
_ALLOWED = re.compile(r"[A-Za-z0-9_+\-*/(),. ]+")


class UnknownVariable(ExpressionError):
    """An expression uses a name that stands for nothing.

    Attributes:
        name: The name.
    """

    def __init__(self, name: str, expression: str, known: list[str]):
        self.name = name
        super().__init__(f"unknown variable '{name}' in '{expression}'; known: {', '.join(known)}")


def evaluate_expression(expression: float | str, variables: Mapping[str, float]) -> float:
    """The value of a number or of an expression such as "180 + misalignment_deg".

    Args:
        expression: A number, or arithmetic with + - * / and parentheses on numbers, variables, pi,
            abs, min, max, round, sqrt.
        variables: The names that may be used, and their values.

    Raises:
        ExpressionError: It cannot be read, names an unknown variable, or has no finite value.
    """
    if isinstance(expression, str):
        tree = _parse(expression)
        try:
            value = float(_value(tree, variables, expression, 0))
        except (ZeroDivisionError, OverflowError, ValueError) as error:
            reason = str(error).removeprefix("float ")
            raise ExpressionError(f"'{expression}' has no value: {reason}") from None
    else:
        value = float(expression)
    if not math.isfinite(value):
        raise ExpressionError(f"'{expression}' is not a finite number")
    return value


@lru_cache(maxsize=1024)
def _parse(expression: str) -> ast.expr:
    """The syntax tree of an expression, which may still hold more than arithmetic.

    Text with a character that arithmetic does not need (quotes, brackets, =, :, @, line ends) never
    reaches the parser.
    """
    if len(expression) > LONGEST:
        raise ExpressionError(
            f"an expression of {len(expression)} characters is longer than the {LONGEST} allowed"
        )
    try:
        if not _ALLOWED.fullmatch(expression):
            raise SyntaxError
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # such as for "2if", which is no arithmetic either
            return ast.parse(expression.strip(), mode="eval").body
    except (SyntaxError, Warning, ValueError, MemoryError, RecursionError):
        raise ExpressionError(
            f"'{expression}' is not arithmetic; allowed: numbers, variables, + - * / ( ) and "
            f"{', '.join(FUNCTIONS)}"
        ) from None


def _value(node: ast.expr, variables: Mapping[str, float], expression: str, depth: int) -> float:
    if depth > DEEPEST:
        raise ExpressionError(f"'{expression}' nests deeper than {DEEPEST} levels")
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return float(number)
        case ast.Name(id=name):
            if name in variables:
                return variables[name]
            if name in CONSTANTS:
                return CONSTANTS[name]
            raise UnknownVariable(name, expression, [*variables, *CONSTANTS])
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            return _BINARY[type(op)](
                _value(left, variables, expression, depth + 1),
                _value(right, variables, expression, depth + 1),
            )
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
            return _UNARY[type(op)](_value(operand, variables, expression, depth + 1))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            many = name in _MANY
            if len(arguments) < 2 if many else len(arguments) != 1:
                raise ExpressionError(
                    f"'{expression}': {name} takes {'two or more values' if many else 'one value'}"
                )
            return FUNCTIONS[name](
                *[_value(argument, variables, expression, depth + 1) for argument in arguments]
            )
    raise ExpressionError(
        f"'{expression}' uses more than arithmetic; allowed: + - * / ( ) and {', '.join(FUNCTIONS)}"
    )
