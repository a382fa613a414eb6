"""Read MATLAB files of versions 5 to 7: numbers, text, structs and cells, every length checked.

After the layout in MathWorks, "MAT-File Format" (version 5). This small reader is here because
`scipy.io.loadmat` ends the whole process with a segmentation fault on some damaged files. Values of
other kinds (sparse matrices, objects, function handles) are named, not read.
"""

import math
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

HEADER_BYTES = 128
MAX_INFLATED_BYTES = 1 << 31
MAX_DEPTH = 16
INT32, UINT32, MATRIX, COMPRESSED, INT8 = 5, 6, 14, 15, 1
INTEGERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 12: "i8", 13: "u8"}
NUMBERS = {**INTEGERS, 7: "f4", 9: "f8"}
TEXTS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
NAMES = (1, 2)
CELL, STRUCT, CHAR, FIRST_NUMERIC, LAST_NUMERIC = 1, 2, 4, 6, 15
KINDS = {3: "object", 5: "sparse", 16: "function handle", 17: "object"}
COMPLEX_FLAG = 0x08


class Mat5Error(ValueError):
    """The bytes are no whole MATLAB file of version 5 to 7."""


@dataclass(frozen=True, slots=True)
class Unread:
    """A value of a kind that is not read."""

    kind: str


Value: TypeAlias = "NDArray[np.generic] | str | dict[str, Value] | Unread"


