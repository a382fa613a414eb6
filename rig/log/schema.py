"""Layout of one stream of a log: fields of fixed size, as ROS 2 text and as a NumPy dtype.

A message whose fields all have a fixed size is, in ROS 2's CDR encoding, a header of four bytes and
then the fields one after the other. With the fields ordered large to small no padding is needed
between them, so a block of messages is a block of memory that NumPy reads without a loop.

Sources: OMG DDS-XTypes 1.3, 7.4.1 (plain CDR); ROS 2 design article "Interface definition".
"""

import json
import re
import zlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rig.errors import UsageError

NUMPY_TYPES: dict[str, str] = {
    name: np.dtype(name).newbyteorder("<").str
    for name in (
        *("float64", "int64", "uint64", "float32", "int32", "uint32"),
        *("int16", "uint16", "int8", "uint8"),
    )
}
"""NumPy type of each ROS 2 type a field may have."""

CDR_HEADER = int.from_bytes(b"\x00\x01\x00\x00", "little")
"""Encapsulation header of little-endian plain CDR, read as a little-endian uint32."""

MESSAGE_OPCODE = 5
"""MCAP opcode of a message record."""

MESSAGE_HEAD_BYTES = 2 + 4 + 8 + 8
"""Bytes of an MCAP message record before its data: channel, sequence, log time, publish time."""

CHECKSUM_KEY = "crc32"
"""Where the checksum of a channel, and of a metadata record of ours, stands in its metadata."""

_NAME = re.compile(r"[a-z](_?[a-z0-9])*")
_TYPE = re.compile(r"[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*")
_LINE = re.compile(r"(?P<type>\w+)\s+(?P<name>\w+)\s*(#\s*\[(?P<unit>[^\]]*)\]\s*(?P<text>.*))?")


class LayoutError(UsageError):
    """The fields do not make a fixed-size message without padding."""


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message."""

    name: str  # name, ending in its unit where it has one: lower case letters, digits, single `_`
    dtype: str  # ROS 2 type, a key of `NUMPY_TYPES`
    unit: str = ""  # SI unit symbol; "1" for a ratio, "" for counts and identifiers
    description: str = ""


@dataclass(frozen=True)
class Stream:
    """One stream of messages of a log, such as `rig_msgs/msg/Sample` at `/rig/sample`.

    Raises:
        LayoutError: A type is not of fixed size, the order would need padding, or a name or unit
            cannot be written in a ROS 2 definition.
    """

    topic: str
    message_type: str
    fields: tuple[Field, ...]  # fields in the order they are stored, large to small
    rate_hz: float | None = None  # expected rate, Hz, or None when it has none

    def __post_init__(self) -> None:
        if not _TYPE.fullmatch(self.message_type):
            raise LayoutError(
                f"{self.message_type!r} is not a ROS 2 message type.",
                fix="Name it like `rig_msgs/msg/Sample`.",
            )
        names = [field.name for field in self.fields]
        if not names or len(set(names)) < len(names):
            raise LayoutError(f"{self.topic}: fields must be one or more, with different names.")
        for field in self.fields:
            _check_field(self.topic, field)
        sizes = [np.dtype(NUMPY_TYPES[field.dtype]).itemsize for field in self.fields]
        if sizes != sorted(sizes, reverse=True):
            raise LayoutError(
                f"{self.topic}: the fields are not ordered large to small.",
                "CDR would pad between them, and readers that expect no padding would misread it.",
                "Put 8-byte fields first, then 4, 2 and 1.",
            )

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        """NumPy type of one message's fields, packed, little-endian."""
        return np.dtype([(field.name, NUMPY_TYPES[field.dtype]) for field in self.fields])

    @cached_property
    def record_dtype(self) -> np.dtype[np.void]:
        """NumPy type of one MCAP message record of this stream, opcode to last field."""
        return np.dtype(
            [
                ("opcode", "u1"),
                ("length", "<u8"),
                ("channel", "<u2"),
                ("sequence", "<u4"),
                ("log_time", "<u8"),
                ("publish_time", "<u8"),
                ("cdr", "<u4"),
                ("payload", f"V{self.dtype.itemsize}"),
            ]
        )

    @cached_property
    def record_length(self) -> int:
        """The length an MCAP message record of this stream states, which excludes its own head."""
        return MESSAGE_HEAD_BYTES + 4 + self.dtype.itemsize

    @property
    def schema_text(self) -> str:
        """The ROS 2 definition, with unit and description behind each field."""
        return "".join(
            f"{f.dtype} {f.name}  # [{f.unit}] {f.description}".rstrip() + "\n" for f in self.fields
        )

    @property
    def checksum(self) -> str:
        """CRC-32 of topic, type, definition and rate, eight hexadecimal digits.

        MCAP protects chunks and attachments, but not schemas and channels. Without this a flipped
        bit in an unfinished log could rename a field or change its unit unnoticed.
        """
        rate = "" if self.rate_hz is None else repr(float(self.rate_hz))
        whole = "\n".join([self.topic, self.message_type, rate, self.schema_text])
        return f"{zlib.crc32(whole.encode()):08x}"

    @property
    def channel_metadata(self) -> dict[str, str]:
        """Units, descriptions and expected rate (JSON), and the checksum, for the MCAP channel."""
        metadata = {
            "units": json.dumps({field.name: field.unit for field in self.fields}),
            "descriptions": json.dumps({field.name: field.description for field in self.fields}),
            CHECKSUM_KEY: self.checksum,
        }
        if self.rate_hz is not None:
            metadata["rate_hz"] = json.dumps(self.rate_hz)
        return metadata

    @classmethod
    def from_definition(
        cls, topic: str, message_type: str, text: str, rate_hz: float | None = None
    ) -> "Stream":
        """Return the stream that a ROS 2 definition, as `schema_text` writes it, describes.

        Its comments may be missing.

        Raises:
            LayoutError: The definition is not of fixed size, or needs padding.
        """
        fields = []
        for line in text.splitlines():
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            bare = line.partition("#")[0]
            match = _LINE.fullmatch(line.strip()) or _LINE.fullmatch(bare.strip())
            if match is None:
                raise LayoutError(f"{topic}: {line.strip()!r} is not a field of fixed size.")
            fields.append(
                Field(match["name"], match["type"], match["unit"] or "", match["text"] or "")
            )
        return cls(topic, message_type, tuple(fields), rate_hz)


def _check_field(topic: str, field: Field) -> None:
    if field.dtype not in NUMPY_TYPES:
        raise LayoutError(
            f"{topic}: {field.name} has type {field.dtype!r}, which is not of fixed size.",
            fix=f"Use one of {', '.join(NUMPY_TYPES)}.",
        )
    if not _NAME.fullmatch(field.name):
        raise LayoutError(
            f"{topic}: {field.name!r} cannot be a field name in ROS 2.",
            "Names are lower case letters and digits, with single underscores between them.",
        )
    text = field.unit + field.description
    if "]" in field.unit or text != " ".join(text.splitlines()):
        raise LayoutError(f"{topic}: unit or description of {field.name} is not one plain line.")
    if field.description != field.description.strip():
        raise LayoutError(f"{topic}: the description of {field.name} begins or ends with a space.")
