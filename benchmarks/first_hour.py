"""Do what a new user does in the first hour and the first night; print each acceptance with its measured value.

    scripts/run-python benchmarks/first_hour.py                       everything, 50 min
    scripts/run-python benchmarks/first_hour.py --only boot page      some parts
    scripts/run-python benchmarks/first_hour.py --reuse .ros/env      a clone with this Python environment

Needed: Debian's `rotctld` (libhamlib-utils), and `chromium` for the pictures, which go to runs/first_hour.

    clone    a fresh clone in an empty environment: the lines of the README, size, time; what is refused
    offline  the commands before the first motion, each in one line, with the exit code that is expected
    flight   `track` of one pass on rotctld, with its report
    vendor   a 7-m mount behind topics that takes rates: check_drive, first motion, identify_antenna, tune, a pass
    receiver docs/my_receiver.md in an empty folder: the dish with an RTL-SDR, its dongle simulated, and a pass
    boot     rotctld is off at the boot and comes `--minutes` later; unplugged in a pass; a power cut in another
    page     pictures of the page at 1400 and 390 px, light and dark
"""

import argparse
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from launched_station import MASK_DEG, ROOT, LaunchedStation, executable, say

from rf_pointing.core.dates import parse_utc

PICTURES = ROOT / "runs" / "first_hour"
SETUP_MB, SETUP_S = 450.0, 300.0
HOOK_S, READY_S, BACK_S = 60.0, 30.0, 60.0
UNPLUGGED_S = 60.0
EVERY_S, LEAD_S = 270.0, 45.0
"""From one culmination to the next; the first pass culminates so long after rotctld has come."""
LONGEST_S = 1800.0


class Table:
    """Acceptances: what is wanted of each, what was measured, and the verdict."""

    def __init__(self) -> None:
        self.rows: list[tuple[str, str, str, bool]] = []

    def add(self, what: str, wanted: str, measured: str, good: bool) -> None:
        """Add a row, and print it."""
        self.rows.append((what, wanted, measured.replace("|", "/").replace("\n", "; "), good))
        say(f"{'ok ' if good else 'BAD'} {what}: {measured} (wanted: {wanted})")

    def within(self, what: str, seconds: float, bound_s: float) -> None:
        """Add a time that must be at most `bound_s`."""
        self.add(what, f"<= {bound_s:g} s", f"{seconds:.1f} s", seconds <= bound_s)

    def show(self) -> int:
        """Print all rows as a table; return the exit code."""
        print("\n| acceptance | wanted | measured | |\n|---|---|---|---|")
        for what, wanted, measured, good in self.rows:
            print(f"| {what} | {wanted} | {measured} | {'ok' if good else '**not met**'} |")
        return int(not all(good for *_, good in self.rows))


def readme(section: str) -> list[str]:
    """Return the lines to paste of a section of the README."""
    text = (ROOT / "README.md").read_text().partition(f"## {section}\n")[2].partition("\n## ")[0]
    lines = "\n".join(re.findall(r"```\n(.*?)```", text, re.DOTALL)).splitlines()
    return [line.partition(" # ")[0].strip() for line in lines if line and not line.startswith("#")]


def ask(words: Sequence[str], environment: dict[str, str], folder: Path, patience_s: float = 120.0) -> tuple[int, str]:
    """Run a command to its end; return its exit code and what it said."""
    done = subprocess.run(
        words, env=environment, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=patience_s,
        check=False,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


def answers(port: int, patience_s: float) -> float:
    """Return after how many seconds the page answers, infinite for never."""
    begun_s = time.monotonic()
    while time.monotonic() - begun_s < patience_s:
        with suppress(OSError), urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=5.0) as answer:
            if answer.status == 200:
                return time.monotonic() - begun_s
        time.sleep(0.5)
    return math.inf


# Parts


