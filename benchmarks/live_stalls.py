"""Stall, kill and cut off every node of a live pass in wall time, and print what each costs of it.

    scripts/run-python benchmarks/live_stalls.py [--nodes NAME ...] [--cases 1 2 5 10 kill loss]

A number is a stall in s (SIGSTOP), `kill` a crash (SIGKILL) with the restart of a launch file,
`kill10` one with the restart 10 s later, `loss` 20 % of all datagrams of all nodes for 30 s, which
a library between the nodes and the kernel drops.  Lost is the time in which the beam is really more
than half its width from the satellite, from the simulation's truth.  It must be at most the outage
and 5 s.
"""

import argparse
import dataclasses
import json
import math
import os
import signal
import struct
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.action import ActionClient
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import Boresight, TrackingStatus

from rf_pointing.core import angular_distance_rad
from rf_pointing.core.pass_outcome import PassOutcome
from rf_pointing.ephemeris import (
    Pass,
    TopocentricTrack,
    find_elements,
    find_passes,
    sun,
    tle_lines,
    verification_elements,
)
from rf_pointing.ephemeris.source import load_track
from rf_pointing.ros.main_loop import make_executor
from rf_pointing.ros.managed_graph import NodeProcesses
from rf_pointing.ros.qos import SAMPLES, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.station.description import read_station

