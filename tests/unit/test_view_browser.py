"""A page with interactive views in a real browser: no error, something is drawn, it turns, it moves on."""

from __future__ import annotations

import base64
import io
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from fem_biobot import cli
from fem_biobot.config import load_design
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.muscle.fibres import fibre_field
from fem_biobot.muscle.oxygenation import oxygenation
from fem_biobot.study.bow_view import bow_view
from fem_biobot.study.run import run
from fem_biobot.study.search_models import Model, seen
from fem_biobot.study.sweep_views import solved_view
from fem_biobot.study.tissue_views import fibres_view, oxygen_view
from fem_biobot.view.moving import machine_view
from fem_biobot.view.report import write_report
from tests.unit.test_view_interactive import triangle
from tests.unit.test_view_machine import body, shape

webdriver = pytest.importorskip("selenium.webdriver", reason="no selenium: pip install selenium")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1000,1400")
SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


def started(*flags: str) -> Any:
    """A browser; the test is skipped where there is none."""
    from selenium.common.exceptions import WebDriverException
    from selenium.webdriver.chrome.service import Service

    browser, driver = next(filter(None, map(shutil.which, BROWSERS)), None), shutil.which("chromedriver")
    if browser is None or driver is None:
        pytest.skip(f"no browser: found {browser or 'no chromium'} and {driver or 'no chromedriver'} on the path")
    options = webdriver.ChromeOptions()
    options.binary_location = browser
    for flag in (*FLAGS, *flags):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    try:
        return webdriver.Chrome(options=options, service=Service(driver))
    except WebDriverException as error:
        pytest.skip(f"{browser} does not start: {str(error).splitlines()[0]}")


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A small report: a box that is bent in three states, and one that moves over time."""
    machine = body()
    states = [shape(machine, f"state {k}", k) for k in (0.0, 4.0, 9.0)]
    views = [machine_view(machine, states, title="box"), triangle(labels=(), times=np.array([0.0, 0.5]), fields=[])]
    file = tmp_path_factory.mktemp("report") / "report.html"
    wide = ("Wide", [f"quantity_number_{k}_mm" for k in range(16)], [[1.0 / (k + 3)] * 16 for k in range(60)])
    words = ("Words", ["what", "why_mm"], [["a" * 30, "because " * 40]])
    write_report(file, {}, [], [("Table", ["a_mm"], [[1.5]]), wide, words], [], views=views)
    return file.as_uri()


@pytest.fixture(scope="module")
def browser(address: str) -> Iterator[Any]:
    """A browser that shows the report."""
    found = started(*SOFTWARE)
    found.get(address)
    yield found
    found.quit()


def canvas(browser: Any, view: int = 0) -> Any:
    return browser.find_elements("css selector", "figure.view3d canvas")[view]


def pixels(browser: Any, view: int = 0) -> np.ndarray:
    """What a view shows, once it has drawn what was last asked for."""
    before, deadline = None, time.monotonic() + 5.0
    while time.monotonic() < deadline:
        figure = browser.find_elements("css selector", "figure.view3d")[view]
        drawn = figure.get_attribute("data-drawn")
        if drawn is not None and drawn == before:
            break
        before = drawn
        time.sleep(0.1)
    text = browser.execute_script("return arguments[0].toDataURL('image/png')", canvas(browser, view))
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(text.partition(",")[2]))).convert("RGB"))


def changed(before: np.ndarray, after: np.ndarray) -> float:
    """Share of the pixels that differ by what the eye sees."""
    return float((np.abs(before.astype(int) - after.astype(int)).max(axis=2) > 8).mean())


def test_a_report_opens_without_an_error_and_draws_its_views(browser: Any) -> None:
    """Nothing in the console; in both views a twentieth of the pixels or more is not background.

    Catches: a shader that does not compile, arrays in another order than the script reads, a view behind the camera.
    """
    for view in (0, 1):
        assert (pixels(browser, view) < 245).any(axis=2).mean() > 0.05
    assert browser.get_log("browser") == []


def test_the_colours_of_the_bar_are_on_the_body(browser: Any) -> None:
    """The field is seen by its colours, the parts by theirs: red muscle shows with ``parts`` only.

    Catches: the ramp bound to the wrong texture, values read with another stride, a select that does nothing.
    """
    from selenium.webdriver.support.ui import Select

    chosen = Select(browser.find_elements("css selector", "figure.view3d select")[0])
    field = pixels(browser)
    assert "kPa" in browser.find_element("css selector", ".bar .name").text
    chosen.select_by_visible_text("parts")
    parts = pixels(browser).astype(int)
    red = (parts[..., 0] > 1.8 * parts[..., 2]) & (parts[..., 0] > 90)
    assert changed(field, parts) > 0.05
    assert red.mean() > 0.02
    assert browser.find_element("css selector", ".bar").text == ""
    chosen.select_by_index(0)
    assert changed(field, pixels(browser)) == 0.0


def test_dragging_turns_and_the_keys_bring_it_back(browser: Any) -> None:
    """Catches: pointer events that reach nothing, a turn without a new picture, a reset that forgets something."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    before = pixels(browser)
    for way in ((120, 0), (0, 60)):
        ActionChains(browser).drag_and_drop_by_offset(canvas(browser), *way).perform()
        assert changed(before, pixels(browser)) > 0.05
        canvas(browser).send_keys(Keys.HOME)
        assert changed(before, pixels(browser)) == 0.0
    canvas(browser).send_keys("+")
    assert (pixels(browser) < 245).any(axis=2).mean() > 1.1 * (before < 245).any(axis=2).mean()
    canvas(browser).send_keys(Keys.HOME)


