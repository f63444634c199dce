"""A real LEO pass on a position drive, in real time: where it stands, and how often it starts.

    scripts/run-python benchmarks/rotator_pass.py                      Debian's rotctld -m 1, a whole pass
    scripts/run-python benchmarks/rotator_pass.py --seconds 120        two minutes about culmination
    scripts/run-python benchmarks/rotator_pass.py --params-file my_dish.yaml    a drive of one's own

The control unit runs at 50 Hz on the system's clock, as in antenna_servo.  The direction of the device is read by a
second client of rotctld between two ticks; of another drive its own reading is taken.  Printed: commanded minus true
direction beside the bound resolution/2 + rate * interval/2, set points a second, starts and changes of direction.
"""

import argparse
import math
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from rf_pointing.commands.check_drive import read_drive
from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.core import JointTrajectory
from rf_pointing.drives import DriveParams, LinkParams, RotatorParams, make_drive
from rf_pointing.ephemeris import first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track
from rf_pointing.planning import WindWatchParams
from rf_pointing.station.antenna.drive_antenna import DriveAntenna, wait_for_drive
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.safety import SafetyParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams

TICK_S = 0.02
TRAVEL = {"travel_min_rad": (-math.pi, 0.0), "travel_max_rad": (math.radians(450.0), math.radians(90.0))}