def clone(table: Table, folder: Path, given: argparse.Namespace) -> None:
    """Paste the README's lines on a computer that has nothing; type some of them wrongly."""
    home, checkout = folder / "home", folder / "rf_pointing"
    home.mkdir()
    # Nothing of this shell: no ROS, no Python environment, no locale, no state.
    environment = {"HOME": str(home), "PATH": "/usr/local/bin:/usr/bin:/bin", "ROS_DOMAIN_ID": "71"}

    def paste(line: str, where: Path) -> tuple[int, str, float]:
        begun_s = time.monotonic()
        code, said = ask(["bash", "-c", line], environment, where, LONGEST_S)
        last = (said.strip().splitlines() or ["-"])[-1][:160]
        took_s = time.monotonic() - begun_s
        table.add(f"`{line}`", "exit 0", f"exit {code} in {took_s:.0f} s: {last}", code == 0)
        return code, said, took_s

    cloned, live, described, own = readme("A live station")
    paste(cloned.replace("<this repository>", str(ROOT)), folder)
    if given.reuse:
        (checkout / ".ros").mkdir()
        (checkout / ".ros" / "env").symlink_to(given.reuse.resolve())
        shutil.copy(given.reuse.resolve().parent / "wheels", checkout / ".ros")
    launch, port = "scripts/launch", 8080
    table.within("set-up and start of the second line", paste(live, checkout)[2], SETUP_S)
    table.within("then a live page", answers(port, 120.0), 60.0)
    if not given.reuse:
        # An environment of developers holds the libraries of the tests.
        megabytes = float(ask(["du", "-sm", ".ros"], environment, checkout)[1].split()[0])
        table.add("size of .ros", f"<= {SETUP_MB:g} MB", f"{megabytes:g} MB", megabytes <= SETUP_MB)
    code, said = ask(["bash", "-c", live], environment, checkout)
    refused = code == 1 and "already runs" in said
    table.add("a second start", "refused by name", f"exit {code}: {said.strip()}", refused)
    code, said, _ = paste(f"{launch} status", checkout)
    wrong = {
        "single_antenna staton:=x": "did you mean station",
        "single_anttena": "did you mean single_antenna",
        "single_antenna station:=no.yaml": "no such file",
        "single_antenna station:=dss13 page:=ja": "must be true or false",
    }
    for words, wanted in wrong.items():
        code, said = ask(["bash", "-c", f"{launch} {words}"], environment, checkout)
        good = code == 1 and wanted in said and said.count("\n") == 1
        table.add(f"`{launch} {words}`", f"one line with '{wanted}'", f"exit {code}: {said.strip()}", good)
    stop = paste(f"{launch} stop", checkout)
    table.within("stop", stop[2] if stop[0] == 0 else math.inf, BACK_S)
    paste(described, checkout)
    paste("scripts/run check_station my_dish.yaml", checkout)
    if paste(own, checkout)[0] == 0:
        table.within("the page of the described station", answers(port, 120.0), 60.0)
        running = paste(f"{launch} status", checkout)[1]
        names = re.findall(r"^  (\w+) +process", running, re.MULTILINE)
        wanted = {"conscan_tracker", "station_executive", "operator_page", "rotctld_server"}
        good = wanted <= set(names) and "monopulse_tracker" not in names
        table.add("nodes of a dish with steptrack", "no monopulse_tracker", ", ".join(names), good)
        paste(f"{launch} stop", checkout)
    logs = list((home / ".local" / "state").rglob("log/*.log"))
    foreign = [path for path in home.rglob("*.log") if path not in logs]
    shown = f"{len(logs)} in {logs[0].parent if logs else '-'}, {len(foreign)} elsewhere"
    table.add("logs", "in one folder", shown, bool(logs) and not foreign)
    pass_, _ = readme("Two commands")
    paste(pass_, checkout)
    reports = list(checkout.glob("runs/*/report.html"))
    table.add("report of the simulated pass", "1", str(len(reports)), len(reports) == 1)


def succeeds(code: int, _said: str) -> bool:
    return code == 0