def test_two_fingers_zoom(browser: Any) -> None:
    """Catches: touches taken for a mouse, a pinch that turns instead."""
    before, box = pixels(browser), canvas(browser).rect
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def touch(kind: str, apart: float | None) -> None:
        points = [] if apart is None else [{"x": x + s * apart, "y": y, "id": i} for i, s in enumerate((-1, 1))]
        browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", 60)
    for apart in (55, 50, 45, 40, 35, 30):
        touch("touchMove", apart)
    touch("touchEnd", None)
    after = pixels(browser)
    # half as far apart: a quarter of the area
    share = (after < 245).any(axis=2).mean() / (before < 245).any(axis=2).mean()
    assert 0.15 < share < 0.45
    browser.execute_script(
        "document.querySelectorAll('figure.view3d button').forEach(b => b.textContent === 'reset' && b.click())"
    )
    assert changed(before, pixels(browser)) == 0.0


def turns(browser: Any, view: int) -> None:
    """A view draws a body in colours, and another picture of it once turned."""
    from selenium.webdriver.common.keys import Keys

    before = pixels(browser, view)
    assert (before < 245).any(axis=2).mean() > 0.05, view
    # of a colour, not of lines and greys alone
    assert (np.ptp(before.astype(int), axis=2) > 60).mean() > 0.01, view
    for _ in range(4):
        canvas(browser, view).send_keys(Keys.ARROW_LEFT)
    assert changed(before, pixels(browser, view)) > 0.02, view


def test_bodies_of_studies_and_of_the_tissue_turn(browser: Any, tmp_path: Path) -> None:
    """Closed forms, a design found, a solve read back, fibres and oxygen: each draws, turns, and says nothing.

    Catches: a view of one state that the script cannot show, a part without a face, a field without values.
    """
    design = load_design("junction_bot")
    mesh = committed_mesh(design, 2.0)
    assert mesh is not None
    strip = load_design("strip", ["mesh.size = 0.8 mm"])
    run(strip, tmp_path / "strip", complete=False)
    views = [
        bow_view(design),
        seen(design, Model.rod),
        solved_view(tmp_path / "strip", "as_moulded", stands=False),
        fibres_view(mesh, fibre_field(design, mesh)),
        oxygen_view(oxygenation(design, mesh)),
    ]
    write_report(tmp_path / "report.html", {}, [], [], [], views=views)
    address = browser.current_url
    browser.get_log("browser")
    try:
        browser.get((tmp_path / "report.html").as_uri())
        for view in range(len(views)):
            turns(browser, view)
        assert browser.get_log("browser") == []
    finally:
        browser.get(address)


