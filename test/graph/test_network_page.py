"""The page of a network in a real browser: antennas that are not well, one that says nonsense, and what is sent to whom."""

import re
import shutil
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
from rf_pointing_msgs.msg import (
    Alarm,
    AntennaStatus,
    ExecutiveStatus,
    Schedule,
    ScheduledPass,
    StationInUse,
    TrackingStatus,
)
from rf_pointing_msgs.srv import Named
from selenium.webdriver.common.by import By
from std_srvs.srv import Trigger

from rf_pointing.ros.qos import IN_USE, LATCHED, STATUS, STREAM
from rf_pointing.ros.stamps import stamp_from_seconds

from .conftest import free_port, live_graph
from .test_operator_page import HOSTILE, TOKEN, Browser

pytestmark = [
    pytest.mark.graph,
    pytest.mark.skipif(
        not (shutil.which("chromium") and shutil.which("chromedriver")),
        reason="no browser: sudo apt-get install chromium chromium-driver",
    ),
]
PAGE = """/**/operator_page:
  ros__parameters:
    page: {{port: {port}, token_file: {folder}/token, reports: "", antennas: "{antennas}"}}
"""
TELEPHONE = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}


class Antenna:
    """What an antenna publishes, sent by the test: nothing before `send`."""

    def __init__(self, node: Any, namespace: str, name: str, **status: Any) -> None:
        self.namespace, self.name, self.ahead_s, self.commands = namespace, name, 0.0, list[str]()
        self.status, self.tracking = status, dict[str, Any](mode="idle")
        self.alarms, self.passes = list[Alarm](), list[ScheduledPass]()
        make = lambda kind, topic, qos: node.create_publisher(kind, f"{namespace}/{topic}", qos)  # noqa: E731
        self._publishers = [
            make(AntennaStatus, "antenna_status", STATUS), make(TrackingStatus, "tracking_status", STREAM),
            make(ExecutiveStatus, "executive_status", STATUS), make(Schedule, "schedule", LATCHED),
            make(StationInUse, "station_in_use", IN_USE),
        ]  # fmt: skip
        node.create_service(Named, f"{namespace}/station_executive/acknowledge", self._acknowledge)
        node.create_service(Trigger, f"{namespace}/antenna_servo/stop", self._stop)

    def alarm(self, name: str, level: int, message: str) -> None:
        self.alarms.append(Alarm(name=name, level=level, message=message, raised=stamp_from_seconds(time.time())))

    def plan(self, target: str, in_s: float, long_s: float, state: str = "waiting") -> None:
        begin_s = time.time() + in_s
        times = {"aos": stamp_from_seconds(begin_s), "los": stamp_from_seconds(begin_s + long_s)}
        self.passes.append(ScheduledPass(id=f"{target}{in_s}", target=target, name=target, state=state, **times))

    def send(self) -> None:
        stamp = stamp_from_seconds(time.time() + self.ahead_s)
        for publisher, message in zip(self._publishers, (
            AntennaStatus(**({"mode": "holding"} | self.status)), TrackingStatus(**self.tracking),
            ExecutiveStatus(state="running", alarms=self.alarms), Schedule(passes=self.passes),
            StationInUse(station=self.name, node=f"{self.namespace}/antenna_servo"),
        ), strict=True):  # fmt: skip
            message.header.stamp = stamp
            publisher.publish(message)

    def _acknowledge(self, request: Named.Request, response: Named.Response) -> Named.Response:
        self.commands.append(f"acknowledge {request.name}")
        for each in self.alarms:
            each.acknowledged = True
        response.success = True
        return response

    def _stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.commands.append("stop")
        response.success = True
        return response


