import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.log.schema import NUMPY_TYPES, Field, LayoutError, Stream

NAMES = st.from_regex(re.compile(r"[a-z](_?[a-z0-9]){0,8}"), fullmatch=True)
TEXT = st.text(st.characters(codec="ascii", min_codepoint=32), max_size=20).map(str.strip)
UNITS = st.sampled_from(["", "1", "N m", "rad/s", "A"])


@st.composite
def streams(draw):
    names = draw(st.lists(NAMES, min_size=1, max_size=8, unique=True))
    kinds = draw(st.lists(st.sampled_from(sorted(NUMPY_TYPES)), min_size=8, max_size=8))
    kinds.sort(key=lambda kind: -np.dtype(NUMPY_TYPES[kind]).itemsize)
    pairs = zip(names, kinds, strict=False)
    fields = [Field(name, kind, draw(UNITS), draw(TEXT)) for name, kind in pairs]
    rate = draw(st.none() | st.floats(0.1, 1e4))
    return Stream("/a/topic", "some_msgs/msg/Kind", tuple(fields), rate)


@given(streams())
def test_a_stream_survives_its_ros2_definition(stream):
    text = stream.schema_text
    assert Stream.from_definition("/a/topic", "some_msgs/msg/Kind", text, stream.rate_hz) == stream


def test_a_plain_ros2_definition_with_comments_is_understood():
    text = "# a sample\n\nfloat64 x   # where it is\nuint32 sequence\n"
    stream = Stream.from_definition("/t", "p/msg/P", text)
    assert [(f.name, f.dtype) for f in stream.fields] == [("x", "float64"), ("sequence", "uint32")]
    for line in ("string name", "float64[] xs", "geometry_msgs/Point p", "x"):  # of variable size
        with pytest.raises(LayoutError):
            Stream.from_definition("/t", "p/msg/P", f"float64 t\n{line}\n")


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ([("a", "uint32"), ("b", "float64")], "large to small"),
        ([("a", "string")], "fixed size"),
        ([("a", "float64[3]")], "fixed size"),
        ([("A", "float64")], "field name"),
        ([("a__b", "float64")], "field name"),
        ([("a", "float64"), ("a", "float64")], "different names"),
        ([], "one or more"),
    ],
)
def test_a_layout_that_is_not_fixed_or_needs_padding_is_refused(fields, reason):
    with pytest.raises(LayoutError, match=reason):
        Stream("/t", "p/msg/P", tuple(Field(*field) for field in fields))