def offline(table: Table, folder: Path, _given: argparse.Namespace) -> None:
    """Run what a user does before the first motion, on the real rotctld."""
    from launched_station import rotctld

    server, environment = rotctld.RealRotctld(), dict(os.environ)
    example = folder / "hamlib_rotator.yaml"
    text = (ROOT / "examples" / "hamlib_rotator.yaml").read_text()
    example.write_text(text.replace("port: 4533", f"port: {server.port}"))
    topic = folder / "topic.yaml"
    topic.write_text(text[: text.index("drive:")] + "drive: {type: topic, model: rate}\n")
    fillers = folder / "list.txt"
    fillers.write_text("OVERHEAD, priority=5\nSun\nMoon\n")
    from launched_station import over, read_station, tle_lines

    site = read_station(example).site
    one = over.satellite_over(site, time.time() + 3600.0)
    elements = folder / "my.tle"
    elements.write_text("\n".join((one.name, *tle_lines(one))) + "\n")
    lines: dict[str, tuple[list[str], str, Callable[[int, str], bool]]] = {
        "new_station": (
            ["new_station", "--name", "My dish", "--latitude", "52.2", "--longitude", "6.9", "--diameter", "2.4"],
            "exit 0, with steptrack", lambda code, said: code == 0 and "steptrack" in said,
        ),
        "check_station of the example": (["check_station", str(example)], "exit 0", succeeds),
        "check_drive of the example": (["check_drive", "--station", str(example)], "exit 0", succeeds),
        "check_drive --move": (["check_drive", "--station", str(example), "--move"], "exit 0", succeeds),
        "check_drive of a topic drive": (
            ["check_drive", "--station", str(topic), "--namespace", "/gs9"], "names the silent topic",
            lambda code, said: code > 0 and "no message on drive/state" in said,
        ),
        "a plan with fillers": (
            [
                *("plan_passes", "--station", str(example), "--elements", str(elements)),
                *("--satellites", str(fillers), "--hours", "24"),
            ],
            "exit 0, with the Sun",
            lambda code, said: code == 0 and "Sun" in said,
        ),
    }  # fmt: skip
    for what, (words, wanted, good) in lines.items():
        begun_s = time.monotonic()
        code, said = ask([executable(words[0]), *words[1:]], environment, folder, 400.0)
        last = (said.strip().splitlines() or ["-"])[-1]
        took_s = time.monotonic() - begun_s
        table.add(what, wanted, f"exit {code} in {took_s:.0f} s: {last[:160]}", good(code, said))
    server.kill()


def flight(table: Table, folder: Path, _given: argparse.Namespace) -> None:
    """Fly a pass with `track` on the real rotctld, as docs/own_antenna.md shows it."""
    from launched_station import over, read_station, rotctld

    server = rotctld.RealRotctld()
    station = over.write_station(folder, server.port)
    text = station.read_text()
    station.write_text(text.replace("mount:\n", f"mount:\n  pass_elevation_deg: {MASK_DEG}\n"))
    elements = over.write_elements(folder, read_station(station).site, time.time() + 150.0)
    words = ["track", "--station", str(station), "--elements", str(elements), "--satellite", "OVERHEAD"]
    words += ["--sensor", "program", "--output", str(folder / "flight")]
    try:
        code, said = ask([executable("track"), *words[1:]], dict(os.environ), folder, LONGEST_S)
    finally:
        server.kill()
    last = (said.strip().splitlines() or ["-"])[-1][:160]
    table.add("`track` of one pass on rotctld", "exit 0", f"exit {code}: {last}", code == 0)
    add_held(table, folder)


VENDOR = """version: 1
name: Vendor's 7 m
site: {{latitude_deg: 52.2, longitude_deg: 6.9, height_m: 60.0}}
dish: {{diameter_m: {vendor.DISH_M}}}
mount:
  azimuth: {{travel_deg: {azimuth}, {axis}}}
  elevation: {{travel_deg: {elevation}, {axis}}}
wind: {{anemometer: false}}
bands: {{X: {{frequency_mhz: 8200.0, sensors: []}}}}
drive: {{type: topic, model: rate, rotator: {{latency_s: 0.06}}, link: {{poll_period_s: 0.02}}}}
"""


