"""A damaged log raises an error that names file, line and what was expected, and nothing else."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rig.errors import DataError
from rig.importers.mrdlab import IMPORTER

SMALL = {"seconds": 0.05, "frequency_hz": 30.0}
FIRST_SAMPLE = 4
"""Index of the first sample's line: three header lines and the line of column names before it."""


@pytest.fixture(scope="module")
def lines(make_log):
    return make_log(**SMALL).text().splitlines()


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("Tool_4_Maryland_L_4") / "00.TXT"


def read(path):
    return IMPORTER.open(path).runs[0].recording()


def field(line, column, value):
    fields = line.split(",")
    fields[column] = value
    return ",".join(fields)


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        (3, "0.0x1", r"line 15: column 4 is '0.0x1'.*decimal number, Measured Current"),
        (3, "", r"line 15: column 4 is ''"),
        (3, ".", r"line 15: column 4 is '\.'"),
        (3, "1e5", r"line 15: column 4 is '1e5'"),
        (3, "nan", r"line 15: column 4 is 'nan'"),
        (9, "12\0", r"line 15: column 10 is '12\\x00'"),
        (9, "1,2", r"line 15: the line has more than 10 columns"),
        (1, "1234567890123456", r"line 15: column 2 is.*at most 15 digits"),
        (1, "123456789012", r"line 15: Back-end CUI Encoder is 1.23457e\+11"),
        (3, "-5000", r"line 15: Measured Current is -5000.*between -1000 and 1000"),
        (0, "0.009", r"line 15: time goes from 0.009 to 0.009.*increases"),
        (0, "0.001", r"line 15: time goes from 0.009 to 0.001.*increases"),
    ],
)
def test_a_bad_value_is_named_by_line_and_column(path, lines, column, value, message):
    bad = list(lines)
    bad[FIRST_SAMPLE + 10] = field(bad[FIRST_SAMPLE + 10], column, value)
    path.write_text("\n".join(bad) + "\n")
    with pytest.raises(DataError, match=message) as error:
        read(path)
    assert str(path) in error.value.what
    assert "Nothing of the file was imported" in error.value.why


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda text: "", r"line 1: there is no header.*start with %"),
        (lambda text: "hello\nworld\n", r"line 1: there is no header"),
        (lambda text: text[:30], r"line 2: the file ends inside its header"),
        (lambda text: "".join(text.splitlines(True)[:4]), r"line 5: the log holds 0 samples"),
        (lambda text: "".join(text.splitlines(True)[:5]), r"line 6: the log holds 1 samples"),
        (lambda text: text[:-1], r"line 54: the file ends inside the line.*truncated"),
        (lambda text: text + "\n", r"line 55: column 1 is ''"),
        (lambda text: text + "0.050,1,2\n", r"line 55: the line has 3 columns"),
        (lambda text: text + "%a remark\n", r"line 55: column 1 is '%a remark'"),
        (lambda text: text.replace("Front-end Command", "Pressure"), r"column 7 is named"),
        (lambda text: text.replace(", Trajectory Target", ""), r"line 4: .* names 9 columns"),
        (lambda text: text.replace("%Back-end", "Back-end"), r"line 3: .* names 1 columns"),
    ],
)
def test_a_file_that_is_no_whole_log_is_refused(path, lines, edit, message):
    path.write_text(edit("\n".join(lines) + "\n"))
    with pytest.raises(DataError, match=message):
        read(path)


def test_a_file_that_went_away_is_named(tmp_path, lines):
    path = tmp_path / "00.TXT"
    path.write_text("\n".join(lines) + "\n")
    campaign = IMPORTER.open(path)
    path.unlink()
    with pytest.raises(DataError, match=r"00\.TXT cannot be read: No such file"):
        campaign.runs[0].recording()


MUTATIONS = st.lists(
    st.tuples(
        st.floats(0, 1),
        st.integers(0, 40),
        st.one_of(st.binary(max_size=6), st.text("0123456789.,-+%\r\n e", max_size=12)),
    ),
    min_size=1,
    max_size=4,
)


@settings(max_examples=150)
@given(mutations=MUTATIONS)
@example(mutations=[(0.99, 0, "999")])
@example(mutations=[(0.8, 9, "")])
def test_a_mutated_log_gives_its_values_or_a_data_error(path, lines, mutations):
    content = ("\n".join(lines) + "\n").encode()
    for where, removed, inserted in mutations:
        at = round(where * len(content))
        piece = inserted if isinstance(inserted, bytes) else inserted.encode()
        content = content[:at] + piece + content[at + removed :]
    path.write_bytes(content)
    try:
        recording = read(path)
    except DataError:
        return
    rows = [
        [float(value) for value in line.split(b",")]
        for line in content.split(b"\n")[:-1]
        if not line.startswith(b"%")
    ]
    raw = np.array(rows).T
    assert raw.shape == (10, len(recording))
    np.testing.assert_array_equal(recording["motor_current_a"], raw[3])
    np.testing.assert_array_equal(recording["motor_command_ratio"], -raw[7])
    np.testing.assert_allclose(recording["jaw_angle_rad"], raw[4] * np.deg2rad(0.09), rtol=1e-14)


@settings(max_examples=100)
@given(
    st.lists(
        st.decimals(-(10**9), 10**9, places=5, allow_nan=False).map(str), min_size=3, max_size=30
    )
)
def test_values_are_rounded_as_python_rounds_them(values):
    from rig.importers.mrdlab_text import parse_decimals

    values = values[: len(values) // 3 * 3]
    rows = [values[i : i + 3] for i in range(0, len(values), 3)]
    text = "".join(",".join(row) + "\n" for row in rows).encode()
    columns = np.empty((3, len(rows)))
    assert parse_decimals(np.frombuffer(text, np.uint8), columns) == (len(rows), len(text))
    assert columns.T.tolist() == [[float(value) for value in row] for row in rows]
