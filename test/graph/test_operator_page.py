"""The operator's page in a real browser, on a simulated station of its own: what it shows, and what it may move."""

import math
import os
import shutil
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
import requests
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rf_pointing_msgs.msg import Alarm, ExecutiveStatus, ProcedureBlock, Schedule, ScheduledPass
from rf_pointing_msgs.srv import Named
from selenium import webdriver
from selenium.common.exceptions import StaleElementReferenceException
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from rf_pointing.report.night_report import write_night
from rf_pointing.ros.graph import NODES
from rf_pointing.ros.qos import LATCHED, STATUS, STREAM
from rf_pointing.ros.stamps import stamp_from_seconds
from test.conftest import within
from test.report.test_night_report import bad_night

from .conftest import free_port, live_graph
from .test_night import LiveNight

pytestmark = [
    pytest.mark.graph,
    pytest.mark.skipif(
        not (shutil.which("chromium") and shutil.which("chromedriver")),
        reason="no browser: sudo apt-get install chromium chromium-driver",
    ),
]

TOKEN = "the-token-of-this-test"
SPEED = 4.0
WAIT_S = 20.0
HOSTILE = "<script>document.title='owned'</script><img src=x onerror=\"document.title='owned'\">"
PAGE = """/**/operator_page:
  ros__parameters:
    page: {{port: {port}, token_file: {folder}/token, reports: {folder}/night}}
"""


