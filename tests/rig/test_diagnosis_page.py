"""The page of a diagnosis: what it contains, and how it behaves in a real browser."""

import io
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from estimation import model_file
from estimation.causes.verdict import answer
from estimation.diagnosis.result import VERDICTS, Diagnosis
from estimation.diagnosis.split import split
from rig.diagnosis.traces import Traces, traces
from rig.output.provenance import Provenance
from rig.reports.diagnosis import page
from rig.reports.diagnosis_words import next_sentence, sentences
from tests.estimation.synthetic import campaign
from tests.rig.browser import Opened, chromium
from tests.rig.test_reports import Page

pytestmark = pytest.mark.integration

BEFORE, AFTER = (0xC4, 0x50, 0x0B), (0x0B, 0x6F, 0xB3)
"""Colours of the declared model and of the one with the findings, on a light page."""

PROFILE = "#chart-residual-1-1"


@pytest.fixture(scope="module")
def diagnosed() -> tuple[Diagnosis, Traces]:
    """Return a diagnosis that found a ripple of seven waves a motor turn, and its signals.

    Its name is made less sure than it is, so that a page of it has every part.
    """
    runs = list(campaign(lambda angle, speed, load: 3e-3 * np.sin(7 * angle)))
    found = answer(runs, [model_file.read(Path("motor"))], split(runs, 0))
    (sure,) = found.diagnosis.findings
    assert sure.family == "ripple.motor"
    doubted = replace(
        sure,
        verdict="one_of",
        alternatives=("ripple.current",),
        confidence=0.71,
        probabilities={"ripple.motor": 0.71, "ripple.current": 0.25},
    )
    told = {"notes": ("A note with a <tag> & more.",), "noise_floor": {"motor": 1e-3}}
    return replace(found.diagnosis, findings=(doubted,), **told), traces(found)


def _with_play(angle_rad, gap_rad=0.02):
    """Return the angle of a shaft that follows another one after a gap."""
    out, at = np.empty_like(angle_rad), angle_rad[0]
    for k, x in enumerate(angle_rad):
        out[k] = at = min(max(at, x - gap_rad), x + gap_rad)
    return out


def test_the_errors_before_and_after_a_cause_of_a_shaft_that_rests_are_of_the_same_samples():
    """The ripple is that of the output shaft, which rests at every reversal of the motor."""
    rippled = campaign(lambda angle, speed, load: 3e-3 * np.sin(35 * _with_play(angle / 35)))
    runs = [
        run.with_columns(spindle_angle_rad=_with_play(run["motor_angle_rad"] / 35))
        for run in rippled
    ]
    found = answer(runs, [model_file.read(Path("motor"))], split(runs, 0))
    (finding,) = found.diagnosis.findings
    assert finding.family == "ripple.output"
    for run in traces(found).equations["motor"].runs:
        counted = [run.time_s, run.measured, run.before, run.after, *run.channels.values()]
        assert len({len(values) for values in counted}) == 1
        assert 0.0 < np.std(run.after) < np.std(run.before)


@pytest.fixture(scope="module")
def text(diagnosed):
    return page(*diagnosed, Provenance.now(1))