def vendor(table: Table, folder: Path, _given: argparse.Namespace) -> None:
    """Bring a vendor's mount with rate inputs to a flown pass, as docs/own_antenna.md orders it."""
    import vendor_antenna
    from launched_station import over, read_station

    axis = (
        f"rate_deg_s: {vendor_antenna.RATE_DEG_S}, acceleration_deg_s2: {vendor_antenna.ACCELERATION_DEG_S2}, "
        f"encoder_bits: {vendor_antenna.BITS}"
    )
    travels = {
        "azimuth": list(vendor_antenna.AZIMUTH_TRAVEL_DEG), "elevation": list(vendor_antenna.ELEVATION_TRAVEL_DEG)
    }  # fmt: skip
    station = folder / "vendor.yaml"
    station.write_text(VENDOR.format(vendor=vendor_antenna, axis=axis, **travels))
    environment = dict(os.environ) | {"ROS_DOMAIN_ID": "72", "HOME": str(folder)}
    namespace, launch = "/gs1", str(ROOT / "scripts" / "launch")

    def run(what: str, *words: str, patience_s: float = 400.0) -> tuple[int, str]:
        begun_s = time.monotonic()
        code, said = ask(words, environment, folder, patience_s)
        last = (said.strip().splitlines() or ["-"])[-1]
        table.add(what, "exit 0", f"exit {code} in {time.monotonic() - begun_s:.0f} s: {last[:160]}", code == 0)
        return code, said

    def launched() -> None:
        run("launch of the vendor's station", launch, "single_antenna", f"station:={station}", "--detach")

    _, said = run("check_station", executable("check_station"), str(station))
    table.add("first loops", "shown with their formula", *shown_loops(said))
    words = [sys.executable, str(ROOT / "benchmarks" / "vendor_antenna.py"), "--ros-args", "-r", f"__ns:={namespace}"]
    antenna = subprocess.Popen(words, env=environment, cwd=folder)
    named = ("--station", str(station), "--namespace", namespace)
    try:
        run("check_drive --move", executable("check_drive"), *named, "--move")
        launched()
        run(
            "identify_antenna --quick, both axes", executable("identify_antenna"), *named, "--quick",
            "--output", str(folder / "identified"), patience_s=900.0,
        )  # fmt: skip
        run("tune", executable("tune"), str(folder / "identified" / "models.json"), "--station", str(station))
        run("stop", launch, "stop")
        station.write_text(station.read_text() + (folder / "runs" / "tuning" / "loops.yaml").read_text())
        run("check_station with the pasted block", executable("check_station"), str(station))
        # Overhead as seen from 3 deg farther east: at its rates the mount cannot follow through the zenith.
        site = read_station(station).site
        elements = over.write_elements(
            folder, replace(site, longitude_rad=site.longitude_rad + 0.05), time.time() + 400.0
        )
        words = [executable("track"), "--station", str(station), "--elements", str(elements), "--satellite", "OVERHEAD"]
        run("`track` of one pass", *words, "--sensor", "program", "--output", str(folder / "flight"), patience_s=900.0)
    finally:
        ask([launch, "stop"], environment, folder)
        antenna.kill()
        antenna.wait()
    add_held(table, folder)


def shown_loops(said: str) -> tuple[str, bool]:
    """Return the line of check_station with the loops of the azimuth, and whether it is there."""
    line = next((line.strip() for line in said.splitlines() if "k_p" in line), "-")
    return line[:160], line != "-"


