"""Pages of HTML, and that of recordings: well formed, without references to anything outside."""

import json
import re
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from io import StringIO
from xml.etree import ElementTree

import numpy as np
import pytest

from estimation.causes.isolability import NOTHING, Isolable
from estimation.causes.run_errors import Errors, that_falls
from estimation.changes.difference import Change, Difference
from estimation.diagnosis.result import Diagnosis, Finding, Value
from estimation.diagnosis.split import Sealed
from estimation.effects import catalogue
from estimation.model import Estimate, Model, Term
from estimation.recording import Flag, Mark, Recording
from rig.diagnosis import plan
from rig.log.convert import write_recording
from rig.output import figures
from rig.output.provenance import Provenance, commit
from rig.output.table import TextTable, to_markdown, to_rich
from rig.reports import changes
from rig.reports.diagnosis import card, parameter_table
from rig.reports.diagnosis_words import check_of, lines, meaning, meaning_of, sentences, sizes_of
from rig.reports.fit import parameter_table as fitted_table
from tests.rig.browser import Opened, chromium

pytestmark = pytest.mark.integration

VOID = {"meta", "br", "hr", "img", "link", "input"}


class Page(HTMLParser):
    """Reads a page and keeps what a test asks for."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.ids: list[str] = []
        self.references: list[str] = []
        self.counts: dict[str, int] = {}
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.counts[tag] = self.counts.get(tag, 0) + 1
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name in ("src", "href", "xlink:href", "data", "action", "srcset"):
                self.references.append(value)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag


def test_a_figure_is_a_small_sound_file_with_its_caption_as_title(tmp_path):
    time_s = np.arange(100_000) * 1e-3
    drawn = figures.over_time(time_s, {"x": np.sin(time_s)}, "N m", "a < b")
    assert drawn == figures.over_time(time_s, {"x": np.sin(time_s)}, "N m", "a < b")
    assert len(drawn) < 100_000
    (path,) = figures.write_svgs(tmp_path, {"x": drawn})
    svg = "{http://www.w3.org/2000/svg}"
    root = ElementTree.parse(path).getroot()  # noqa: S314  drawn above
    assert root.tag == f"{svg}svg"
    assert root.findtext(f"{svg}title") == "a < b"


def test_every_family_has_a_meaning_in_plain_words():
    for family in {effect.family for effect in catalogue().values()}:
        words = meaning(family)
        assert words, family
        assert not words.endswith("."), family


def found(family, **more):
    """Return a finding of the equation of the motor, or of another one."""
    place = more.get("balance", "motor")
    usual = {"balance": place, "error_of": place, "verdict": "identified"}
    return Finding(family=family, **usual | more)


def diagnosis(*findings, unit=None, **more):
    """Return a diagnosis with these findings, made with one discovery run."""
    return Diagnosis(findings, {}, unit or {}, {}, {}, Sealed((), ("a",), 0, "", ""), **more)


def change(family, equation, parameter, size, ci95, unit, **more):
    """Return an effect that came, with one parameter before the others."""
    usual = {
        "verdict": "came",
        "how": "came",
        "name": f"{family} at {equation}",
        "alternatives": (),
        "confidence": 0.99,
        "before": {parameter: None},
        "shape": {},
    }
    values = {"parameters": {parameter: size}, "ci95": {parameter: ci95}, "unit": unit}
    return Change(family=family, equation=equation, **usual | values | more)


def test_the_form_that_was_found_is_described_and_not_the_head_of_its_family():
    forms = {
        "spring.position.curved": "stiffness changes along its travel",
        "change.step.offset": "an offset that jumps",
        "spring.end_stop": "above an upper limit",
        "spring.end_stop.opening": "below a lower limit",
        "friction.drag": "square of speed",
    }
    for form, words in forms.items():
        assert words in meaning_of(found(catalogue()[form].family, form=form))
    assert meaning("spring.end_stop") == "a contact spring beyond a limit angle"  # of both forms


def test_a_whole_number_is_at_no_bound():
    harmonic = catalogue()["inertia.position"].shape[0]
    term = Term(catalogue()["inertia.position"], values={"harmonic": Estimate(harmonic.upper)})
    assert not term.is_at_bound(harmonic)


@pytest.mark.parametrize(
    ("along", "repeats"),
    [
        ("motor_angle", {"": "7 per turn of the motor angle"}),
        ("table_position", {"period": "0.898 m"}),
    ],
)
def test_sizes_are_those_of_the_wave_and_in_readable_units(along, repeats):
    wave = {
        "sine": Value(3e-3, "N m", None),
        "cosine": Value(4e-3, "N m", None),
        "order": Value(7.0, "1", None),
        "time": Value(0.25, "s", None),
    }
    finding = found("ripple.motor", place="motor", depends_on=(along,), parameters=wave)
    assert sizes_of(finding) == {"amplitude": "5 mN m", "time": "0.25 s"} | repeats
    assert "lead of the screw, the pitch of the belt" in check_of(finding)


def test_a_crosstalk_is_stated_with_the_quantity_that_the_sensor_responds_to():
    share = {"share": Value(0.5, "N m/rad", None)}
    place = "sensor link_torque_n_m"
    finding = found("sensor.crosstalk", place=place, depends_on=("link_angle",), parameters=share)
    (said,) = sentences(diagnosis(finding, unit={"motor": "N m"}))
    assert "responds to another measured quantity, the link angle [sensor.crosstalk]" in said


@pytest.mark.parametrize(
    ("confidence", "words"),
    [
        (0.3, "no effect at all has 44%, next to 56% of all effects together; error"),
        (0.5, "no effect at all has 44%; error"),
    ],
)
def test_no_effect_that_is_likelier_than_a_name_is_stated_next_to_all_names(confidence, words):
    likely = {"verdict": "one_of", "confidence": confidence, "no_effect": 0.44}
    (said,) = sentences(diagnosis(found("friction.load", **likely), unit={"motor": "N m"}))
    assert words in said


def test_a_friction_that_falls_with_the_temperature_is_labelled_so():
    """Of one that grows, the number is negative."""
    parameters = {"friction": Value(-0.0065, "A/K", None)}
    form = "friction.warmup.measured"
    finding = found("friction.warmup", form=form, parameters=parameters)
    assert sizes_of(finding) == {"friction (fall of the loss per kelvin)": "-0.0065 A/K"}


def test_a_zero_that_settles_far_beyond_a_run_is_stated_with_the_rate_at_which_it_begins():
    """Of short runs the size and the time are known by their quotient alone."""
    finding = Finding(
        balance="motor",
        error_of="motor",
        place="sensor jaw_torque_n_m",
        family="sensor.drift",
        form="sensor.drift.exponential",
        verdict="identified",
        parameters={
            "drift": Value(0.08, "N m", None),
            "time_constant": Value(100.0, "s", None),
        },
    )
    assert sizes_of(finding)["at first"] == "0.8 mN m/s"


@pytest.mark.parametrize("form", ["", "transmission.backlash.play"])
def test_a_parameter_that_is_half_of_a_size_is_labelled_so(form):
    """Wherever it is printed: a part may be ordered by it."""
    named = "gap (half the free travel)"
    gap, width = Value(2.5e-3, "rad", (2.4e-3, 2.6e-3)), Value(0.1, "N m", None)
    parameters = {"gap": gap, "width": width}
    finding = found("transmission.backlash", balance="tendon", form=form, parameters=parameters)
    assert sizes_of(finding) == {named: "0.0025 rad", "width": "100 mN m"}
    assert parameter_table([finding]).rows[0][0] == f"tendon, transmission.backlash, {named}"
    of_gap = (2.5e-3, (2.4e-3, 2.6e-3), {"gap": "rad"})
    difference = Difference((change("transmission.backlash", "gearbox", "gap", *of_gap),), {})
    assert f"{named} +0.0025 rad" in next(changes.lines(difference))
    assert changes.change_table(difference).rows[0][1] == named


def test_a_change_is_stated_with_the_form_and_the_shape_of_its_effect():
    """A share of a load says little without the power of that load."""
    unit = {"friction": "1", "exponent": "1", "width": "rad/s"}
    shape = {"exponent": 2.0 / 3.0, "width": 0.4}
    of_load = ("friction.load", "motor", "friction", 0.67, (0.56, 0.7), unit)
    came = change(*of_load, form="friction.load.power", shape=shape)
    difference = Difference((came,), {})
    named = "friction (share of a load of 0.1)"
    assert next(changes.lines(difference)) == (
        f"New effect: friction.load at motor (friction.load.power), {named} +0.67"
        " (+0.56 to +0.7), exponent 0.667, width 0.4 rad/s (confidence 99%)."
    )
    assert [row[1:4] for row in changes.change_table(difference).rows] == [
        (named, "-", "+0.67"),
        ("exponent", "-", "0.6667"),
        ("width", "-", "0.4"),
    ]
    moved = replace(came, verdict="moved", how="moved", before={"friction": 0.1})
    assert "exponent" not in next(changes.lines(Difference((moved,), {})))


def test_the_page_has_the_period_of_a_wave_along_a_travel():
    order = {"order": Value(1250.0, "1", (1200.0, 1300.0))}
    along = {"depends_on": ("table_position",), "parameters": order}
    finding = found("ripple.motor", balance="carriage", confidence=0.9999, **along)
    (row,) = parameter_table([finding]).rows
    assert row == ["carriage, ripple.motor, period", "0.00503", "0.00483 to 0.00524", "m"]
    whole = diagnosis(finding, unit={"carriage": "N"})
    assert "confidence more than 99%" in sentences(whole)[0]
    assert ("Confidence", "more than 99%") in card(finding, whole)["facts"]


def test_what_may_be_wrong_with_the_recordings_comes_before_what_is_found_in_them():
    notes = ("motor: a limit.", "Check: tool_force_n: is it clipped?")
    said = lines(diagnosis(notes=notes))
    assert [said[0], said[-1]] == [notes[1], notes[0]]
    assert said[1].startswith("No unmodelled effect found")


def test_a_plan_states_what_its_numbers_are():
    vague = Isolable("motor", "ripple.motor", "motor", 0.4, {"sensor.crosstalk": 0.5})
    sure = Isolable("motor", "friction.load", "motor", 0.97, {})
    said = plan.sentences(plan.Plan("quick", 12, (vague, sure)))
    assert said[4:6] == ["Named:", "  motor: friction.load 0.97 (motor)"]
    assert "the probability that it would be named" in said[2]
    assert said[3] == "  motor: ripple.motor 0.40 or sensor.crosstalk 0.50 (motor)"


@pytest.mark.parametrize("offsets", [True, False])
def test_a_plan_states_why_an_effect_is_not_seen(offsets):
    gone = {NOTHING: 1.0}
    asymmetry = Isolable("axis", "friction.coulomb_asymmetry", "axis", 0.0, gone)
    late = Isolable("sensor axis_position_m", "sensor.delay", "axis", 0.0, gone)
    said = plan.sentences(plan.Plan("runs", 9, (asymmetry, late), run_offsets=offsets))
    terms = "the declared terms or the run offsets" if offsets else "the declared terms"
    assert said[2:] == [
        f"Not seen, because {terms} take its place:",
        "  axis: friction.coulomb_asymmetry (axis)",
        "Not seen, because short delays of readings are part of every model; one above 2 ms can"
        " be:",
        "  axis: sensor.delay (sensor axis_position_m)",
    ]


def test_a_finding_whose_own_equation_gains_nothing_states_the_error_of_another():
    errors = {"rmse_before": 0.004, "rmse_after": 0.001, "runs_improved": 2, "runs_total": 2}
    finding = found("sensor.delay", also_in=("cable",), error_of="cable", **errors)
    unit = {"motor": "N", "cable": "N m"}
    (sentence,) = sentences(diagnosis(finding, unit=unit))
    assert sentence.startswith("motor: ")
    assert "error of cable on 2 held-out test runs 4 -> 1 mN m" in sentence
    (sentence,) = sentences(diagnosis(replace(finding, error_of="motor"), unit=unit))
    assert "; error on 2 held-out test runs 0.004 -> 0.001 N" in sentence


@pytest.mark.parametrize(
    ("within", "means", "is_stated", "with_means"),
    [
        ((4.0, 1.0), False, (4.0, 1.0), False),
        ((4.0, 1.0), True, (5.0, 3.0), True),
        ((4.0, 4.1), False, (5.0, 3.0), True),  # confirmed by the means of runs alone
    ],
)
def test_a_finding_states_the_error_by_which_it_is_confirmed(within, means, is_stated, with_means):
    """One that rises next to a confirmed finding contradicts it."""
    runs = {"a": 1}
    before, after = (
        Errors({"a": own**2}, {"a": total**2}, runs)
        for own, total in zip(within, (5.0, 3.0), strict=True)
    )
    old, new, has_means = that_falls(before, after, means, 0.01)
    assert ((old.rmse, new.rmse), has_means) == (is_stated, with_means)
    errors = {"rmse_before": old.rmse, "rmse_after": new.rmse, "runs_total": 1}
    finding = found("unknown", verdict="depends_on", with_means=has_means, **errors)
    (said,) = sentences(diagnosis(finding, unit={"motor": "N"}))
    means_too = ", the mean of each run included:" * with_means
    assert f"error on 1 held-out test run{means_too} {old.rmse:.3g} -> " in said


def test_a_table_is_the_same_in_every_medium():
    from rich.console import Console

    table = TextTable("T [x]", ["a", "b"], [["p|q", "1"]], "a note")
    assert to_markdown(table) == "## T [x]\n\n| a | b |\n|---|---:|\n| p\\|q | 1 |\n\na note\n"
    written = StringIO()
    Console(width=60, file=written).print(to_rich(table))
    assert "T [x]" in written.getvalue()
    assert "p|q" in written.getvalue()


def test_provenance_keeps_the_folders_of_relative_paths_only(monkeypatch):
    words = [
        "diagnose",
        "runs/may",
        "--column",
        "a_rad=enc:rev/2000",
        "--report=/home/me/r",
        "/b/c",
    ]
    monkeypatch.setattr("sys.argv", ["/usr/bin/rig", *words])
    kept = "diagnose runs/may --column a_rad=enc:rev/2000 --report=r c"
    assert Provenance.now(0).command.endswith(kept)


def test_provenance_names_the_commit(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["/usr/bin/rig", "demo"])
    assert commit(tmp_path) == "unknown"
    made = Provenance.now(7)
    assert made.seed == 7
    assert "/" not in made.command
    assert re.fullmatch(r"unknown|[0-9a-f]{7,}(\+changes)?", made.commit)


def test_a_page_written_before_does_not_change_the_commit_of_the_next(tmp_path):
    def git(*words):
        author = ["-c", "user.name=n", "-c", "user.email=e"]
        subprocess.run(["git", "-C", str(tmp_path), *author, *words], check=True)

    (tmp_path / "docs").mkdir()
    page, code = tmp_path / "docs/page.md", tmp_path / "code.py"
    for path in (page, code):
        path.write_text("1\n")
    git("init", "-q")
    git("add", ".")
    git("commit", "-q", "-m", "first")
    page.write_text("2\n")
    assert re.fullmatch(r"[0-9a-f]{7,}", commit(tmp_path))
    code.write_text("2\n")
    assert commit(tmp_path).endswith("+changes")


GRIP = "distal_torque_n_m"


def recorded(name, bias=0.0, travel=1.0):
    time_s = np.arange(2000) / 1000
    torque = 0.05 * np.sin(6 * time_s)
    columns = {
        "jaw_angle_rad": travel * np.cos(3 * time_s),
        GRIP: torque,
        f"estimated_{GRIP}": torque + bias,
    }
    flags = np.zeros(2000, np.uint8)
    flags[500:520] = Flag.STALE
    return Recording(name, time_s, columns, flags, {"load_a": 0.2}, marks=(Mark(1.0, "<b> & c"),))


@pytest.fixture
def folder(tmp_path):
    for name, travel in (("000-a", 1.0), ("001-b", 1.001)):  # the same run would count once
        write_recording(tmp_path / f"{name}.mcap", recorded(name, 0.01, travel))
    return tmp_path


@pytest.fixture
def written(folder, said):
    said("view --no-open", folder, "--out", folder / "page.html")
    return folder / "page.html"


def test_each_run_has_all_channels_the_estimate_on_its_sensor_and_the_residual(written):
    text = written.read_text()
    found = Page(text)
    assert (found.open, found.references) == ([], ["#evidence"])
    assert len(found.ids) == len(set(found.ids))
    (chart,) = json.loads(re.search(r'id="charts">(.*?)</script>', text, re.DOTALL)[1])
    lines = {line["name"]: line for line in chart["choices"]["001-b"]}
    axis = {name: line.get("yaxis", "y") for name, line in lines.items()}
    assert axis["distal torque"] == axis["estimated distal torque"] != axis["jaw angle"]
    residual = lines["distal torque, measured - estimated"]
    assert residual["y"][0] == pytest.approx(-10.0)  # mN m
    assert max(lines["flags"]["y"]) == Flag.STALE
    assert "load_a = 0.2" in text
    assert "&lt;b&gt; &amp; c at 1 s" in text


def test_a_page_of_one_run_is_named_and_opened_unless_unwanted(folder, said, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    page = folder / "page.html"
    assert str(page) in said("view --run 000-a", folder, "--out", page).out
    assert opened == [page.as_uri()]
    assert "000-a" in page.read_text()
    assert "001-b" not in page.read_text()
    said("view --run 002", folder, code=2)


def test_the_page_draws_and_changes_run_in_a_browser(written):
    with chromium() as browser:
        opened = Opened(browser, written)
        assert opened.messages == []
        assert [r for r in opened.requests if not r.startswith(("file:", "data:", "blob:"))] == []
        panels = opened.page.locator("#chart-time-recordings .ylines-above").count()
        assert panels == 4  # angle, torque, residual, flags
        opened.page.select_option("select", "001-b")
        assert opened.page.locator("#chart-time-recordings .scatterlayer .trace").count() == 5
        opened.close()


def test_a_run_that_cannot_be_read_may_be_skipped(folder, said):
    damaged = bytearray(write_recording(folder / "002-c.mcap", recorded("002-c")).read_bytes())
    damaged[len(damaged) // 2] ^= 0xFF
    (folder / "002-c.mcap").write_bytes(damaged)
    words = ("view --no-open", folder, "-o", folder / "p.html")
    said(*words, code=5)
    assert "002-c" in said(*words, "--skip-bad").err
    assert "001-b" in (folder / "p.html").read_text()


def test_two_terms_of_one_effect_are_labelled_by_their_channels():
    """Such as the inertia of a motor and that behind its gear."""
    kind, values = catalogue()["inertia.missing"], {"inertia": Estimate(0.7)}
    of_axes = [Term(kind, -1, {"acceleration": f"{a}_acceleration_rad_s2"}, values) for a in "ab"]
    rows = fitted_table(Model("m", "motor", "motor_torque_n_m", tuple(of_axes))).rows
    assert [row[0] for row in rows] == [
        f"inertia.missing({a}_acceleration_rad_s2), inertia" for a in "ab"
    ]


@pytest.mark.parametrize(
    ("ci95", "shown"),
    [
        (None, ""),
        ((0.4, 1.2), "0.4 to 1.2"),
        ((0.001, 99.96), "any"),
        ((0.001, 50.0), "0.001 to 50"),
    ],
)
def test_an_interval_that_is_the_bounds_is_stated_as_any(ci95, shown):
    effect = catalogue()["friction.coulomb"]
    values = {"friction": Estimate(0.7), "width": Estimate(1.0, ci95=ci95)}
    model = Model("m", "motor", "motor_torque_n_m", (Term(effect, values=values),))
    (_, (_, _, _, interval, unit)) = fitted_table(model).rows
    assert (interval, unit) == (shown, "rad/s")
