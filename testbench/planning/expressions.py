"""Arithmetic on a protocol's variables: + - * / ( ), a handful of functions, and nothing else. Never `eval`."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping

from testbench.exceptions import ExpressionError

LONGEST = 200
DEEPEST = 20

FUNCTIONS: dict[str, Callable[..., float]] = {"abs": abs, "min": min, "max": max, "sqrt": math.sqrt, "round": round}
CONSTANTS = {"pi": math.pi}
_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_UNARY: dict[type[ast.unaryop], Callable[[float], float]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}


def evaluate_expression(expression: float | str, variables: Mapping[str, float]) -> float:
    """The value of a number or of an expression such as "180 + misalignment_deg".

    Args:
        expression: A number, or arithmetic with + - * / and parentheses on numbers, variables, pi, abs, min, max, round, sqrt.
        variables: The names that may be used, and their values.

    Raises:
        ExpressionError: It cannot be read, names an unknown variable, or has no finite value.
    """
    if isinstance(expression, int | float):
        return float(expression)
    if len(expression) > LONGEST:
        raise ExpressionError(f"an expression of {len(expression)} characters is longer than the {LONGEST} allowed")
    try:
        tree = ast.parse(expression.strip(), mode="eval")
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise ExpressionError(f"'{expression}' is not arithmetic (numbers, variables, + - * / and parentheses)") from None
    try:
        value = float(_value(tree.body, variables, expression, 0))
    except (ZeroDivisionError, OverflowError, ValueError, TypeError) as error:
        raise ExpressionError(f"'{expression}' has no value: {error}") from None
    if not math.isfinite(value):
        raise ExpressionError(f"'{expression}' is not a finite number")
    return value


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
            known = ", ".join([*variables, *CONSTANTS]) or "none"
            raise ExpressionError(f"unknown variable '{name}' in '{expression}'; known: {known}")
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            return _BINARY[type(op)](
                _value(left, variables, expression, depth + 1), _value(right, variables, expression, depth + 1)
            )
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
            return _UNARY[type(op)](_value(operand, variables, expression, depth + 1))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            return FUNCTIONS[name](*[_value(argument, variables, expression, depth + 1) for argument in arguments])
    raise ExpressionError(f"'{expression}' uses more than arithmetic; allowed: + - * / ( ) and {', '.join(FUNCTIONS)}")