def receiver(table: Table, folder: Path, _given: argparse.Namespace) -> None:
    """Paste what docs/my_receiver.md shows first; the pass is flown above 45 deg only."""
    from launched_station import over, read_station, tle_lines

    text = (ROOT / "docs" / "my_receiver.md").read_text()
    station = folder / "my_dish.yaml"
    station.write_text(re.findall(r"```\n(.*?)```", text, re.DOTALL)[0])
    one = replace(over.satellite_over(read_station(station).site, time.time()), catalogue_number=25544)
    (folder / "my.tle").write_text("\n".join((one.name, *tle_lines(one))) + "\n")
    for line in re.findall(r"^    (scripts/(?:run check_station|track) .*my_dish.yaml.*)$", text, re.MULTILINE):
        more = " --mask 45 --output flight" if "track" in line else ""
        begun_s = time.monotonic()
        code, said = ask(["bash", "-c", f"{ROOT}/{line}{more}"], dict(os.environ), folder, LONGEST_S)
        last = (said.strip().splitlines() or ["-"])[-1]
        table.add(f"`{line}`", "exit 0", f"exit {code} in {time.monotonic() - begun_s:.0f} s: {last[:160]}", code == 0)
    add_held(table, folder)


def add_held(table: Table, folder: Path) -> None:
    """Add the share of the pass of `folder` that was held."""
    summary = folder / "flight" / "summary.json"
    outcome = json.loads(summary.read_text())["outcome"] if summary.exists() else {}
    held = float((outcome.get("counted") or {}).get("held_percent", 0.0))
    table.add("held in it", ">= 95 %", f"{held:.1f} %", held >= 95.0)


def boot(table: Table, folder: Path, given: argparse.Namespace) -> None:
    """One run in wall time: rotctld comes late, is unplugged in a pass, and everything is killed in another."""
    began_s = time.time()
    comes_s = began_s + 60.0 * given.minutes
    culminations = [comes_s + LEAD_S + EVERY_S * k for k in range(3)]
    station = LaunchedStation(folder, culminations, rotctld_on=False, words=("page:=true", "rotctld:=true"))
    try:
        station.until(lambda: station.executive.state, 120.0)
        client = station.queue()
        station.until(lambda: station.executive.state == "running", 120.0)
        queued_s = time.monotonic()
        told = station.until(lambda: station.told(), max(120.0, comes_s - time.time()))
        table.within("rotctld off at the boot: the hook after the queue", told, HOOK_S)
        say(f"{time.monotonic() - queued_s:.0f} s after the queue: {[each['alarm'] for each in station.told()]}")
        station.until(lambda: time.time() >= comes_s, comes_s - time.time() + 10.0)
        table.add("ended while it waited", "0 nodes", f"{restarts(station)}", restarts(station) == 0)
        station.relay.set("pass")
        ready_s = station.until(lambda: station.antenna.mode not in ("", "inactive") and station.fresh(), 300.0)
        table.within(f"rotctld comes after {given.minutes:g} min: the antenna is ready", ready_s, READY_S)
        joined_s = station.until(lambda: station.tracking.held and station.tracking.target, 200.0)
        said = f"held {joined_s:.0f} s after that"
        table.add("the pass in progress", "is joined", said, math.isfinite(joined_s))
        unplug(table, station, culminations[1])
        power_cut(table, station, culminations[2])
        station.until(lambda: client.poll() is not None or station.executive.state == "idle", EVERY_S)
        passes = station.report().get("passes", [])
        shown = "; ".join(f"{row['id']} {row['state']} {row['tracked_s']:.0f} s" for row in passes)
        count = len(culminations)
        table.add("passes in the morning report", str(count), shown or "-", len(passes) == count)
        table.add("Ctrl-C", "exit 0", f"exit {(code := station.stop())}", code == 0)
    finally:
        station.close()


def restarts(station: LaunchedStation) -> int:
    """Return how often a node was started again."""
    return sum(each["starts"] - 1 for each in station.state()["processes"].values())


def unplug(table: Table, station: LaunchedStation, culmination_s: float) -> None:
    """Unplug the drive for a minute in a pass."""
    station.until(lambda: time.time() >= culmination_s - 65.0, EVERY_S)
    before, began_s = restarts(station), time.time()
    say(f"unplugged: {station.antenna.mode}, {station.tracking.mode}, held {station.tracking.held}")
    station.relay.set("cut")
    station.spin(UNPLUGGED_S)
    station.relay.set("pass")
    held_s = station.until(lambda: station.tracking.held, 60.0)
    station.spin(5.0)
    raised = [
        each["alarm"] for each in station.told() if each["event"] == "raised" and parse_utc(each["utc"]) > began_s
    ]
    ended = restarts(station) - before
    table.add("unplugged for 60 s in a pass: nodes that end", "0", str(ended), ended == 0)
    table.add("alarms of that", "lost_drive", ", ".join(raised) or "-", raised == ["lost_drive"])
    table.within("plugged in: held again", held_s, BACK_S)