class Network:
    """Antennas that are sent twice a second, and a browser on their page."""

    def __init__(self, live: Any, folder: Any, antennas: str) -> None:
        self._live, self._next_s = live, 0.0
        self.antennas: dict[str, Antenna] = {}
        port = free_port()
        (folder / "token").write_text(TOKEN)
        (folder / "token").chmod(0o600)
        live.start(["operator_page"], PAGE.format(port=port, folder=folder, antennas=antennas), autostart=True)
        self._url = f"http://127.0.0.1:{port}"
        station: Any = SimpleNamespace(live=SimpleNamespace(executor=self), folder=folder)
        self.browser = Browser(station, port)

    def add(self, number: int, name: str, **status: Any) -> Antenna:
        namespace = f"{self._live.namespace}/gs{number}"
        self.antennas[namespace] = Antenna(self._live.node, namespace, name, **status)
        return self.antennas[namespace]

    def spin_once(self, timeout_sec: float) -> None:
        """Take the place of the executor for whoever waits: the antennas go on meanwhile."""
        if time.monotonic() >= self._next_s:
            self._next_s = time.monotonic() + 0.5
            for each in self.antennas.values():
                each.send()
        self._live.executor.spin_once(timeout_sec=timeout_sec)

    def open(self) -> None:
        """Open the page as soon as it is there."""
        page = self.browser

        def there() -> bool:
            page.driver.get(page.url)
            return bool(page.driver.find_elements(By.ID, "lines"))

        def loaded() -> bool:
            try:
                return there()
            except Exception:
                return False

        page.until(loaded, "the page", 60.0)
        page.until(lambda: page.text("#link") == "● Live", "the page to be live")

    def line(self, antenna: Antenna) -> str:
        lines = self.browser.driver.find_elements(By.CSS_SELECTOR, "#lines tbody tr")
        name = antenna.namespace.lstrip("/")
        return next((each.text for each in lines if name in each.text), "")

    def order(self) -> list[str]:
        lines = self.browser.driver.find_elements(By.CSS_SELECTOR, "#lines tbody small:not([title])")
        return [f"/{each.text}" for each in lines]


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> Iterator[Network]:
    folder = tmp_path_factory.mktemp("network")
    with live_graph(folder, ros_domain) as live:
        one = Network(live, folder, "all")
        well, warned, late, faulty, hostile = (
            one.add(number, name) for number, name in ((2, "Dish"), (10, "Horn"), (3, "Late"), (4, "Far"), (5, HOSTILE))
        )
        well.tracking = {"mode": "conscan", "target": "BIRD", "cross_elevation_error": 0.001, "beamwidth": 0.01}
        well.plan("BIRD", -100.0, 700.0, "active")
        well.plan("NEXT", 5000.0, 700.0)
        for each, message in ((warned, "wind of 16 m/s"), (well, "wind of 15 m/s")):
            each.alarm("high_wind", 1, message)
        late.ahead_s = 3600.0
        faulty.status = {"mode": "fault", "fault": "azimuth: following error"}
        hostile.alarm(HOSTILE, 2, HOSTILE)
        hostile.plan(HOSTILE, 60.0, 60.0, HOSTILE)
        try:
            one.open()
            one.browser.until(lambda: len(one.order()) == 5, "the antennas", 40.0)
            yield one
        finally:
            one.browser.driver.quit()


def test_the_worst_antenna_is_first_and_one_that_disagrees_is_named(network: Network) -> None:
    well, warned, late, faulty, hostile = network.antennas.values()
    page = network.browser
    page.until(lambda: "FAULT" in network.line(faulty) and "following error" in network.line(faulty), "the fault")
    # A stamp that waited on a busy machine makes the offset look smaller.
    clock = re.compile(r"its clock is 3(600\.0|59\d\.\d) s ahead of this computer's")
    page.until(lambda: clock.search(network.line(late)), "the clock", 30.0)
    page.until(lambda: "0.10 beam" in network.line(well) and "BIRD, 0" in network.line(well), "the pass")
    order = [faulty, late, hostile, well, warned]
    page.until(lambda: network.order() == [each.namespace for each in order], "the order")
    assert page.text("#summary") == "1 fault, 2 error, 2 warning"
    assert page.text("#coming").count("NEXT") == 1
    script = "return document.querySelectorAll('main script, main img').length"
    assert page.driver.execute_script(script) == 0
    assert HOSTILE in page.text("#alarms")
    assert not [row for row in page.driver.get_log("browser") if row["level"] in ("SEVERE", "WARNING")
                and "ERR_CONNECTION_REFUSED" not in row["message"]]  # fmt: skip


def test_an_alarm_of_two_antennas_is_acknowledged_once(network: Network) -> None:
    well, warned, *others = network.antennas.values()
    page = network.browser
    rows = [row for row in page.text("#alarms").splitlines() if "high wind" in row]
    assert len(rows) == 1
    page.unlock()
    page.until(lambda: page.text("#unlock") == "Lock commands", "the open lock")
    (button,) = page.driver.find_elements(By.CSS_SELECTOR, "#alarms [data-key=high_wind]")
    button.click()
    page.until(lambda: well.commands == warned.commands == ["acknowledge high_wind"], "both acknowledgements")
    page.until(lambda: "acknowledged" in page.text("#alarms"), "what has become of it")
    assert not any(each.commands for each in others)


def test_a_press_opens_the_page_of_one_antenna_and_stops_that_one_alone(network: Network) -> None:
    well, *others = network.antennas.values()
    page = network.browser
    page.driver.switch_to.active_element.send_keys("\ue00c")
    page.until(lambda: "NOTHING STOPPED" in page.text("#toast"), "why Esc stops nothing here")
    page.driver.find_element(By.LINK_TEXT, "Dish").click()
    page.until(lambda: page.text("#station-name") == "Dish" and page.text("#target") == "BIRD", "the antenna's page")
    page.unlock()
    page.click("#stop")
    page.until(lambda: well.commands[-1:] == ["stop"], "the stop")
    assert not any("stop" in each.commands for each in others)
    page.click("#all")
    page.until(lambda: len(network.order()) == 5, "all antennas again")


def test_a_telephone_shows_it_without_scrolling_sideways_and_a_dead_antenna_stays(network: Network) -> None:
    page = network.browser
    page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", TELEPHONE)
    page.until(lambda: len(network.order()) == 5, "the lines")
    assert page.driver.execute_script("return [document.documentElement.scrollWidth, innerWidth]") == [390, 390]
    dead = list(network.antennas.values())[1]
    del network.antennas[dead.namespace]
    page.until(lambda: "silent for" in network.line(dead), "the silent antenna", 30.0)
    assert len(network.order()) == 5
