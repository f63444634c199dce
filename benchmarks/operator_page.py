"""Measure the operator's page: processor time with viewers, frames that they get, and how soon a stop is answered.

    scripts/run-python benchmarks/operator_page.py [--seconds 20] [--viewers 0 3 20] [--stops 100]

The 3.7-m dish follows a pass in real time, in a ROS domain of its own.  Processor time is that of the page's process
by the accounting of the kernel.  Prints a Markdown table.
"""

import argparse
import asyncio
import json
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import requests
import yaml
from aiohttp import ClientError, ClientSession

from rf_pointing.ros.graph import NODES
from rf_pointing.ros.managed_graph import NodeProcesses

TICKS_PER_S = os.sysconf("SC_CLK_TCK")
NAMESPACE = "/page_benchmark"
TOKEN = "token-of-the-benchmark"
PORT = 18765
URL = f"http://127.0.0.1:{PORT}"
START_S = 120.0
STATION = "leo_3m7"
PASS_S = 1151384173.0
"""Where the shipped elements have a pass soon."""
Row = tuple[str, str]


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


def post(name: str, **arguments: Any) -> dict[str, Any]:
    """Send a command and return its answer."""
    headers = {"Authorization": f"Bearer {TOKEN}"}
    found = requests.post(f"{URL}/command", json={"name": name, "arguments": arguments}, headers=headers, timeout=10.0)
    answer: dict[str, Any] = found.json()
    return answer


def stops(count: int) -> Row:
    """Return how soon a stop of the antenna is answered."""
    times_ms = []
    for _ in range(count):
        began_s = time.monotonic()
        answer = post("stop_antenna")
        times_ms.append(1e3 * (time.monotonic() - began_s))
        if not answer["accepted"]:
            sys.exit(f"the stop was refused: {answer['message']}")
        time.sleep(0.05)
    p99 = sorted(times_ms)[int(0.99 * (count - 1))]
    found = f"median {statistics.median(times_ms):.0f} ms, p99 {p99:.0f} ms, longest {max(times_ms):.0f} ms"
    return f"{count} stops answered", found


async def begin_pass() -> None:
    """Wait for a coming pass, track it by the page, and wait until the antenna follows."""
    shown: dict[str, Any] = {}
    deadline_s = time.monotonic() + START_S
    async with ClientSession() as session:
        while time.monotonic() < deadline_s:
            try:
                async with session.ws_connect(f"{URL}/live") as socket:
                    while time.monotonic() < deadline_s:
                        shown |= json.loads(await asyncio.wait_for(socket.receive_str(), 5.0))
                        if shown["live"].get("antenna") == "tracking":
                            return
                        if shown["live"].get("tracking") == "idle" and shown.get("passes"):
                            post("track", aos_utc=shown["passes"]["rows"][0]["aos_utc"])
                            await asyncio.sleep(1.0)
            except (ClientError, TimeoutError):
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
        given = {f"/**/{name}": {"ros__parameters": {"station": STATION}} for name in NODES[1:]}
        given["/**/simulation_clock"] = {"ros__parameters": {"start_s": PASS_S, "speed": 1.0}}
        given["/**/operator_page"] = {"ros__parameters": {"page": {"port": PORT, "token_file": str(token)}}}
        parameters = Path(folder) / "parameters.yaml"
        parameters.write_text(yaml.safe_dump(given))
        processes = NodeProcesses(NAMESPACE, [parameters], Path(folder))
        try:
            processes.start(NODES, autostart=True)
            processes.start(["operator_page"], simulated_time=False)
            asyncio.run(begin_pass())
            page = processes.process_id("operator_page")
            rows = [asyncio.run(view(page, count, options.seconds)) for count in options.viewers]
            rows.append(stops(options.stops))
        finally:
            processes.stop()
    print("| quantity | measured |\n|---|---|")
    for name, value in rows:
        print(f"| {name} | {value} |")


if __name__ == "__main__":
    main()