def power_cut(table: Table, station: LaunchedStation, culmination_s: float) -> None:
    """Kill launcher and nodes in a pass, and start the launcher again as the unit of systemd does."""
    station.until(lambda: time.time() >= culmination_s - 50.0, EVERY_S)
    say(f"power cut: {station.antenna.mode}, {station.tracking.mode}, held {station.tracking.held}")
    station.kill_all()
    station.spin(2.0)
    station.launch()
    begun_s = station.tracking.sequence
    back_s = station.until(lambda: station.tracking.sequence < begun_s and station.tracking.held, 150.0)
    table.within("kill -9 of everything in a pass: held again without a hand", back_s, BACK_S)


def photograph(table: Table, port: int, wait: Callable[[float], object]) -> None:
    """Take pictures of the whole page at both widths, in light and dark."""
    from selenium import webdriver

    PICTURES.mkdir(parents=True, exist_ok=True)
    options = webdriver.ChromeOptions()
    options.binary_location = str(shutil.which("chromium"))
    for word in ("headless=new", "no-sandbox", "disable-dev-shm-usage", "disable-gpu", "hide-scrollbars"):
        options.add_argument(f"--{word}")
    browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    try:
        for theme, width in ((theme, width) for theme in ("light", "dark") for width in (1400, 390)):
            features = [{"name": "prefers-color-scheme", "value": theme}]
            browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
            size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
            browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            browser.get(f"http://127.0.0.1:{port}/")
            wait(8.0)
            script = "const e = document.documentElement; return [e.scrollWidth, e.scrollHeight]"
            wide, high = browser.execute_script(script)
            browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size | {"height": high})
            wait(2.0)
            browser.save_screenshot(str(PICTURES / f"page-{width}-{theme}.png"))
            table.add(f"width of the page, {theme}", f"<= {width} px", f"{wide} px", wide <= width)
    finally:
        browser.quit()


def page(table: Table, folder: Path, _given: argparse.Namespace) -> None:
    """Take pictures of the page in a pass."""
    if not (shutil.which("chromium") and shutil.which("chromedriver")):
        table.add("pictures of the page", "four", "no chromium here", False)
        return
    culmination_s = time.time() + 120.0
    station = LaunchedStation(folder, [culmination_s, culmination_s + EVERY_S], words=("page:=true",))
    try:
        table.within("the page is live", answers(station.page_port, 120.0), 60.0)
        # The station's own receiver, which this program plays, is alive.
        station.own_silent = False
        station.until(station.fresh, 120.0)
        station.queue()
        station.until(lambda: station.tracking.held, 150.0)
        photograph(table, station.page_port, station.spin)
    finally:
        station.close()


PARTS = {
    "clone": clone, "offline": offline, "flight": flight, "vendor": vendor, "receiver": receiver, "boot": boot,
    "page": page,
}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument(
        "--minutes", type=float, default=10.0, help="rotctld comes so long after the boot (default: 10)"
    )
    parser.add_argument("--reuse", type=Path, help="Python environment of the clone, instead of a new one")
    parser.add_argument("--folder", type=Path, help="where everything is kept (default: a temporary folder)")
    given = parser.parse_args()
    table = Table()
    for name in given.only:
        folder = Path(tempfile.mkdtemp(prefix=f"first-{name}-", dir=given.folder))
        say(f"{name}: {folder}")
        try:
            PARTS[name](table, folder, given)
        except (OSError, RuntimeError, AssertionError, subprocess.SubprocessError) as error:
            table.add(name, "comes to its end", f"{type(error).__name__}: {error}", False)
    sys.exit(table.show())


if __name__ == "__main__":
    main()