def start_browser() -> Any:
    """Return Debian's chromium; it loads nothing and asks nobody."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or "missing: sudo apt-get install chromium chromium-driver"
    for argument in ("headless=new", "no-sandbox", "disable-dev-shm-usage", "disable-gpu", "window-size=1600,1000"):
        options.add_argument(f"--{argument}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = shutil.which("chromedriver")
    assert driver, "chromedriver is missing: sudo apt-get install chromium-driver"
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))


class Browser:
    """The page in a browser, next to the station that it shows."""

    def __init__(self, station: LiveNight, port: int) -> None:
        self.station, self.port, self.url = station, port, f"http://127.0.0.1:{port}"
        self.driver = start_browser()

    def text(self, selector: str) -> str:
        return str(self.driver.execute_script("return document.querySelector(arguments[0]).innerText", selector))

    def click(self, selector: str) -> None:
        self.driver.find_element(By.CSS_SELECTOR, selector).click()

    def until(self, condition: Callable[[], Any], what: str, patience_s: float = WAIT_S) -> None:
        began_s = time.monotonic()
        while not condition():
            assert within(time.monotonic() - began_s, patience_s), f"waited {patience_s:.0f} s for {what}"
            self.station.live.executor.spin_once(timeout_sec=0.02)

    def post(self, name: str, /, token: str = TOKEN, **arguments: Any) -> requests.Response:
        return requests.post(
            f"{self.url}/command", json={"name": name, "arguments": arguments}, timeout=10.0,
            headers={"Authorization": f"Bearer {token}"},
        )  # fmt: skip

    def log(self) -> str:
        return (self.station.folder / "logs" / "operator_page.log").read_text()

    def unlock(self, token: str = TOKEN) -> None:
        if self.text("#unlock").startswith("Lock"):
            return
        self.click("#unlock")
        field = self.driver.find_element(By.ID, "token")
        field.clear()
        field.send_keys(token)
        self.click("#door-open")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> Iterator[Browser]:
    folder, port = tmp_path_factory.mktemp("page"), free_port()
    (folder / "token").write_text(TOKEN)
    (folder / "token").chmod(0o600)
    report = folder / "night" / "passes" / "one"
    report.mkdir(parents=True)
    (report / "report.html").write_text(f"<h1>{HOSTILE}</h1>")
    with live_graph(folder, ros_domain) as live:
        more = PAGE.format(port=port, folder=folder)
        station = LiveNight(live, folder, (*NODES, "operator_page"), SPEED, more, lead_s=60.0)
        live.spin_until(lambda: "operator_page: page" in station.healths, "the page")
        live.spin_until(lambda: station.antenna.mode != "" and station.tracking.sequence > 0, "the station")
        one = Browser(station, port)
        try:
            one.driver.get(one.url)
            one.until(lambda: one.text("#link") == "● Live", "the page to be live")
            yield one
        finally:
            one.driver.quit()


def test_it_shows_the_values_of_the_station(page: Browser) -> None:
    page.until(lambda: page.text("#antenna-mode") == page.station.antenna.mode, "the mode")
    page.until(lambda: page.text("#station-name") == "LEO 3.7 m", "the name of the station")
    before = page.text("#clock")
    page.until(lambda: page.text("#clock") != before, "the clock")
    shown, commanded = (page.text(f"#axis-now-{axis}") for axis in (0, 1)), page.station.antenna.commanded
    for text, value in zip(shown, commanded, strict=True):
        assert float(text.rstrip("°").replace("−", "-")) == pytest.approx(math.degrees(value), abs=0.1)
    page.until(lambda: page.text("#axis-low-0") == "−270°", "the limits")
    assert page.text("#axis-high-1") == "180°"
    assert page.driver.find_element(By.ID, "sky-mask").get_attribute("d").count("L") > 100
    page.until(lambda: "pointing_controller" in page.text("#nodes"), "the nodes")
    assert page.text("#night-state") == "no executive runs"


def test_the_browser_reports_no_error_and_every_control_has_a_name(page: Browser) -> None:
    found = [row for row in page.driver.get_log("browser") if row["level"] in ("SEVERE", "WARNING")]
    assert not found
    assert not unnamed(page)


def unnamed(page: Browser) -> list[str]:
    """Return the controls in sight that a reader of the screen could not name."""
    controls = page.driver.find_elements(By.CSS_SELECTOR, "button, input, select, a, summary, [role=img]")
    try:
        visible = [each for each in controls if each.is_displayed()]
        assert len(visible) > 20
        return [str(each.get_attribute("outerHTML")) for each in visible if not each.accessible_name.strip()]
    except StaleElementReferenceException:
        # A row has changed in between.
        return unnamed(page)


def test_a_wrong_token_moves_nothing(page: Browser) -> None:
    before = page.station.antenna.mode
    for body in ("park", "stow", "stop_antenna", "release"):
        answer = page.post(body, token="a-wrong-token-of-this-test")
        assert (answer.status_code, answer.json()) == (401, {"accepted": False, "message": "the token is wrong"})
    page.click("button[data-command=pause_antenna]")
    page.until(lambda: "NOT SENT" in page.text("#toast"), "the locked command")
    page.click("#door-close")
    page.unlock("a-wrong-token-of-this-test")
    page.until(lambda: page.text("#door-message") == "the token is wrong", "the refused token")
    page.click("#door-close")
    assert page.text("#unlock") == "Unlock commands"
    # Long enough for a request that had passed: the node logs every one before it sends it.
    page.station.healths.pop("operator_page: page")
    page.until(lambda: "operator_page: page" in page.station.healths, "the next health")
    assert "requested" not in page.log()
    assert (page.station.antenna.mode, page.station.antenna.fault) == (before, "")


def test_a_command_that_makes_no_sense_is_refused_by_the_node_that_knows(page: Browser) -> None:
    for name, arguments, words in (
        ("set_along_track", {"value": 1e9}, "source.along_track_offset_s"),
        ("night_acknowledge", {"name": "disk"}, "service station_executive/acknowledge is not offered"),
    ):
        answer = page.post(name, **arguments).json()
        assert not answer["accepted"]
        assert words in answer["message"]


def test_offsets_are_set_and_shown(page: Browser) -> None:
    page.unlock()
    page.until(lambda: page.text("#unlock") == "Lock commands", "the open lock")
    page.driver.find_element(By.CSS_SELECTOR, "#offset input").send_keys("0.25")
    page.click("#offset button")
    page.until(lambda: page.text("#offsets-now") == "along track 0.25 s", "the offset in force")
    page.click("[data-command=clear_offsets]")
    page.until(lambda: page.text("#offsets-now") == "none", "no offset")


def test_a_held_button_jogs_and_a_released_one_rests(page: Browser) -> None:
    page.unlock()
    page.until(lambda: page.text("#unlock") == "Lock commands", "the open lock")
    page.until(lambda: page.station.antenna.mode == "holding", "an antenna at rest")
    button = page.driver.find_element(By.CSS_SELECTOR, "[data-jog='1 0']")
    hand = ActionChains(page.driver)
    hand.click_and_hold(button).perform()
    page.until(lambda: page.station.antenna.mode == "jogging", "the jog")
    hand.release().perform()
    page.until(lambda: page.station.antenna.mode == "holding", "rest")
    assert page.station.antenna.fault == ""


def test_a_pass_is_tracked_from_the_page(page: Browser) -> None:
    field = page.driver.find_element(By.CSS_SELECTOR, "#select input")
    field.send_keys("90001", Keys.ENTER)
    page.until(lambda: "select target" in page.text("#toast"), "the answer")
    page.until(lambda: page.text("#passes button") == "Track", "a pass")
    page.click("#passes button")
    # The first press moves nothing: a touch may be a mistake.
    page.until(lambda: page.text("#passes button") == "Track: press again", "the second request")
    assert page.station.tracking.mode == "idle"
    page.click("#passes button")
    page.until(lambda: page.station.tracking.mode != "idle", "the pass")
    page.until(lambda: page.text("#target") == "sat 1", "its target")
    page.until(lambda: "accepted" in page.text("#certificate"), "its certificate")
    page.until(lambda: page.text("#countdown").count(":") == 1, "the countdown")
    page.until(lambda: page.station.tracking.held and "held" in page.text("#held"), "the held target", 60.0)
    unit = page.driver.find_element(By.CSS_SELECTOR, "#carrier + small")
    assert not unit.is_displayed() or page.text("#carrier") != "no carrier"
    page.until(lambda: page.text("#carrier") != "no carrier" and unit.is_displayed(), "the carrier with its unit")
    drawn = page.driver.find_element(By.ID, "sky-track").get_attribute("d")
    assert drawn.count("L") > 20


def test_hostile_names_are_shown_as_text(page: Browser) -> None:
    node, t_s = page.station.live.node, page.station.now_s
    acknowledged: list[str] = []

    def acknowledge(request: Named.Request, response: Named.Response) -> Named.Response:
        acknowledged.append(request.name)
        response.success, response.message = True, HOSTILE
        return response

    service = node.create_service(Named, "station_executive/acknowledge", acknowledge)
    status = node.create_publisher(ExecutiveStatus, "executive_status", STATUS)
    schedule = node.create_publisher(Schedule, "schedule", LATCHED)
    health = node.create_publisher(DiagnosticArray, "/diagnostics", STREAM)
    entry = ScheduledPass(
        **dict.fromkeys(("id", "target", "state", "reason"), HOSTILE), aos=stamp_from_seconds(t_s), los=stamp_from_seconds(t_s)
    )  # fmt: skip
    alarm = Alarm(name=HOSTILE, level=2, message=HOSTILE, raised=stamp_from_seconds(t_s))
    sender = f"{page.station.live.namespace}/{HOSTILE}"
    one = DiagnosticStatus(level=b"\x01", name=f"x: {HOSTILE}", message=HOSTILE, hardware_id=sender)
    words = dict.fromkeys(("state", "target", "reason", "next_id"), HOSTILE)
    status.publish(ExecutiveStatus(**words, blocks=[ProcedureBlock(name=HOSTILE)], alarms=[alarm]))
    schedule.publish(Schedule(passes=[entry]))
    health.publish(DiagnosticArray(status=[one]))
    for place in ("#alarms", "#night-doing", "#night-state", "#schedule tbody", "#nodes"):
        page.until(lambda place=place: HOSTILE in page.text(place), f"the name in {place}")
    page.click("#alarms button")
    page.until(lambda: acknowledged == [HOSTILE], "the acknowledgement")
    page.until(lambda: HOSTILE in page.text("#toast"), "its answer")
    assert page.driver.title == "LEO 3.7 m"
    script = "return document.querySelectorAll('main script, main img, dialog img, output img').length"
    assert page.driver.execute_script(script) == 0
    for each in (status, schedule, health):
        node.destroy_publisher(each)
    node.destroy_service(service)


def test_reports_open_without_their_scripts(page: Browser) -> None:
    page.until(lambda: "one" in page.text("#reports"), "the report")
    address = page.driver.find_element(By.CSS_SELECTOR, "#reports a").get_attribute("href")
    page.driver.switch_to.new_window("tab")
    page.driver.get(address)
    assert page.driver.find_element(By.TAG_NAME, "h1")
    # The script is in the page, and does not run.
    assert page.driver.find_elements(By.CSS_SELECTOR, "h1 script")
    assert page.driver.title != "owned"
    page.driver.close()
    page.driver.switch_to.window(page.driver.window_handles[0])
    page.driver.get_log("browser")


def test_a_dead_server_is_shown_and_the_page_comes_back_by_itself(page: Browser) -> None:
    page.driver.execute_script("window.sameDocument = true")
    os.kill(page.station.processes.process_id("operator_page"), signal.SIGKILL)
    page.until(lambda: "CONNECTION LOST" in page.text("#banner"), "the banner", 5.0)
    assert "old" in page.text("#banner")
    opacity = "return getComputedStyle(document.querySelector('#now .big')).opacity"
    assert float(page.driver.execute_script(opacity)) < 0.5
    page.click("button[data-command=pause_antenna]")
    page.until(lambda: "NOT SENT: pause antenna" in page.text("#toast"), "what was not sent")
    page.until(lambda: "operator_page" in page.station.processes.ended(), "its end")
    page.station.processes.start(["operator_page"], autostart=True)
    page.until(lambda: page.text("#link") == "● Live", "the page to be live again", 30.0)
    assert page.driver.execute_script("return window.sameDocument && document.querySelector('#banner').hidden")
    page.until(lambda: page.text("#antenna-mode") == page.station.antenna.mode, "present values")


def test_a_telephone_shows_the_nights_without_scrolling_sideways(tmp_path: Path) -> None:
    """A night with lost passes, a hostile name and alarms, and the index with its trend."""
    for number in range(3):
        write_night(bad_night(), tmp_path / f"report-2006-06-2{number}T1800")
    driver = start_browser()
    try:
        size = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        for name in ("index.html", "report-2006-06-21T1800/night.html"):
            driver.get((tmp_path / name).as_uri())
            wide = driver.execute_script("return [document.documentElement.scrollWidth, innerWidth]")
            assert wide == [390, 390], name
    finally:
        driver.quit()


def test_a_telephone_shows_it_without_scrolling_sideways(page: Browser) -> None:
    page.driver.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride", {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
    )
    try:
        wide, view = page.driver.execute_script("return [document.documentElement.scrollWidth, innerWidth]")
        assert (wide, view) == (390, 390)
        box = page.driver.execute_script("return document.querySelector('#stop').getBoundingClientRect().toJSON()")
        assert box["height"] >= 44.0
        assert 0.0 <= box["top"] < 200.0
    finally:
        page.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_one_key_stops_the_antenna(page: Browser) -> None:
    page.unlock()
    page.until(lambda: page.text("#unlock") == "Lock commands", "the open lock")
    # Anywhere on the page, in a field too.
    page.driver.find_element(By.CSS_SELECTOR, "#select input").send_keys(Keys.ESCAPE)
    page.until(lambda: page.station.antenna.fault, "the stopped antenna")
    page.until(lambda: page.station.antenna.fault in page.text("#fault"), "the fault on the page")
    assert "FAULT LATCHED" in page.text("#fault")