STATION, SATELLITE, NAMESPACE = "leo_3m7", "FLYER", "/stalls"
NODES = (
    "ephemeris_publisher",
    "pointing_controller",
    "antenna_servo",
    "rf_receiver",
    "conscan_tracker",
    "bias_calibrator",
)
CASES = ("1", "2", "5", "10", "kill", "loss")
INTO_PASS_S = 120.0
"""Of the pass that is gone when the nodes start."""
EARTH_RAD_S = 7.292115e-5
SUN_RAD = math.radians(10.0)
"""The Sun moves 4 deg along the pass while the nodes are stopped one after the other."""
SPARE_S = 5.0
LOSS, LOSS_S = 0.2, 30.0
BEFORE_S, AFTER_S = 5.0, 8.0
"""For which the target must be held before and after an outage."""
STEP_S = 0.02
RESPAWN_DELAY_S = 0.5
"""As in the launch files."""
PATIENCE_S = 200.0
ANSWER_S = 5.0
"""After which a goal without an answer is sent again."""
SHIM = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
/* Of the datagrams: lost, damaged; s by which the clock is ahead; sent a second time, damaged and of a stranger. */
static volatile double *share;
static void shift(struct timespec *time, double seconds) {
  double whole = floor(seconds);
  time->tv_sec += (time_t)whole;
  time->tv_nsec += (long)(1e9 * (seconds - whole));
  if (time->tv_nsec >= 1000000000L) time->tv_nsec -= 1000000000L, time->tv_sec++;
}
/* Ends of waits are times of the clock that is ahead, and the kernel has another. */
static struct timespec kernel_time(const struct timespec *end) {
  struct timespec found = *end;
  if (share && end->tv_sec > 1000000000L) shift(&found, -share[2]);
  return found;
}
#define REAL(name) static __typeof__(name) *real; if (!real) real = (__typeof__(name) *)dlsym(RTLD_NEXT, #name)
__attribute__((constructor)) static void begin(void) {
  int file = open(getenv("DATAGRAM_LOSS"), O_RDONLY);
  share = mmap(0, 4 * sizeof(double), PROT_READ, MAP_SHARED, file, 0);
  srand48(getpid());
}
static int chosen(int file, double part) {
  int type = 0;
  socklen_t size = sizeof type;
  return part > 0.0 && !getsockopt(file, SOL_SOCKET, SO_TYPE, &type, &size) && type == SOCK_DGRAM && drand48() < part;
}
/* Bytes 8 to 19 of a datagram of RTPS say whose it is. */
static ssize_t damaged(int file, const void *data, size_t size, int flags, const struct sockaddr *to, socklen_t length,
                       int strange) {
  REAL(sendto);
  char copy[65536];
  memcpy(copy, data, size);
  for (size_t byte = 8; strange && byte < 20 && byte < size; byte++) copy[byte] = (char)lrand48();
  for (int count = 1 + lrand48() % 8; count && size; count--) copy[lrand48() % size] = (char)lrand48();
  return real(file, copy, lrand48() % 4 ? size : lrand48() % size, flags, to, length) < 0 ? -1 : (ssize_t)size;
}
ssize_t sendto(int file, const void *data, size_t size, int flags, const struct sockaddr *to, socklen_t length) {
  REAL(sendto);
  if (chosen(file, share[0])) return (ssize_t)size;
  if (chosen(file, share[3])) damaged(file, data, size, flags, to, length, 1);
  return chosen(file, share[1]) ? damaged(file, data, size, flags, to, length, 0) : real(file, data, size, flags, to, length);
}
ssize_t sendmsg(int file, const struct msghdr *message, int flags) {
  REAL(sendmsg);
  ssize_t size = 0;
  int lost = chosen(file, share[0]), copied = chosen(file, share[3]), spoilt = chosen(file, share[1]);
  if (!lost && !copied && !spoilt) return real(file, message, flags);
  char whole[65536];
  for (size_t part = 0; part < message->msg_iovlen; part++) {
    memcpy(whole + size, message->msg_iov[part].iov_base, message->msg_iov[part].iov_len);
    size += message->msg_iov[part].iov_len;
  }
  if (lost) return size;
  if (copied) damaged(file, whole, size, flags, message->msg_name, message->msg_namelen, 1);
  return spoilt ? damaged(file, whole, size, flags, message->msg_name, message->msg_namelen, 0) : real(file, message, flags);
}
int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex, const struct timespec *end) {
  static __typeof__(pthread_cond_timedwait) *real;
  if (!real) real = (__typeof__(pthread_cond_timedwait) *)dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
  if (!real) real = (__typeof__(pthread_cond_timedwait) *)dlsym(RTLD_NEXT, "pthread_cond_timedwait");
  struct timespec then = kernel_time(end);
  return real(condition, mutex, &then);
}
int sem_timedwait(sem_t *semaphore, const struct timespec *end) {
  REAL(sem_timedwait);
  struct timespec then = kernel_time(end);
  return real(semaphore, &then);
}
int clock_gettime(clockid_t clock, struct timespec *now) {
  REAL(clock_gettime);
  int failed = real(clock, now);
  if (clock == CLOCK_REALTIME && share && share[2] != 0.0) shift(now, share[2]);
  return failed;
}
"""


@dataclass(frozen=True)
class Outage:
    """What one outage has cost; `ended` says why the pass ended in it, "" if it went on."""

    node: str
    case: str
    outage_s: float
    lost_s: float
    ended: str

    @property
    def allowed_s(self) -> float:
        """The outage and what it may cost beyond itself."""
        return self.outage_s + SPARE_S


def rising_earlier(now_s: float) -> Any:
    """Return elements of a satellite whose pass over the station began INTO_PASS_S ago."""
    found = dataclasses.replace(find_elements(verification_elements(), "28057"), epoch_t_s=now_s)
    site = read_station(STATION).site
    track, solar = TopocentricTrack(found, site), TopocentricTrack(sun(), site).target_at(now_s)

    def worth(window: Pass) -> float:
        """Return the highest elevation, 0 for a pass through the zenith or by the Sun: they are other questions."""
        over = track.sample(np.arange(window.aos_t_s, window.los_t_s, 2.0))
        apart = angular_distance_rad(over.azimuth_rad, over.elevation_rad, solar.azimuth_rad, solar.elevation_rad)
        through = window.peak_elevation_rad >= 1.3 or float(np.min(apart)) < SUN_RAD
        return 0.0 if through else window.peak_elevation_rad

    window = max(find_passes(track, now_s, 86400.0, math.radians(5.0)), key=worth)
    earlier_s = window.aos_t_s - (now_s - INTO_PASS_S)
    # The same motion over the turning Earth, so much earlier.
    node_rad = (found.ascending_node_rad - EARTH_RAD_S * earlier_s) % (2.0 * math.pi)
    epoch_s = found.epoch_t_s - earlier_s
    return dataclasses.replace(
        found, name=SATELLITE, catalogue_number=90001, epoch_t_s=epoch_s, ascending_node_rad=node_rad
    )


class LivePass:
    """A station in the middle of a pass, whose goal is sent again whenever it has ended."""

    def __init__(self, folder: Path, domain: int | None = None, sensor: str = "") -> None:
        self._goal = TrackPass.Goal(satellite=SATELLITE, sensor=sensor)
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = rclpy.create_node("probe", namespace=NAMESPACE, context=self._context)
        self._executor = make_executor(self._context)
        self._executor.add_node(self.node)
        self.status, self._held_s, self._states = TrackingStatus(), math.inf, dict[str, float]()
        self.beam: list[tuple[float, float, float]] = []
        self._client, self._result, self.ended = ActionClient(self.node, TrackPass, "track_pass"), None, list[str]()
        self._sent: Any = None
        self._sent_s = math.inf
        make = self.node.create_subscription
        make(TrackingStatus, "tracking_status", self._on_status, STREAM)
        make(Boresight, "sim/boresight", self._on_beam, SAMPLES)
        make(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        elements = folder / "flyer.tle"
        elements.write_text("\n".join((SATELLITE, *tle_lines(rising_earlier(time.time())))) + "\n")
        source = {"source.elements": str(elements), "source.satellite": SATELLITE}
        station = read_station(STATION)
        receiver = station.sets("rf_receiver")
        truth = receiver["source"].replace(elements=str(elements), satellite=SATELLITE)
        self._truth = load_track(truth)
        self._width_rad = receiver["signal"].beam.half_power_beamwidth_rad
        there = self._truth.target_at(time.time() + 15.0)
        key = {"command_key_file": str(folder / "command.key")}
        start = {
            "antenna.start_azimuth_deg": math.degrees(math.remainder(there.azimuth_rad, 2.0 * math.pi)),
            "antenna.start_elevation_deg": math.degrees(there.elevation_rad),
            "state_file": str(folder / "antenna.json"), "wrap_file": str(folder / "turn.json"),
        }  # fmt: skip
        given = {
            "/**": {"station": STATION}, "/**/rf_receiver": source,
            "/**/ephemeris_publisher": source | {"publisher.span_s": 3600.0},
            "/**/pointing_controller": key, "/**/antenna_servo": key | start,
        }  # fmt: skip
        parameters = folder / "parameters.yaml"
        parameters.write_text(json.dumps({name: {"ros__parameters": each} for name, each in given.items()}))
        self._share = folder / "loss"
        self.lose(0.0)
        lossy = {"LD_PRELOAD": str(built(folder)), "DATAGRAM_LOSS": str(self._share)}
        os.environ |= lossy
        try:
            self.processes = NodeProcesses(NAMESPACE, [parameters], folder / "logs")
            self.processes.start(NODES, simulated_time=False, autostart=True)
        finally:
            for name in lossy:
                os.environ.pop(name)
        self._environment = lossy

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.processes.stop()
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    def outage(self, node: str, case: str) -> Outage:
        """Bring an outage about in a held pass, wait until the target is held again, and return its cost."""
        self.until(lambda: time.time() - self._held_s > BEFORE_S, f"a target held for {BEFORE_S:.0f} s")
        self.ended.clear()
        begun_s = time.time()
        bring_about = self._cut if case == "loss" else self._kill if case.startswith("kill") else self._stall
        outage_s = bring_about(node, case)
        over_s = begun_s + outage_s
        self._held_s = math.inf
        self.until(lambda: time.time() - max(self._held_s, over_s) > AFTER_S, f"{node}, {case}: a held target")
        # A loss lasts as long as it costs nothing by itself.
        outage_s = 0.0 if case == "loss" else outage_s
        return Outage(node, case, outage_s, self.lost_s(begun_s, time.time() - 1.0), "; ".join(self.ended))

    def lost_s(self, begin_s: float, end_s: float) -> float:
        """Return how long the beam was off the satellite; while nothing is known of it, it stands."""
        known = np.array(self.beam)
        times = np.arange(begin_s, end_s, STEP_S)
        newest = np.searchsorted(known[:, 0], times, side="right") - 1
        truth = [self._truth.target_at(float(t_s)) for t_s in times]
        error = angular_distance_rad(
            known[newest, 1], known[newest, 2],
            np.array([each.azimuth_rad for each in truth]), np.array([each.elevation_rad for each in truth]),
        )  # fmt: skip
        return PassOutcome.of(error, self._width_rad, STEP_S).lost_s

    def _stall(self, node: str, case: str) -> float:
        process, stall_s = self.processes.process_id(node), float(case)
        begun_s = time.time()
        os.kill(process, signal.SIGSTOP)
        try:
            self.until(lambda: time.time() - begun_s >= stall_s, "the end of the stall")
        finally:
            os.kill(process, signal.SIGCONT)
        return time.time() - begun_s

    def _kill(self, node: str, case: str) -> float:
        """Return the time until the new process is active."""
        begun_s, delay_s = time.time(), float(case.removeprefix("kill") or RESPAWN_DELAY_S)
        os.kill(self.processes.process_id(node), signal.SIGKILL)
        self.until(lambda: node in self.processes.ended(), "its end")
        self.until(lambda: time.time() - begun_s >= delay_s, "the delay")
        self._states.pop(node, None)
        os.environ |= self._environment
        self.processes.start([node], simulated_time=False, autostart=True)
        for name in self._environment:
            os.environ.pop(name)
        self.until(lambda: self._states.get(node, 0.0) > begun_s + delay_s, f"{node} again")
        return time.time() - begun_s

    def _cut(self, _node: str, _case: str) -> float:
        begun_s = time.time()
        self.lose(LOSS)
        try:
            self.until(lambda: time.time() - begun_s >= LOSS_S, "the loss")
        finally:
            self.lose(0.0)
        return time.time() - begun_s

    def lose(self, share: float) -> None:
        """Drop this share of what the nodes send from now on."""
        with self._share.open("r+b" if self._share.exists() else "wb") as file:
            file.write(struct.pack("3d", share, 0.0, 0.0))

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait for a condition while the goal is kept; TimeoutError with the state of the pass."""
        end_s = time.monotonic() + PATIENCE_S
        while not condition():
            if time.monotonic() > end_s:
                state = self.status
                raise TimeoutError(
                    f"{what}: not within {PATIENCE_S:.0f} s: {state.mode}, {state.reason}, {state.alarm}"
                )
            self._keep_goal()
            self._executor.spin_once(timeout_sec=0.02)

    def _keep_goal(self) -> None:
        """Send the goal of the pass, and again when it has ended or its server was killed."""
        if self._result is not None and self._result.done():
            self.ended.append(self._result.result().result.message)
            self._result = self._sent = None
        lost = "pointing_controller" in self.processes.ended()
        if lost and (self._sent or self._result):
            self.ended.append("the controller was killed")
            self._result = self._sent = None
        if self._sent is not None and not self._sent.done() and time.monotonic() - self._sent_s > ANSWER_S:
            # A request that a new server did not receive yet is never answered.
            self._sent = None
        if self._sent is not None and self._sent.done():
            handle, self._sent = self._sent.result(), None
            self._result = handle.get_result_async() if handle.accepted else None
        active = "pointing_controller" in self._states
        if self._result is None and self._sent is None and active and not lost and self._client.server_is_ready():
            self._sent, self._sent_s = self._client.send_goal_async(self._goal), time.monotonic()

    def _on_status(self, message: TrackingStatus) -> None:
        self.status = message
        if not message.held:
            self._held_s = math.inf
        elif self._held_s == math.inf:
            self._held_s = time.time()

    def _on_beam(self, message: Boresight) -> None:
        t_s = seconds_from_stamp(message.header.stamp)
        if not self.beam or t_s > self.beam[-1][0]:
            self.beam.append((t_s, message.azimuth, message.elevation))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            _, _, node = status.hardware_id.rpartition("/")
            if status.name.endswith(f"{node}: state") and status.message.startswith("active"):
                self._states[node] = seconds_from_stamp(message.header.stamp)


def built(folder: Path) -> Path:
    """Return the library that drops and damages datagrams and steps the clock, compiled."""
    source, library = folder / "loss.c", folder / "libloss.so"
    source.write_text(SHIM)
    subprocess.run(["cc", "-shared", "-fPIC", "-O2", "-o", str(library), str(source), "-ldl"], check=True)
    return library


def measure(nodes: Sequence[str], cases: Sequence[str]) -> None:
    """Print a line for each outage; each node has a pass of its own, the loss is one of all nodes."""
    for node in nodes:
        own = [case for case in cases if case != "loss"] + ["loss"] * ("loss" in cases and node == nodes[0])
        with tempfile.TemporaryDirectory() as folder, LivePass(Path(folder)) as flown:
            for case in own:
                found = flown.outage("every node" if case == "loss" else node, case)
                row = dataclasses.asdict(found) | {"allowed_s": found.allowed_s, "ok": found.lost_s <= found.allowed_s}
                print(json.dumps(row), flush=True)


def main() -> None:
    """Run the matrix."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nodes", nargs="+", choices=NODES, default=NODES)
    parser.add_argument("--cases", nargs="+", default=CASES)
    options = parser.parse_args()
    measure(options.nodes, options.cases)


if __name__ == "__main__":
    main()
