"""The radio of a simulated antenna and the receiver of its samples, over real sockets, in wall time."""

import math
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rf_pointing_msgs.msg import StationInUse

from rf_pointing.core import Boresight
from rf_pointing.ephemeris.source import SourceParams, load_track
from rf_pointing.nodes.signal_receiver import SignalReceiverNode
from rf_pointing.nodes.signal_source import SignalSource
from rf_pointing.rf import Link
from rf_pointing.ros import convert
from rf_pointing.station.antenna.receiver import SignalParams
from rf_pointing.station.description import read_station
from test.graph.real_station import write_elements
from test.receiver.test_sources import free_port

ROOT, NAME = Path(__file__).parents[2], "OVERHEAD"
OFF_BEAM = 0.4
"""How far the beam is off the satellite, in the beamwidths of X band."""


class Source:
    """The radio of a description, with a satellite that culminates in a while."""

    def __init__(self, make_bench: Callable[..., Any], station: Path, in_s: float) -> None:
        read = read_station(station)
        elements = write_elements(station.parent, read.site, time.time() + in_s)
        self.track = load_track(SourceParams(elements=str(elements), satellite=NAME, site=read.site))
        given = {"source.elements": str(elements), "source.satellite": NAME}
        self.source = make_bench(SignalSource, real_time=True, station=str(station), **given).up()
        self.sent_s = math.floor(50.0 * self.source.node.now_s()) / 50.0
        self.off_rad = 0.0

    def give(self) -> None:
        """Give the source the boresights of now."""
        while self.sent_s + 0.02 < self.source.node.now_s():
            self.sent_s = round(self.sent_s + 0.02, 6)
            aim = self.track.target_at(self.sent_s)
            elevation_rad = aim.elevation_rad + self.off_rad
            beam = Boresight(t_s=self.sent_s, azimuth_rad=aim.azimuth_rad, elevation_rad=elevation_rad)
            self.source.give("sim/boresight", convert.boresight_to_message(beam))
        self.source.turn()


class Wireless(Source):
    """Both nodes on one description."""

    def __init__(self, make_bench: Callable[..., Any], folder: Path, kind: str) -> None:
        station, shipped = folder / "dish.yaml", read_station("leo_3m7")
        link = {"host": "127.0.0.1", "port": free_port(), "first_retry_s": 0.05, "longest_retry_s": 0.1}
        own = {"type": kind, "iq.rate_hz": 480e3, "iq.converter_mhz": 4000.0} | {
            f"link.{name}": value for name, value in link.items()
        }
        # In S band another device: its port, converter and rate.
        other = {"link.port": free_port(), "iq.converter_mhz": 1800.0, "iq.rate_hz": 240e3}
        given = {f"receiver.{name}": value for name, value in own.items()}
        shipped.write(station, given | {f"bands.S.receiver.{name}": value for name, value in other.items()})
        super().__init__(make_bench, station, 60.0)
        self.receiver = make_bench(SignalReceiverNode, beside=True, real_time=True, station=str(station)).up()
        self.off_rad = OFF_BEAM * shipped.sets("signal_source", "X")["signal"].beam.half_power_beamwidth_rad

    @property
    def levels(self) -> list[float]:
        return [each.carrier_to_noise for each in self.receiver.sent["carrier_power"]]

    def level_db_hz(self, signal: SignalParams) -> float:
        """Return the C/N0 of the link, less what a Gaussian beam loses off its axis."""
        aim = self.track.target_at(self.sent_s)
        sky = Link(signal.link, signal.atmosphere, signal.noise)
        on_axis = float(sky.carrier_to_noise_db_hz(np.array([aim.range_m]), np.array([aim.elevation_rad]))[0])
        return on_axis - 12.04 * (self.off_rad / signal.beam.half_power_beamwidth_rad) ** 2

    def lead(self, band: str) -> None:
        """Publish as a pointing controller that uses `band`."""
        for bench in (self.source, self.receiver):
            station = bench.node.station
            bench.give("band_in_use", StationInUse(station=station.name, band=band, digest=station.digest))

    def run(self, until: Callable[[], bool], patience_s: float = 30.0) -> None:
        end_s = self.sent_s + patience_s
        while not until():
            assert self.sent_s < end_s, self.receiver.health("signal").message
            self.give()
            ahead = self.track.target_at(self.sent_s + 1.0)
            self.receiver.give("target", convert.target_to_message(ahead))
            self.receiver.run(0.005, 0.005)


@pytest.mark.parametrize("kind", ["rtl_tcp", "vita49"])
def test_radio_and_receiver_follow_to_another_band_and_measure_what_its_beam_and_link_give(
    make_bench: Callable[..., Any], tmp_path: Path, kind: str
) -> None:
    link = Wireless(make_bench, tmp_path, kind)
    for band in ("X", "S", "X"):
        if link.receiver.node.band != band:
            link.lead(band)
        assert (link.source.node.band, link.receiver.node.band) == (band, band)
        before = len(link.levels)
        link.run(lambda before=before: len(link.levels) > before + 20)
        numbers = link.receiver.node.parameters.value("receiver")
        radio = link.receiver.node.station.content.receiver_in(band)
        assert numbers.link.port == link.source.node.parameters.value("outlet").port == radio.link["port"]
        assert numbers.iq.rate_hz == radio.iq["rate_hz"]
        sets = link.receiver.node.station.sets("signal_source", band)
        assert numbers.frequency_hz == sets["sdr"].doppler_hz == link.receiver.node.station.sets("rf_receiver", band)[
            "signal"].frequency_hz  # fmt: skip
        assert float(np.median(link.levels[-8:])) == pytest.approx(link.level_db_hz(sets["signal"]), abs=0.5)


def test_the_page_holds_for_whoever_pastes_it_in_an_empty_folder(
    make_bench: Callable[..., Any], tmp_path: Path
) -> None:
    """The lines but that of `track`, which flies a whole pass: `benchmarks/first_hour.py`."""
    text = (ROOT / "docs" / "my_receiver.md").read_text()
    station, port = (
        next(each for each in re.findall(r"```\n(.*?)```", text, re.DOTALL) if "version" in each),
        free_port(),
    )
    assert station.count("\n") <= 10
    (tmp_path / "my_dish.yaml").write_text(station.replace("1234", str(port)))
    radio = Source(make_bench, tmp_path / "my_dish.yaml", 0.0)
    lines = re.findall(r"^    scripts/run (check_\w+)(.* my_dish.yaml)$", text, re.MULTILINE)
    assert [name for name, _ in lines] == ["check_station", "check_receiver"]
    for name, arguments in lines:
        start = f"from rf_pointing.commands.{name} import main; main()"
        words = [sys.executable, "-c", start, *arguments.split()]
        program = subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.PIPE, text=True)
        while program.poll() is None:
            radio.give()
            time.sleep(0.005)
        said = program.communicate()[0]
        assert program.returncode == 0, said
    assert "9 of 9 passed" in said
