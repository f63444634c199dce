"""Orbits from passes: a planted orbit, written as files, read, determined and flown."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import rf_pointing as rp
from rf_pointing.calibration import RawTracking, write_tdm
from rf_pointing.commands.orbit_from_passes import main
from rf_pointing.core import DAY_S, MDEG, angular_distance_rad, random_stream
from rf_pointing.ephemeris import OemTarget, TopocentricTrack, leap_seconds
from rf_pointing.ephemeris.oem import OemSegment
from rf_pointing.ephemeris.orbit_file import read_orbits
from rf_pointing.ephemeris.tle import tle_lines, verification_elements
from rf_pointing.ephemeris.uncertainty import ElementUncertainty
from rf_pointing.orbit.determination import Dynamics
from rf_pointing.orbit.passes import forces_of, prior_of

NOISE_RAD, AHEAD_S = 2.0 * MDEG, 4.0
OLD = next(one for one in verification_elements() if one.catalogue_number == 28057)


class Sky:
    """A satellite on a planted orbit, 4 s ahead of its elements; its field reaches degree 12, its drag is 30 % higher."""

    def __init__(self, folder: Path, burn_m_s: float = 0.0) -> None:
        self.folder, self.station = folder, rp.Station("leo_3m7")
        self.elements = folder / "old.tle"
        self.elements.write_text("\n".join([OLD.name, *tle_lines(OLD)]) + "\n")
        begin_s = math.floor(OLD.epoch_t_s + 9.5 * DAY_S)
        state = prior_of(OLD, begin_s + AHEAD_S, ElementUncertainty(), 14.0 * DAY_S).states[0]
        forces = dataclasses.replace(forces_of(OLD, state), degree=12)
        t_s = begin_s + 60.0 * np.arange(1.5 * 1440)
        first = OemTarget([self._segment(Dynamics(forces=forces), begin_s, state, np.zeros(0), t_s)])
        self.passes = self._windows(first)
        self.burn_t_s = 0.5 * (self.passes[0][1] + self.passes[1][0])
        dynamics = Dynamics(forces=forces, manoeuvre_t_s=self.burn_t_s if burn_m_s else None)
        burn = burn_m_s * state[3:] / np.linalg.norm(state[3:]) if burn_m_s else np.zeros(0)
        self.truth = OemTarget([self._segment(dynamics, begin_s, state, burn, t_s)])
        self.track = TopocentricTrack(self.truth, self.station.site)

    def _segment(
        self, dynamics: Dynamics, begin_s: float, state: np.ndarray, burn: np.ndarray, t_s: np.ndarray
    ) -> OemSegment:
        values = np.concatenate([state, [1.3], burn, [1.0, 1.0]])[np.newaxis]
        states = dynamics.states(begin_s, values, t_s)[0]
        tai_s = t_s + leap_seconds().tai_minus_utc_s(t_s)
        return OemSegment(
            name=OLD.name, object_id="2003-049A", frame="TEME", tai_s=tai_s, position_m=states[:, :3],
            velocity_m_s=states[:, 3:], usable_from_s=tai_s[0], usable_to_s=tai_s[-1], method="HERMITE", degree=7,
        )  # fmt: skip

    def _windows(self, target: OemTarget) -> list[tuple[float, float]]:
        first, last = target.spans_t_s[0]
        t_s = np.arange(math.ceil(first), last, 10.0)
        up = np.flatnonzero(TopocentricTrack(target, self.station.site).sample(t_s).elevation_rad > math.radians(8.0))
        parts = np.split(up, np.flatnonzero(np.diff(up) > 1) + 1)
        return [(float(t_s[part[0]]), float(t_s[part[-1]])) for part in parts if len(part) > 25]

    def pass_file(
        self, number: int, *, spoil: Callable[[RawTracking], RawTracking] | None = None, late_s: float = 0.0
    ) -> Path:
        first, last = self.passes[number]
        t_s = np.arange(first, last, 0.5)
        look = self.track.sample(t_s)
        noise = NOISE_RAD * random_stream(number, "noise").standard_normal((2, len(t_s)))
        raw = RawTracking(
            station=self.station.name, band="X", target=OLD.name, t_s=t_s + late_s,
            azimuth_rad=look.azimuth_rad + noise[0] / np.cos(look.elevation_rad),
            elevation_rad=look.elevation_rad + noise[1], range_m=None, range_rate_m_s=None,
            good=np.ones(len(t_s), dtype=bool),
        )  # fmt: skip
        path = self.folder / f"pass{number}.tdm"
        write_tdm(path, [spoil(raw) if spoil else raw], originator="TEST", created_t_s=first)
        return path

    def files(self, count: int = 2) -> list[Path]:
        return [self.pass_file(k) for k in range(count)]

    def target(self) -> rp.Target:
        return rp.elements(self.elements)

    def off_rad(self, source: object, number: int) -> float:
        """Return the largest error of a target on the sky in a pass."""
        t_s = np.arange(*self.passes[number], 10.0)
        ours, true = TopocentricTrack(source, self.station.site).sample(t_s), self.track.sample(t_s)  # type: ignore[arg-type]
        apart = angular_distance_rad(ours.azimuth_rad, ours.elevation_rad, true.azimuth_rad, true.elevation_rad)
        return float(np.max(apart))


@pytest.fixture(scope="module")
def sky(tmp_path_factory: pytest.TempPathFactory) -> Sky:
    return Sky(tmp_path_factory.mktemp("sky"))


def test_two_passes_predict_the_next_ten_times_better_and_say_so(sky, tmp_path, capsys):
    stem = tmp_path / "cbers"
    line = [*map(str, sky.files()), "--station", "leo_3m7", "--elements", str(sky.elements), "--satellite", "28057"]
    main([*line, "--bias", "2", "--if-better", "--output", str(stem)])
    said = capsys.readouterr().out
    assert "orbit from 2 passes" in said
    assert "s ahead of its elements" in said

    by_elements = sky.off_rad(OLD, 2)
    predicted = rp.elements(f"{stem}.oem").found
    off = sky.off_rad(predicted, 2)
    assert by_elements > 10.0 * off
    assert by_elements > 500.0 * MDEG
    # Elements cannot follow tesseral terms: some hundred metres.
    assert by_elements > 10.0 * sky.off_rad(rp.elements(f"{stem}.omm").found, 2)

    (segment,) = read_orbits(Path(f"{stem}.oem").read_text()).segments
    middle_s = 0.5 * sum(sky.passes[2])
    tai_s = middle_s + leap_seconds().tai_minus_utc_s(middle_s)
    block = min(segment.covariances, key=lambda one: abs(one.tai_s - tai_s))
    assert block.frame == "RTN"
    off_m = np.subtract(predicted.motion_at(middle_s).position, sky.truth.motion_at(middle_s).position)
    sigma_m = math.sqrt(np.trace(block.matrix[:3, :3]))
    assert np.linalg.norm(off_m) < 3.0 * sigma_m < 1500.0


def determined(sky: Sky, paths: list[Path], **more: object) -> rp.DeterminedOrbit:
    return rp.orbit_from_passes(paths, sky.station, sky.target(), bias_mdeg=2.0, predict_hours=4.0, **more)  # type: ignore[arg-type]


def spoiled(**changes: object) -> Callable[[RawTracking], RawTracking]:
    return lambda raw: dataclasses.replace(raw, **{name: change(raw) for name, change in changes.items()})  # type: ignore[operator]


def test_one_pass_says_what_it_leaves_to_the_elements(sky):
    orbit = determined(sky, [sky.pass_file(1)])
    assert "one pass: 2 or more tell the period" in str(orbit)
    assert any("semi-major axis" in one for one in orbit.found.undetermined())
    assert orbit.ahead_of_elements_s == pytest.approx(AHEAD_S, abs=0.1)
    # Elements of the same minute would be better, those of ten days are not.
    fresh = dataclasses.replace(orbit, before=dataclasses.replace(OLD, epoch_t_s=float(orbit.ephemeris.t_s[-1])))
    assert "must be < 700 m, that of the elements" in fresh.reason_not_better
    assert orbit.reason_not_better == ""


def test_outliers_holes_and_disorder_are_left_out(sky):
    rng = random_stream(9, "damage")
    wild = np.flatnonzero(rng.random(4000) < 0.08)

    def damaged(raw: RawTracking) -> np.ndarray:
        azimuth = raw.azimuth_rad.copy()
        azimuth[wild[wild < len(raw)]] += 0.05
        return azimuth

    def holes(raw: RawTracking) -> np.ndarray:
        return (np.arange(len(raw)) < 200) | (np.arange(len(raw)) > 500)

    second = sky.pass_file(1, spoil=spoiled(azimuth_rad=damaged, good=holes))
    orbit = determined(sky, [second, sky.pass_file(0)])
    assert sky.off_rad(orbit.target, 2) < 0.1 * sky.off_rad(OLD, 2)
    assert orbit.found.passes[0].t_s[0] < orbit.found.passes[1].t_s[0]


@pytest.mark.parametrize(
    ("late_s", "spoil", "reason"),
    [
        (0.9, None, r"clock of pass \d .* is [+-]0.9\d\d s off the other passes, must be within 0.05 s"),
        (0.0, spoiled(elevation_rad=lambda raw: raw.elevation_rad + math.radians(3.0)), "must be <="),
        (0.0, spoiled(target=lambda _: "NOAA 15"), "satellite='NOAA 15' is not among 1 elements"),
        (0.0, spoiled(station=lambda _: "dss13"), "is of station dss13, must be one of: LEO 3.7 m"),
        (0.0, spoiled(good=lambda raw: np.arange(len(raw)) < 60), r"points of 5 s, must be >= 10"),
        (0.0, spoiled(azimuth_rad=lambda raw: raw.azimuth_rad + 2e-2 * np.sin(raw.t_s / 20.0)), "mdeg rms, must be <="),
    ],
    ids=["clock", "bias", "satellite", "station", "short", "wandering"],
)  # fmt: skip
def test_a_spoiled_pass_is_named_with_value_and_bound(sky, late_s, spoil, reason):
    # Of two passes alone a clock that is 0.9 s off is another semi-major axis, by 3.5 sigma of the elements.
    paths = [sky.pass_file(0), sky.pass_file(1, spoil=spoil, late_s=late_s), sky.pass_file(2)]
    with pytest.raises(ValueError, match=reason):
        determined(sky, paths)


def test_a_manoeuvre_between_is_refused_and_estimated(tmp_path):
    sky = Sky(tmp_path, burn_m_s=3.0)
    paths = sky.files()
    with pytest.raises(ValueError, match="do not agree: .* must be <="):
        determined(sky, paths)
    orbit = determined(sky, paths, manoeuvre_t_s=sky.burn_t_s)
    assert "m/s" in str(orbit)
    assert sky.off_rad(orbit.target, 2) < 0.2 * sky.off_rad(OLD, 2)


def test_a_command_without_passes_writes_nothing(sky, tmp_path, capsys):
    table = tmp_path / "points.csv"
    table.write_text("nothing\n")
    with pytest.raises(SystemExit) as ended:
        main([str(table), "--station", "leo_3m7", "--elements", str(sky.elements), "--output", str(tmp_path / "x")])
    assert ended.value.code == 2
    assert not list(tmp_path.glob("x*"))
    assert "points.csv" in capsys.readouterr().err
