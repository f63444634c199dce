"""Synthetic passes: straight fly-bys whose angles and derivatives are closed form, biased by a planted model."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.calibration import BiasModel, Ionosphere, Observations, RawTracking, ReferenceTrack
from rf_pointing.core import random_stream

TABLE_1_DEG = {
    "azimuth_offset": 0.178, "non_orthogonality": 0.062, "collimation": -0.010,
    "azimuth_encoder_sine": -0.194, "azimuth_encoder_cosine": -0.048,
    "azimuth_velocity_lag": -1.022, "azimuth_acceleration_lag": 0.0, "mislevel_east": 0.039,
    "mislevel_north": -0.007, "elevation_offset": -0.202, "droop": -0.089,
    "elevation_encoder_sine": -0.009, "elevation_velocity_lag": -1.907,
    "elevation_acceleration_lag": 0.0,
}  # fmt: skip
HEIGHT_M, SPEED_M_S = 800e3, 7000.0


def fly_by(miss_m: float, heading_rad: float, t_s: np.ndarray) -> dict[str, np.ndarray]:
    """Return azimuth, elevation, derivatives and range of a target flying straight at constant height."""
    ahead = np.array([np.sin(heading_rad), np.cos(heading_rad), 0.0])
    right = np.array([np.cos(heading_rad), -np.sin(heading_rad), 0.0])
    position = miss_m * right + np.array([0.0, 0.0, HEIGHT_M]) + SPEED_M_S * t_s[:, np.newaxis] * ahead
    velocity = np.broadcast_to(SPEED_M_S * ahead, position.shape)
    east, north, up = position.T
    east_rate, north_rate, _ = velocity.T
    ground2 = east**2 + north**2
    turning = north * east_rate - east * north_rate
    closing = east * east_rate + north * north_rate
    azimuth_rate = turning / ground2
    azimuth_acceleration = -2.0 * turning * closing / ground2**2
    ground, distance2 = np.sqrt(ground2), ground2 + up**2
    elevation_rate = -up * closing / (ground * distance2)
    ground_rate = closing / ground
    ground_acceleration = (SPEED_M_S**2 - ground_rate**2) / ground
    elevation_acceleration = -up * ground_acceleration / distance2 + 2.0 * up * ground * ground_rate**2 / distance2**2
    return {
        "true_azimuth_rad": np.unwrap(np.arctan2(east, north)),
        "true_elevation_rad": np.arctan2(up, ground), "azimuth_rate_rad_s": azimuth_rate,
        "elevation_rate_rad_s": elevation_rate, "azimuth_acceleration_rad_s2": azimuth_acceleration,
        "elevation_acceleration_rad_s2": elevation_acceleration, "range_m": np.sqrt(distance2),
        "range_rate_m_s": closing / np.sqrt(distance2),
    }  # fmt: skip


def write_tracking(path: Path, raw: RawTracking) -> None:
    """Write samples of one pass as the CSV that `read_tracking` reads."""
    columns = {
        "t_s": raw.t_s,
        "azimuth_deg": np.degrees(raw.azimuth_rad),
        "elevation_deg": np.degrees(raw.elevation_rad),
        **{name: raw.channels[name] for name in ("range_m", "range_rate_m_s") if name in raw.channels},
        "good": raw.good.astype(np.float64),
    }
    rows = [",".join(map(repr, row)) for row in np.stack(list(columns.values()), axis=1).tolist()]
    notes = [f"# {name}: {getattr(raw, name)}" for name in ("station", "band", "target")]
    path.write_text("\n".join([*notes, ",".join(columns), *rows]) + "\n")


def one_pass(
    number: int, model: BiasModel, sigma_rad: float, random: np.random.Generator, form: str = "printed"
) -> Observations:
    """Return the observations of one fly-by, 10 s apart, 10 to 80 deg of elevation."""
    miss = random.choice([-1.0, 1.0]) * random.uniform(0.15, 2.2) * HEIGHT_M
    t_s = np.arange(-600.0, 601.0, 10.0)
    truth = fly_by(miss, random.uniform(0.0, 2.0 * np.pi), t_s)
    seen = (truth["true_elevation_rad"] > np.radians(10.0)) & (truth["true_elevation_rad"] < np.radians(80.0))
    truth = {name: value[seen] for name, value in truth.items()}
    motion = [truth[name] for name in list(truth)[:6]]
    if form == "printed":
        shift = model.offset_rad(*motion)
        azimuth, elevation = motion[0] + shift[0], motion[1] + shift[1]
    else:
        azimuth, elevation = model.apply(*motion)
    count = len(azimuth)
    return Observations(
        station="gs1", band="S", t_s=1e9 + 6000.0 * number + t_s[seen],
        pass_id=np.full(count, number),
        observed_azimuth_rad=azimuth + sigma_rad * random.standard_normal(count),
        observed_elevation_rad=elevation + sigma_rad * random.standard_normal(count),
        sigma_azimuth_rad=np.full(count, max(sigma_rad, 1e-6)),
        sigma_elevation_rad=np.full(count, max(sigma_rad, 1e-6)), **truth,
    )  # fmt: skip


@pytest.fixture
def random() -> np.random.Generator:
    """Return the seeded generator of a test."""
    return random_stream(1, "calibration tests")


@pytest.fixture
def table_1() -> BiasModel:
    """Return the coefficients of SATCAL Table 1."""
    return BiasModel.from_degrees(TABLE_1_DEG)


@pytest.fixture
def partials() -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Return the derivatives (n, k) of both offsets by the named terms: the offset is linear in them."""

    def matrices(motion: Sequence[np.ndarray], names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        size = 0.0625
        ones = [BiasModel.zero().replace(**{name: size}).offset_rad(*motion) for name in names]
        azimuth, elevation = (np.stack([one[axis] / size for one in ones], axis=-1) for axis in (0, 1))
        return azimuth, elevation

    return matrices


@pytest.fixture
def campaign(random: np.random.Generator) -> Callable[..., Observations]:
    """Return a maker of campaigns: `campaign(model, passes=12, sigma_rad=..., form=...)`."""

    def make(model: BiasModel, passes: int = 12, sigma_rad: float = 1e-4, form: str = "printed") -> Observations:
        return Observations.concatenate([one_pass(k, model, sigma_rad, random, form) for k in range(passes)])

    return make


@pytest.fixture
def track() -> Callable[..., ReferenceTrack]:
    """Return a maker of reference tracks: `track(step_s, miss_m=..., heading_rad=..., start_t_s=...)`."""

    def make(
        step_s: float, miss_m: float = 350e3, heading_rad: float = 0.7, start_t_s: float = 1e9 - 400.0
    ) -> ReferenceTrack:
        t_s = np.arange(-400.0, 400.1, step_s)
        fly = {name.removeprefix("true_"): value for name, value in fly_by(miss_m, heading_rad, t_s).items()}
        return ReferenceTrack(t_s=start_t_s + 400.0 + t_s, **fly)

    return make


@pytest.fixture
def raw_pass(random: np.random.Generator) -> Callable[..., RawTracking]:
    """Return a maker of raw passes at 8 samples/s of a reference track seen through a bias model."""

    def make(
        reference: ReferenceTrack, model: BiasModel, ionosphere: Ionosphere | None, noise_rad: float
    ) -> RawTracking:
        t_s = np.arange(reference.t_s[0] + 1.0, reference.t_s[-1] - 1.0, 0.125)
        seen = reference.at(t_s)
        shift = model.offset_rad(*seen.motion())
        count = len(t_s)
        elevation, distance = seen.elevation_rad + shift[1], seen.range_m
        if ionosphere is not None:
            elevation = elevation + ionosphere.bending(seen.elevation_rad, seen.range_m)
            distance = distance + ionosphere.delay_m(seen.elevation_rad)
        return RawTracking(
            station="gs1", band="S", target="bird", t_s=t_s,
            azimuth_rad=seen.azimuth_rad + shift[0] + noise_rad * random.standard_normal(count),
            elevation_rad=elevation + noise_rad * random.standard_normal(count),
            range_m=distance + 10.0 * random.standard_normal(count),
            range_rate_m_s=seen.range_rate_m_s + 0.1 * random.standard_normal(count),
            good=np.ones(count, dtype=bool),
        )  # fmt: skip

    return make
