"""Formulas over channels and conditions: arithmetic, comparisons and a few functions.

A formula is parsed as an expression and walked; nothing else than what is listed here is evaluated.
"""

import ast
import operator
from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

import numpy as np

FUNCTIONS: dict[str, Callable[..., Any]] = {
    name: getattr(np, name)
    for name in (
        *("sin", "cos", "tan", "sqrt", "exp", "log"),
        *("abs", "sign", "clip", "minimum", "maximum", "where"),
    )
}
CONSTANTS = {"pi": np.pi, "g_m_s2": 9.80665}
OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.And: np.logical_and,
    ast.Or: np.logical_or,
    ast.Not: np.logical_not,
}


class FormulaError(ValueError):
    """A formula cannot be read or evaluated."""


def names_in(text: str) -> list[str]:
    """Return the names that a formula reads, in order; FormulaError where it is none."""
    tree = _parsed(text)
    called = {n.func for n in ast.walk(tree) if isinstance(n, ast.Call)}
    found = [n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and n not in called]
    return [name for name in dict.fromkeys(found) if name not in CONSTANTS]


def evaluate(text: str, values: Mapping[str, Any]) -> Any:
    """Evaluate a formula, such as `clip(gain_ratio * (target_rad - motor_rad), -1, 1)`.

    `values` holds an array or a number by name; the result is an array or a number.

    Raises:
        FormulaError: The formula cannot be read, or reads a name that is not there.
    """
    try:
        return _value(_parsed(text), CONSTANTS | dict(values))
    except (ArithmeticError, TypeError) as error:
        raise FormulaError(f"{text!r} cannot be worked out: {error}") from error


def _parsed(text: str) -> ast.expr:
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise FormulaError(f"{text!r} is not a formula") from error


def _value(node: ast.expr, values: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id=name):
            if name not in values:
                raise FormulaError(f"no channel or condition is called {name!r}")
            return values[name]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            return OPERATORS[type(op)](_value(left, values), _value(right, values))
        case ast.UnaryOp(op=op, operand=operand) if type(op) in OPERATORS:
            return OPERATORS[type(op)](_value(operand, values))
        case ast.BoolOp(op=op, values=parts):
            return reduce(OPERATORS[type(op)], [_value(part, values) for part in parts])
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in OPERATORS:
            return OPERATORS[type(op)](_value(left, values), _value(right, values))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            try:
                return FUNCTIONS[name](*(_value(one, values) for one in arguments))
            except TypeError as error:
                raise FormulaError(f"{name}() has the wrong number of arguments") from error
    raise FormulaError(
        f"{ast.unparse(node)!r} is not part of a formula; it may use + - * / **, comparisons,"
        f" and, or, not, {', '.join(FUNCTIONS)}"
    )
