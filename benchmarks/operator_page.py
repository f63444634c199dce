"""Measure the operator's page: processor time with viewers, frames that they get, and how soon a stop is answered.

    scripts/run-python benchmarks/operator_page.py [--seconds 20] [--viewers 0 3 20] [--stops 100]

A pass of the 3.7-m dish is tracked in real time by the executable `track` in a ROS domain of its own, and the page runs in
its namespace.  Processor time is that of the page's process by the accounting of the kernel.  Prints a Markdown table.
"""

import argparse
import asyncio
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import requests
from aiohttp import ClientError, ClientSession
from ament_index_python.packages import get_package_prefix

TICKS_PER_S = os.sysconf("SC_CLK_TCK")
NAMESPACE = "/page_benchmark"
TOKEN = "token-of-the-benchmark"
PORT = 18765
URL = f"http://127.0.0.1:{PORT}"
START_S = 180.0
Row = tuple[str, str]


def executable(name: str) -> str:
    return str(Path(get_package_prefix("rf_pointing")) / "lib" / "rf_pointing" / name)


def cpu_s(process: int) -> float:
    """Return the processor time that a process has used, its threads included."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


async def view(process: int, viewers: int, duration_s: float) -> Row:
    """Return the processor time of the page with so many viewers, and the frames that the slowest gets."""

    async def read(session: ClientSession) -> int:
        frames = 0
        async with session.ws_connect(f"{URL}/live") as socket:
            await socket.receive()
            await started.wait()
            while time.monotonic() < end_s[0]:
                frames += '"live"' in (await socket.receive_str())
        return frames

    started, end_s = asyncio.Event(), [0.0]
    async with ClientSession() as session:
        readers = [asyncio.ensure_future(read(session)) for _ in range(viewers)]
        await asyncio.sleep(3.0)
        end_s[0], before_s, began_s = time.monotonic() + duration_s, cpu_s(process), time.monotonic()
        started.set()
        await asyncio.sleep(duration_s)
        share = (cpu_s(process) - before_s) / (time.monotonic() - began_s)
        frames = await asyncio.gather(*readers)
    rate = f", {min(frames) / duration_s:.1f} frames/s for the slowest" if frames else ""
    return f"{viewers} viewers", f"{100.0 * share:.1f} % of one core{rate}"


def stops(count: int) -> Row:
    """Return how soon a stop of the antenna is answered."""
    times_ms = []
    session = requests.Session()
    for _ in range(count):
        began_s = time.monotonic()
        answer = session.post(
            f"{URL}/command", json={"name": "stop_antenna"}, headers={"Authorization": f"Bearer {TOKEN}"}, timeout=10.0
        ).json()
        times_ms.append(1e3 * (time.monotonic() - began_s))
        if not answer["accepted"]:
            sys.exit(f"the stop was refused: {answer['message']}")
        time.sleep(0.05)
    p99 = sorted(times_ms)[int(0.99 * (count - 1))]
    found = f"median {statistics.median(times_ms):.0f} ms, p99 {p99:.0f} ms, longest {max(times_ms):.0f} ms"
    return f"{count} stops answered", found


async def wait_for_station(page: "subprocess.Popen[bytes]", station: "subprocess.Popen[bytes]") -> None:
    """Wait until the page shows an antenna that moves."""
    deadline_s = time.monotonic() + START_S
    async with ClientSession() as session:
        while time.monotonic() < deadline_s:
            if page.poll() is not None or station.poll() is not None:
                sys.exit("a process has ended")
            try:
                async with session.ws_connect(f"{URL}/live") as socket:
                    while time.monotonic() < deadline_s:
                        live = json.loads(await socket.receive_str()).get("live", {})
                        if live.get("antenna") == "tracking" and live["age_s"]["antenna"] < 1.0:
                            return
            except ClientError:
                await asyncio.sleep(0.2)
    sys.exit(f"no tracking antenna within {START_S:.0f} s")


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="of each measurement (default: 20)")
    parser.add_argument("--viewers", type=int, nargs="+", default=[0, 3, 20])
    parser.add_argument("--stops", type=int, default=100)
    options = parser.parse_args()
    os.environ.setdefault("ROS_DOMAIN_ID", "99")
    with tempfile.TemporaryDirectory(prefix="page-benchmark-") as folder:
        token = Path(folder) / "token"
        token.write_text(TOKEN)
        token.chmod(0o600)
        quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        station = subprocess.Popen(
            [executable("track"), "--models", "", "--station", "leo_3m7", "--speed", "1", "--namespace", NAMESPACE,
             "--output", folder],
            **quiet,
        )  # fmt: skip
        page = subprocess.Popen(
            [executable("operator_page"), "--ros-args", "-r", f"__ns:={NAMESPACE}", "-p", f"page.port:={PORT}",
             "-p", f"page.token_file:={token}"],
            **quiet,
        )  # fmt: skip
        try:
            asyncio.run(wait_for_station(page, station))
            rows = [asyncio.run(view(page.pid, count, options.seconds)) for count in options.viewers]
            rows.append(stops(options.stops))
        finally:
            for process in (page, station):
                process.send_signal(signal.SIGINT)
            for process in (page, station):
                process.wait(60.0)
    print("| quantity | measured |\n|---|---|")
    for name, value in rows:
        print(f"| {name} | {value} |")


if __name__ == "__main__":
    main()