class SecondClient:
    """Another client of rotctld; it reads when the position was measured, too."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), 2.0)

    def read(self) -> tuple[float, np.ndarray]:
        sent_s, text = time.monotonic(), b""
        self._socket.sendall(b"p\n")
        while text.count(b"\n") < 2:
            text += self._socket.recv(100)
        return 0.5 * (sent_s + time.monotonic()), np.radians([float(each) for each in text.split()[:2]])


def start_rotctld() -> tuple[subprocess.Popen[bytes], int]:
    program = shutil.which("rotctld")
    if program is None:
        sys.exit("rotctld is missing: sudo apt-get install libhamlib-utils")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = subprocess.Popen([program, "-m", "1", "-T", "127.0.0.1", "-t", str(port)])
    time.sleep(0.5)
    return process, port


def path_of_the_pass(peak_deg: float):
    """Return the path from -2 s on, its length and the time of culmination."""
    track, source = load_track(SourceParams()), SourceParams()
    window = first_pass_above(
        track, load_elements(source).epoch_t_s, math.radians(peak_deg), math.radians(5.0), 4 * 86400.0
    )
    times = np.arange(-2.0, window.los_t_s - window.aos_t_s + 4.0, 0.1)
    targets = [track.target_at(round(window.aos_t_s + t_s, 6)) for t_s in times]
    azimuth = np.unwrap([target.azimuth_rad for target in targets])
    azimuth += 2.0 * math.pi * math.ceil((-math.pi - azimuth.min()) / (2.0 * math.pi))
    curve = CubicSpline(times, np.column_stack([azimuth, [target.elevation_rad for target in targets]]))
    return curve, curve.derivative(), window.los_t_s - window.aos_t_s, window.tca_t_s - window.aos_t_s


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--params-file", type=Path, action="append", help="drive.* of antenna_servo (default: rotctld -m 1)"
    )
    parser.add_argument("--seconds", type=float, help="length about culmination (default: the whole pass)")
    parser.add_argument("--peak", type=float, default=40.0, help="least peak elevation in deg")
    options = parser.parse_args()
    server = None
    if options.params_file:
        drive_params = read_drive(options.params_file)
    else:
        server, port = start_rotctld()
        link = LinkParams(host="127.0.0.1", port=port)
        drive_params = DriveParams(type="hamlib", link=link, rotator=RotatorParams(latency_s=0.0, **TRAVEL))
    try:
        fly(drive_params, options, SecondClient(port) if server else None)
    finally:
        if server is not None:
            server.kill()
            server.wait()


def fly(params: DriveParams, options: argparse.Namespace, client: SecondClient | None) -> None:
    path, rate, length_s, culmination_s = path_of_the_pass(options.peak)
    seconds = options.seconds or length_s
    first_s = 0.0 if not options.seconds else culmination_s - 0.5 * seconds
    drive, rotator = make_drive(params), params.rotator
    wait_for_drive(drive, time.monotonic)
    motion = CommandPreprocessorParams(
        rate_limit_rad_s=rotator.rate_rad_s, acceleration_limit_rad_s2=rotator.rate_rad_s,
        travel_min_rad=rotator.travel_min_rad, travel_max_rad=rotator.travel_max_rad,
    )  # fmt: skip
    safety = SafetyParams(wind=WindWatchParams(watched=False))
    given = AntennaParams(drive=params, loops=LoopParams(preprocessor=motion), safety=safety)
    antenna = DriveAntenna(given, drive, time.monotonic())
    antenna.enable()
    hardware = antenna.hardware
    slew_s = 10.0 + float(np.max(np.abs(np.subtract(hardware.encoders(), path(first_s))) / rotator.rate_rad_s))
    begin_s = time.monotonic() + slew_s
    errors, rates, times_s, ticks, late = [], [], [], 0, []
    due_s = time.monotonic()
    while due_s < begin_s + seconds:
        ticks += 1
        # On the grid of the ticks, as in antenna_servo.
        now_s = due_s
        antenna.step(now_s)
        if ticks % 5 == 0:
            times = now_s + 0.1 * np.arange(1, 10)
            along = np.maximum(times - begin_s, 0.0) + first_s
            velocity = rate(along) * (times > begin_s)[:, None]
            table = JointTrajectory(t_s=times, position_rad=path(along), velocity_rad_s=velocity,
                                    acceleration_rad_s2=np.gradient(velocity, times, axis=0))  # fmt: skip
            refused = antenna.accept(table, now_s)
            if refused:
                sys.exit(f"refused: {refused}")
        # The first two seconds are the chase from rest.
        if now_s < begin_s + 2.0:
            hardware.rotator.count_anew()
        else:
            at_s, where = client.read() if client else (time.monotonic(), np.array(hardware.encoders()))
            errors.append(where - path(at_s - begin_s + first_s))
            rates.append(rate(at_s - begin_s + first_s))
            times_s.append(now_s)
        if fault := antenna.safety.latch.text:
            sys.exit(f"fault: {fault}")
        due_s += TICK_S
        time.sleep(max(0.0, due_s - time.monotonic()))
        late.append((due_s, max(0.0, time.monotonic() - due_s)))
    late_s = np.array([each for _, each in late])
    # Until the next set point a late one is missed.
    held_up_s = np.array([due_s for due_s, each in late if each > TICK_S])
    after_s = np.subtract.outer(np.array(times_s), held_up_s)
    held_up = np.any((after_s > -TICK_S) & (after_s < 2.0 * rotator.minimum_interval_s), axis=1)
    report(params, hardware, np.degrees(errors), np.abs(np.degrees(rates)), seconds, held_up)
    print(
        f"ticks late: median {1e3 * np.median(late_s):.1f} ms, 99 % {1e3 * np.quantile(late_s, 0.99):.1f} ms, "
        f"largest {1e3 * late_s.max():.0f} ms, {len(held_up_s)} more than one tick"
    )
    antenna.close()


def report(
    params: DriveParams, hardware, error: np.ndarray, rate: np.ndarray, seconds: float, held_up: np.ndarray
) -> None:
    resolution = np.degrees(hardware.drive.capabilities.resolution_rad)
    bound = 0.5 * resolution + 0.5 * rate * params.rotator.minimum_interval_s
    counts = hardware.rotator.counts()
    print(f"{params.type}: {seconds:.0f} s, {len(error)} samples, resolution {resolution[0]:.2f} deg")
    print(
        f"set points at least {params.rotator.minimum_interval_s:.2f} s apart, largest rates {rate.max(axis=0).round(2)} deg/s"
    )
    for axis, name in enumerate(("azimuth", "elevation")):
        own, limit = np.abs(error[:, axis]), bound[:, axis]
        print(f"{name:<9} commanded minus true: mean {np.mean(error[:, axis]):+.4f}, rms {np.sqrt(np.mean(own**2)):.4f}, "
              f"largest {own.max():.4f} deg (bound there {limit[own.argmax()]:.4f}); within the bound "
              f"{100.0 * np.mean(own <= limit):.2f} %, largest share of it {np.max(own / limit):.3f}; where no tick came "
              f"late {100.0 * np.mean((own <= limit)[~held_up]):.2f} %, {np.max((own / limit)[~held_up]):.3f}")  # fmt: skip
    print(
        f"set points: {counts.commands / seconds:.2f} a second; starts {counts.starts}, changes of direction {counts.reversals}"
    )
    print(f"latency measured {hardware.rotator.latency_s:.3f} s; losses {dict(hardware.drive.losses) or 'none'}")


if __name__ == "__main__":
    main()