@pytest.fixture(scope="module")
def path(text, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "diagnosis.html"
    path.write_text(text)
    return path


def test_the_answer_and_the_check_come_before_evidence_and_method(text):
    body = text[text.index("<body>") :]
    order = ["unmodelled effect", "What to check", "feel the cogging", "Evidence", "Method and"]
    places = [body.index(words) for words in order]
    assert places == sorted(places)


def test_a_quick_diagnosis_of_several_names_states_that_none_was_searched_for(diagnosed):
    found, _ = diagnosed
    several = replace(found.findings[0], verdict="one_of", alternatives=("friction.load",))
    quick = replace(found, findings=(several,), next_experiment=None, quick=True)
    assert "--quick does not search" in next_sentence(quick)
    sure = replace(quick, findings=(replace(several, alternatives=()),))
    assert "no named hypotheses compete" in next_sentence(sure)


def test_an_alternative_at_another_place_is_said_with_that_place(diagnosed):
    diagnosis, signals = diagnosed
    (finding,) = diagnosis.findings
    placed = replace(finding, alternative_places={"ripple.current": "sensor motor_current_a"})
    found = replace(diagnosis, findings=(placed,))
    name = "ripple.current (sensor motor_current_a)"
    assert f"also possible: {name}; these" in sentences(found)[0]
    assert f"[{name}]" in page(found, signals, Provenance.now(1))
    assert "also possible: ripple.current;" in sentences(diagnosis)[0]
    of_drive = replace(finding, place="actuator motor_current_a", alternatives=("sensor.delay",))
    (said,) = sentences(replace(diagnosis, findings=(of_drive,)))
    assert "also possible: sensor.delay (actuator motor_current_a); these" in said


def test_a_name_that_may_be_at_two_places_is_printed_with_both(diagnosed):
    diagnosis, _ = diagnosed
    (finding,) = diagnosis.findings
    either = replace(finding, place="sensor a_n_m", other_places=("sensor b_n_m",))
    assert "(sensor a_n_m or sensor b_n_m)" in sentences(replace(diagnosis, findings=(either,)))[0]


def test_a_name_without_alternatives_is_not_said_to_have_one(diagnosed):
    (finding,) = diagnosed[0].findings
    alone = replace(finding, alternatives=(), no_effect=0.12, runs_improved=1, runs_total=1)
    (text,) = sentences(replace(diagnosed[0], findings=(alone,)))
    assert "also possible" not in text
    assert "these runs are not enough to be sure of it, and no effect at all has 12%" in text
    assert "no effect, not " in page(
        replace(diagnosed[0], findings=(alone,)), diagnosed[1], Provenance.now(1)
    )
    assert "error on 1 held-out test run " in text


def test_an_error_far_above_the_noise_is_stated_where_nothing_is_found(diagnosed):
    whole, _ = diagnosed
    for ratio, is_far in ((15.2, True), (1.2, False)):
        (text,) = sentences(replace(whole, findings=(), over_noise={"motor": ratio}))
        assert (
            "does not explain the error, which is 15 times that noise in motor" in text
        ) == is_far


def test_the_error_of_a_ratio_has_no_unit(diagnosed):
    (text,) = sentences(replace(diagnosed[0], unit=dict.fromkeys(diagnosed[0].unit, "1")))
    assert re.search(r" -> [\d.e-]+ \(lower in", text)


def test_a_page_is_well_formed_escaped_and_refers_to_nothing_outside(text):
    found = Page(text)
    assert found.open == []
    assert len(found.ids) == len(set(found.ids))
    assert all(reference.startswith("#") for reference in found.references)
    assert "A note with a &lt;tag&gt; &amp; more." in text


def test_every_chart_has_its_numbers_and_a_description_for_a_screen_reader(text):
    data = re.search(r'id="charts">(.*?)</script>', text, re.DOTALL)
    charts = json.loads(data[1])
    assert [c["name"] for c in charts] == ["residual-1-1", "errors-motor", "time-motor"]
    for chart in charts:
        assert f'aria-label="{chart["title"]}' in text
    assert text.count("Numbers of this chart") == 2


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_has_a_page_with_something_to_do(diagnosed, verdict):
    whole, shown = diagnosed
    if verdict == "nothing_missing":
        found = replace(whole, findings=())
    else:
        named = verdict in ("identified", "one_of")
        family = "ripple.motor" if named else "unknown"
        one = replace(whole.findings[0], verdict=verdict, family=family)
        found = replace(whole, findings=(one,))
    written = page(found, shown, Provenance.now(1))
    assert Page(written).open == []
    section = written[written.index("What to check</h2>") : written.index("Next experiment")]
    said = {"identified": "cogging", "one_of": "cogging", "nothing_missing": "Nothing"}
    assert said.get(verdict, "Find the part of the rig") in section


def test_a_page_without_signals_still_has_the_errors(diagnosed):
    whole, _ = diagnosed
    written = page(whole, Traces({}, ((),)), Provenance.now(1))
    assert "errors-motor" in written
    assert "chart-time-motor" not in written


@pytest.fixture(scope="module")
def browser():
    with chromium() as running:
        yield running


@pytest.fixture
def opened(browser, path):
    one = Opened(browser, path)
    yield one
    one.close()


def picture(opened: Opened, selector: str) -> np.ndarray:
    """Return what is drawn there, shape (height, width, 3), 0 to 255."""
    image = imread(io.BytesIO(opened.page.locator(selector).screenshot()))
    return np.asarray(image[..., :3]) * 255


def share(image: np.ndarray, colour: tuple[int, int, int]) -> float:
    """Return the share of the pixels that have nearly a colour."""
    return float(np.mean(np.abs(image - np.array(colour)).max(axis=-1) < 24))


def test_a_browser_opens_it_without_an_error_or_a_request(opened, path):
    assert opened.page.locator(".lead").first.is_visible()
    assert "ripple.motor" in opened.page.locator(".lead").first.inner_text()
    assert opened.messages == []
    assert opened.requests == [path.as_uri()]


def test_hovering_shows_values_with_their_units(opened):
    chart = opened.page.locator(PROFILE)
    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    opened.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    label = opened.page.locator(f"{PROFILE} .hoverlayer")
    label.locator("text=mN m").first.wait_for()
    words = label.text_content()
    assert "rad" in words
    assert "declared model" in words
    assert "with the findings" in words


def test_sides_and_runs_can_be_hidden(opened):
    both = picture(opened, PROFILE)
    assert min(share(both, BEFORE), share(both, AFTER)) > 1e-4
    opened.page.get_by_label("declared", exact=True).uncheck()
    alone = picture(opened, PROFILE)
    assert share(alone, BEFORE) == 0
    assert share(alone, AFTER) > 1e-4
    lines = f"document.querySelectorAll('{PROFILE} .scatterlayer .trace').length"
    shown = opened.page.evaluate(lines)
    opened.page.locator("input[data-run]").first.uncheck()
    opened.page.wait_for_function(f"{lines} < {shown}")


def test_another_run_can_be_chosen(opened):
    first = picture(opened, "#chart-time-motor")
    opened.page.get_by_role("combobox", name="Run").select_option(index=1)
    assert np.any(picture(opened, "#chart-time-motor") != first)


def test_light_and_dark_follow_the_system_and_the_button(browser, path):
    for scheme, dark in (("light", False), ("dark", True)):
        opened = Opened(browser, path, color_scheme=scheme)
        for turned in (False, True):
            image = picture(opened, PROFILE)
            ground = float(np.median(image))
            assert (ground < 60) == (dark != turned)
            assert (ground > 200) != (dark != turned)
            # what is drawn stands out from the ground
            assert np.mean(np.abs(image - ground).max(axis=-1) > 90) > 0.005
            opened.page.get_by_role("button", name="Light or dark").click()
        opened.close()


def test_nothing_is_wider_than_a_phone(browser, path):
    opened = Opened(browser, path, viewport={"width": 380, "height": 800})
    assert opened.page.evaluate("document.scrollingElement.scrollWidth") <= 380
    assert opened.page.locator(PROFILE).bounding_box()["width"] <= 380
    opened.close()


@pytest.mark.parametrize("form", ["svg", "png"])
def test_a_chart_is_exported_with_its_title_and_axes(opened, form, tmp_path):
    figure = opened.page.locator("figure", has=opened.page.locator(PROFILE))
    with opened.page.expect_download() as waiting:
        figure.get_by_role("button", name=form.upper()).click()
    file = tmp_path / waiting.value.suggested_filename
    waiting.value.save_as(file)
    assert file.name == f"residual-1-1.{form}"
    if form == "png":
        image = imread(file)
        assert image.shape[1] >= 2000  # fit for print
        assert image[0, 0, :3] == pytest.approx([1, 1, 1])
        return
    words = " ".join(re.findall(r">([^<]+)</text>", file.read_text()))
    for part in ("motor: residual over motor angle", "residual, mN m", "within a turn, rad"):
        assert part in words


def test_it_prints_light_without_controls_and_within_the_paper(browser, path):
    opened = Opened(browser, path, color_scheme="dark")
    opened.page.emulate_media(media="print")
    opened.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    opened.page.wait_for_function(
        f"document.querySelector('{PROFILE} svg').getBoundingClientRect().width < 700"
    )
    assert float(np.median(picture(opened, PROFILE))) > 200
    assert not opened.page.locator(".tools").first.is_visible()
    assert not opened.page.locator("#scheme").is_visible()
    assert opened.page.pdf(format="A4").startswith(b"%PDF")
    opened.close()


def test_a_screen_reader_finds_the_result_the_charts_and_the_controls(opened):
    tree = opened.page.locator("body").aria_snapshot()
    for part in (
        'heading "Diagnosis: one of several effects" [level=1]',
        'heading "What to check" [level=2]',
        'img "motor: residual over motor angle',
        'checkbox "declared" [checked]',
        'columnheader "before"',
        'button "SVG"',
    ):
        assert part in tree


def test_an_equation_that_no_finding_changes_is_drawn_once(diagnosed):
    whole, shown = diagnosed
    same = replace(whole.errors["motor"], by_run_after=whole.errors["motor"].by_run_before)
    written = page(replace(whole, findings=(), errors={"motor": same}), shown, Provenance.now(1))
    charts = json.loads(re.search(r'id="charts">(.*?)</script>', written, re.DOTALL)[1])
    drawn = {c["name"]: [*c["lines"], *next(iter(c["choices"].values()), [])] for c in charts}
    for name in ("errors-motor", "time-motor"):
        assert {line["meta"]["role"] for line in drawn[name]} <= {"before", "measured", "level"}
