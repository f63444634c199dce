"""The operator's page in a real browser, on a simulated station of its own: what it shows, and what it may move."""

import math
import shutil
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2", exc_type=ImportError)
import requests
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from rf_pointing.nodes.graph import NODES

from .conftest import live_graph
from .test_night import LiveNight

pytestmark = pytest.mark.graph

TOKEN = "the-token-of-this-test"
SPEED = 4.0
WAIT_S = 20.0
HOSTILE = "<script>document.title='owned'</script><img src=x onerror=\"document.title='owned'\">"
PAGE = """/**/operator_page:
  ros__parameters:
    page: {{port: {port}, token_file: {folder}/token, reports: {folder}/night}}
"""


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def start_browser() -> Any:
    """Return Debian's chromium; it loads nothing and asks nobody."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or "missing: sudo apt-get install chromium chromium-driver"
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--disable-gpu",
        "--window-size=1600,1000",
    ):
        options.add_argument(argument)
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
        deadline_s = time.monotonic() + patience_s
        while not condition():
            assert time.monotonic() < deadline_s, f"waited {patience_s:.0f} s for {what}"
            self.station.live.executor.spin_once(timeout_sec=0.02)

    def post(self, name: str, token: str = TOKEN, **arguments: Any) -> requests.Response:
        return requests.post(
            f"{self.url}/command", json={"name": name, "arguments": arguments}, timeout=10.0,
            headers={"Authorization": f"Bearer {token}"},
        )  # fmt: skip

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


def test_one_key_stops_the_antenna(page: Browser) -> None:
    page.unlock()
    page.until(lambda: page.text("#unlock") == "Lock commands", "the open lock")
    # Anywhere on the page, in a field too.
    page.driver.find_element(By.CSS_SELECTOR, "#select input").send_keys(Keys.ESCAPE)
    page.until(lambda: page.station.antenna.fault, "the stopped antenna")
    page.until(lambda: page.text("#fault").startswith(("FAULT", "✖ FAULT")), "the fault on the page")
    assert page.station.antenna.fault in page.text("#fault")