def test_print_shows_still_pictures_of_the_views_unstretched(address: str) -> None:
    """On paper stand pictures of both views in their proportions, twice as fine, no tool and nothing beyond the page.

    As Chromium lays out pages for its PDF: print media, at the width of A4 less the margins.

    Catches: a canvas stretched to the page, words of tools that are left out themselves, a wide table cut off.
    """
    browser = started(*SOFTWARE)
    try:
        browser.get(address)
        drawn = pixels(browser)
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
        size = {"width": 688, "height": 1009, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        browser.execute_script("window.dispatchEvent(new Event('beforeprint'))")
        time.sleep(0.5)
        for figure in browser.find_elements("css selector", "figure.view3d"):
            still = figure.find_element("css selector", ".still")
            natural = [still.get_property(f"natural{side}") for side in ("Width", "Height")]
            assert still.is_displayed()
            assert still.size["width"] / still.size["height"] == pytest.approx(natural[0] / natural[1], rel=0.01)
            assert natural[0] >= 2 * 0.9 * still.size["width"]
            assert not figure.find_element("css selector", "canvas").is_displayed()
            for tool in figure.find_elements("css selector", "button, select, input, .hint, .tool"):
                assert not tool.is_displayed(), tool.text
            data = still.get_attribute("src")
            assert data is not None
            image = np.asarray(Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2]))).convert("RGB"))
            assert (image < 245).any(axis=2).mean() > 0.05
        assert browser.execute_script("return document.documentElement.scrollWidth") <= 688
        assert (drawn < 245).any()
        browser.execute_script("window.dispatchEvent(new Event('afterprint'))")
        assert browser.find_element("css selector", "figure.view3d canvas").is_displayed()
        pages = base64.b64decode(browser.execute_cdp_cmd("Page.printToPDF", {})["data"])
        # two views and tables of many rows and columns
        assert 3 <= pages.count(b"/Type /Page\n") <= 5
    finally:
        browser.quit()


REPORTS = {
    "check": ("study", "check", "junction_bot"),
    "search": ("study", "search", "junction_bot", "--vary", "skeleton.beam_thickness=0.5mm..0.8mm", "--points", "3",
               "--target", "force=3mN"),
    "sweep": ("study", "sweep", "SWEEP", "--workers", "1"),
    "fibres": ("muscle", "fibres", "junction_bot"),
    "oxygen": ("muscle", "oxygen", "junction_bot"),
}  # fmt: skip


@pytest.mark.parametrize("kind", [pytest.param(k, marks=() if k == "check" else pytest.mark.slow) for k in REPORTS])
def test_reports_of_studies_are_whole_pages(browser: Any, tmp_path: Path, kind: str) -> None:
    """What a command leaves opens without a word in the console, shows its bodies, and is below 15 MB.

    Catches: a report without its view, a page too large to send.
    """
    bots = tmp_path / "bots.toml"
    bots.write_text(
        'base = "junction_bot"\ntask = "solve"\n[set]\nmesh.size = "2 mm"\n'
        '[grid]\nskeleton.beam_thickness = ["0.6 mm", "0.8 mm"]\n'
    )
    words = [str(bots) if word == "SWEEP" else word for word in REPORTS[kind]]
    assert cli.main([*words, "--out", str(tmp_path / "out"), "--quiet"]) == 0
    report = tmp_path / "out" / "report.html"
    assert report.stat().st_size < 15e6
    address = browser.current_url
    browser.get_log("browser")
    try:
        browser.get(report.as_uri())
        count = len(browser.find_elements("css selector", "figure.view3d"))
        assert count == (2 if kind == "sweep" else 1)
        for view in range(count):
            turns(browser, view)
        assert browser.get_log("browser") == []
    finally:
        browser.get(address)


@pytest.mark.parametrize("view", [0, 1])
def test_the_slider_and_play_move_through_states_and_times(browser: Any, view: int) -> None:
    """Catches: a slider bound to nothing, a label of another state, play that does not run or not stop."""
    from selenium.webdriver.common.keys import Keys

    figure = browser.find_elements("css selector", "figure.view3d")[view]
    slider, told = (
        figure.find_element("css selector", "input[type=range]"),
        figure.find_element("css selector", ".told"),
    )
    slider.send_keys(Keys.END)
    after = pixels(browser, view)
    last = told.text
    slider.send_keys(Keys.HOME)
    assert changed(after, pixels(browser, view)) > 0.005
    assert (told.text, last) == (("state 0.0, 0.0 kPa", "state 9.0, 9.0 kPa"), ("0.000 s", "0.500 s"))[view]
    play = figure.find_element("css selector", "button")
    play.click()
    time.sleep(0.4)
    play.click()
    stopped = told.text
    assert stopped != ("state 0.0, 0.0 kPa", "0.000 s")[view]
    time.sleep(0.2)
    assert told.text == stopped
    slider.send_keys(Keys.END)


def test_without_webgl_a_sentence_stands_in_its_place(address: str) -> None:
    """Catches: an empty box, an error in the console of a browser that draws no 3D."""
    found = started("--disable-3d-apis")
    try:
        found.get(address)
        text = found.find_element("css selector", "figure.view3d .fallback").text
        assert "WebGL" in text
        assert not found.find_elements("css selector", "canvas")
        assert [line for line in found.get_log("browser") if line["level"] == "SEVERE"] == []
    finally:
        found.quit()