def read_mat5(content: bytes) -> dict[str, Value]:
    """Return the variables of a file, given its bytes, by name.

    Numeric arrays are without their axes of length one, text is a str, scalar structs are
    dictionaries, arrays of structs and cells dictionaries by their number, from "1"; anything else
    is `Unread`.

    Raises:
        Mat5Error: The bytes are damaged or truncated, or of another version.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if len(content) < HEADER_BYTES or order is None:
        raise Mat5Error("no MATLAB 5 header in the first 128 bytes")
    variables: dict[str, Value] = {}
    for outer in _elements(content[HEADER_BYTES:], order):
        packed = outer[0] == COMPRESSED
        for kind, data in _elements(_inflate(outer[1]), order) if packed else [outer]:
            if kind != MATRIX:
                raise Mat5Error(f"an element of type {kind} where a variable was expected")
            name, value = _matrix(data, order, 0)
            if name in variables:
                raise Mat5Error(f"the variable {name!r} is there twice")
            if name:  # one without a name holds MATLAB's own notes about objects
                variables[name] = value
    return variables


Elements = Iterator[tuple[int, bytes]]
"""Type and data of each element."""


def _elements(data: bytes, order: str) -> Elements:
    """Yield the elements of `data`, all of which must be elements."""
    position = 0
    while position < len(data):
        if position + 8 > len(data):
            raise Mat5Error("the file ends inside an element's tag")
        kind, size = struct.unpack_from(order + "II", data, position)
        if kind >> 16:  # a small element: type, size and data in eight bytes
            kind, size = kind & 0xFFFF, kind >> 16
            if size > 4:
                raise Mat5Error(f"a small element of {size} bytes")
            start, end = position + 4, position + 8
        else:
            start = position + 8
            padded = size if kind == COMPRESSED else (size + 7) // 8 * 8
            end = start + padded
        if start + size > len(data):
            raise Mat5Error(f"an element of {size} bytes where {len(data) - start} are left")
        yield kind, data[start : start + size]
        position = end


def _inflate(data: bytes) -> bytes:
    stream = zlib.decompressobj()
    try:
        inflated = stream.decompress(data, MAX_INFLATED_BYTES)
    except zlib.error as error:
        raise Mat5Error(f"a compressed variable is damaged ({error})") from error
    if not stream.eof:
        raise Mat5Error("a compressed variable is truncated or too large")
    return inflated


def _matrix(data: bytes, order: str, depth: int) -> tuple[str, Value]:
    if not data:
        return "", np.empty(0)  # MATLAB writes an empty field so
    if depth > MAX_DEPTH:
        raise Mat5Error(f"structs are nested more than {MAX_DEPTH} deep")
    elements = _elements(data, order)
    flags = _expect(elements, "array flags", lambda kind, size: kind == UINT32 and size == 8)
    word = struct.unpack_from(order + "I", flags[1])[0]
    array_class, is_complex = word & 0xFF, (word >> 8) & COMPLEX_FLAG
    if array_class == 17:  # opaque: laid out in another way from here on
        name = _expect(elements, "name", lambda kind, _: kind in NAMES)[1].decode("latin-1")
        return name, Unread(KINDS[17])
    _, dimensions = _expect(elements, "dimensions", lambda kind, size: kind == INT32 and size >= 8)
    shape = tuple(
        int(n) for n in np.frombuffer(dimensions[: len(dimensions) // 4 * 4], order + "i4")
    )
    if min(shape) < 0:
        raise Mat5Error(f"an array of shape {shape}")
    name = _expect(elements, "name", lambda kind, _: kind in NAMES)[1].decode("latin-1")
    if array_class == CELL:
        return name, _members(elements, map(str, range(1, math.prod(shape) + 1)), order, depth)
    if array_class == STRUCT:
        return name, _struct(elements, shape, order, depth)
    if array_class == CHAR:
        return name, _text(elements, shape, order)
    if FIRST_NUMERIC <= array_class <= LAST_NUMERIC:
        return name, Unread("complex") if is_complex else _numbers(elements, shape, order)
    if array_class in KINDS:
        return name, Unread(KINDS[array_class])
    raise Mat5Error(f"an array of the unknown class {array_class}")


def _expect(elements: Elements, what: str, fits: Callable[[int, int], bool]) -> tuple[int, bytes]:
    element = next(elements, None)
    if element is None or not fits(element[0], len(element[1])):
        raise Mat5Error(f"an array without its {what}")
    return element


def _numbers(elements: Elements, shape: tuple[int, ...], order: str) -> NDArray[np.generic]:
    count = math.prod(shape)
    if count == 0:
        return np.empty(0)
    kind, data = _expect(elements, "numbers", lambda kind, _: kind in NUMBERS)
    dtype = np.dtype(order + NUMBERS[kind])
    if count * dtype.itemsize != len(data):
        raise Mat5Error(f"{len(data)} bytes of numbers for an array of shape {shape}")
    return np.frombuffer(data, dtype).reshape(shape, order="F").squeeze()


def _text(elements: Elements, shape: tuple[int, ...], order: str) -> Value:
    if math.prod(shape) == 0:
        return ""
    if shape[0] != 1:
        return Unread("text of several rows")
    kind, data = _expect(elements, "text", lambda kind, _: kind in TEXTS)
    encoding = TEXTS[kind]
    if encoding in ("utf-16", "utf-32"):
        encoding += "-le" if order == "<" else "-be"
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise Mat5Error(f"text that is not {encoding}") from error


def _struct(elements: Elements, shape: tuple[int, ...], order: str, depth: int) -> Value:
    length_bytes = _expect(elements, "field length", lambda k, size: k == INT32 and size == 4)[1]
    length = struct.unpack(order + "i", length_bytes)[0]
    names = _expect(elements, "field names", lambda kind, _: kind == INT8)[1]
    if length < 1 or len(names) % length:
        raise Mat5Error(f"{len(names)} bytes of field names of {length} each")
    fields = [
        names[start : start + length].split(b"\0", 1)[0].decode("latin-1")
        for start in range(0, len(names), length)
    ]
    structs = [_members(elements, fields, order, depth) for _ in range(math.prod(shape))]
    if len(structs) == 1:
        return structs[0]
    return {str(number): one for number, one in enumerate(structs, 1)}


def _members(elements: Elements, names: Iterable[str], order: str, depth: int) -> dict[str, Value]:
    """Return the next values of a struct or a cell array, by their names."""
    members: dict[str, Value] = {}
    for name in names:
        data = _expect(elements, f"member {name!r}", lambda kind, _: kind == MATRIX)[1]
        members[name] = _matrix(data, order, depth + 1)[1]
    return members
