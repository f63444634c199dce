"""A pass of a target that may be early or late: when a sensor finds it, and what is held of it.

Targets that stand for all are flown through the pass: quantiles of the distance from where it is
expected times even angles, in units of the uncertainty along the track and across it, each with a
bias of the mount.  A target is found where the search of the mode table first passes it, or where
it comes into the beam by itself: near the rise a pass is slow, and seconds along the track are few
degrees.  Without a sensor the beam stays on the prediction.
"""

import math
from collections.abc import Sequence

import numpy as np

from rf_pointing.core import LEVEL, MU, Array, Kinematics, Mode, random_stream, received_power
from rf_pointing.planning import PassProfile, SensorCost
from rf_pointing.station.pointing.scan_patterns import PROMISED, ScanPatterns, Scans, held_cost, unit_targets
from rf_pointing.tracking import AutotrackParams, SkyMotion, TrackPath, TrimFilter, TrimParams, direction_rows
from rf_pointing.tracking.sensors import SensorTraits

# Steps in which the pass is flown: less than a search needs for half a beam.
STEP_S = 0.1
STRONG_DB_HZ = 60.0
# From where a search found it, back to the target, and from the edge of the beam to its middle: the
# transition, a window of a scan, and the loop.
RETURN_S, PULL_S = 4.0, 6.0
# Beamwidths off the axis at which a feed that stares believes its error, and to which a search
# counts a carrier: a real dish has its first null there.
STARED, MAIN_BEAM = 0.75, 1.2


def uncertain_cost(
    sensor: SensorTraits | None, scans: Scans, prior: TrimParams, table: AutotrackParams, profile: PassProfile,
    latitude_rad: float, begin_s: float, mount: Kinematics = LEVEL, levels_db_hz: Sequence[float] = (),
) -> SensorCost:  # fmt: skip
    """Return what a sensor costs on a pass, from `begin_s` on, whose target is known like `prior`.

    `levels_db_hz` are those of the rows of the profile with the beam on the target; without them
    the carrier is taken to be strong.

    None: the prediction alone is followed, and its error stays.
    """
    beamwidth, fine = scans.spiral.half_power_beamwidth_rad, profile.resampled()
    path = TrackPath(fine.t_s, fine.position_rad, fine.range_m, latitude_rad, mount)
    count = max(math.ceil((float(fine.t_s[-1]) - begin_s) / STEP_S), 2)
    times: Array = np.asarray(begin_s + STEP_S * np.arange(count), dtype=np.float64)
    errors = _errors_rad(times, path, fine, prior)
    if sensor is None:
        distance = np.hypot(errors[..., 0], errors[..., 1])
        power = np.mean(received_power(distance, beamwidth), axis=1)
        unheld = STEP_S * np.count_nonzero(distance > 0.5 * beamwidth, axis=1)
        return SensorCost(
            power=float(np.mean(power)), power_90=float(np.quantile(power, 1.0 - PROMISED)),
            unheld_s=float(np.mean(unheld)), unheld_90_s=float(np.quantile(unheld, PROMISED)),
        )  # fmt: skip
    levels = np.interp(times, profile.t_s, levels_db_hz) if len(levels_db_hz) else np.full(len(times), STRONG_DB_HZ)
    taken = _found_after_s(sensor, scans, prior, table, times, errors, path, fine, levels)
    return held_cost(sensor, scans, TrimFilter(prior), table, taken)


def _errors_rad(times: Array, path: TrackPath, fine: PassProfile, prior: TrimParams) -> Array:
    """Return where the targets are from the prediction (targets, n, 2)."""
    ahead, left_of = unit_targets()
    ahead_s, left_m = prior.along_track_s * ahead, prior.cross_track_m * left_of
    biases = prior.bias_rad * random_stream(1, "biases of the mount").standard_normal((len(ahead_s), 2))
    range_m, found = np.interp(times, fine.t_s, fine.range_m), []
    for tau_s, across_m, bias in zip(ahead_s.tolist(), left_m.tolist(), biases, strict=True):
        offset, rate = path.moved(times, tau_s)
        left = direction_rows(SkyMotion(rate[:, 0], rate[:, 1], range_m))[:, :, 1]
        found.append(offset + left * across_m + bias)
    return np.array(found)


def _found_after_s(
    sensor: SensorTraits, scans: Scans, prior: TrimParams, table: AutotrackParams, times: Array, errors: Array,
    path: TrackPath, fine: PassProfile, levels_db_hz: Array,
) -> Array:  # fmt: skip
    """Return when each target (targets,) is held, in s after the first of the times (n,).

    `levels_db_hz` (n,) is the carrier with the beam on the target.
    """
    beamwidth, known = scans.spiral.half_power_beamwidth_rad, TrimFilter(prior)
    beam, searching = np.zeros((len(times), 2)), np.zeros(len(times), dtype=np.bool_)
    begin_s, fruitless = float(times[0]) + table.settle_s, 0
    while begin_s < times[-1]:
        rows = (times >= begin_s) & (times < begin_s + table.search_s)
        _, motion = path.moved(times[rows], 0.0)
        sky = SkyMotion(motion[:, 0], motion[:, 1], np.interp(times[rows], fine.t_s, fine.range_m))
        search = ScanPatterns(scans)
        search.begin(Mode.SEARCH, begin_s, known, sky, path, uncertain=True, wider=1 + fruitless)
        beam[rows], searching[rows] = search.at(times[rows], sky)[0], True
        begin_s, fruitless = begin_s + table.search_s + table.settle_s, fruitless + 1
    at_once, seen = _reaches_rad(sensor, table, beamwidth, levels_db_hz)
    # A scan begins where nothing else moves the beam; a stare measures in a search, too.
    at_once = np.where(searching, 0.0, at_once) if sensor.scans else at_once
    seen = np.where(searching, seen, 0.0)
    distance = np.hypot(*np.moveaxis(errors - beam, -1, 0))
    turn = math.ceil(table.search_turn_s / STEP_S)
    taken = []
    for apart in distance:
        met, glimpsed = np.flatnonzero(apart <= at_once), np.flatnonzero(apart <= seen)
        caught = int(met[0]) if len(met) else len(times)
        found_s = float(times[-1] - times[0])
        if caught < len(times):
            found_s = STEP_S * caught + PULL_S * bool(apart[caught] > 0.5 * beamwidth)
        if len(glimpsed) and glimpsed[0] < caught:
            peak = nearest = int(glimpsed[0])
            # Only one turn later is it known that the carrier was strongest there.
            while len(after := apart[peak + 1 : peak + 1 + turn]) and after.min() < apart[nearest]:
                peak = nearest = peak + 1 + int(after.argmin())
            far = apart[peak] > (0.5 if sensor.scans else STARED) * beamwidth
            back_s = table.search_turn_s + RETURN_S + far * (PULL_S if sensor.scans else table.coast_s + PULL_S)
            found_s = min(found_s, STEP_S * peak + back_s)
        taken.append(found_s)
    return np.asarray(np.minimum(taken, times[-1] - times[0]))


def _reaches_rad(
    sensor: SensorTraits, table: AutotrackParams, beamwidth: float, levels_db_hz: Array
) -> tuple[Array, Array]:
    """Return how far off a target (n,) is held at once, and how far off a search sees its carrier.

    A scan begins with a carrier as weak as `beam_drop_db`, a stare within what its feed believes.
    """

    def within(margin_db: Array | float) -> Array:
        return beamwidth * np.sqrt(np.maximum(margin_db, 0.0) * math.log(10.0) / (10.0 * MU))

    carrier = within(levels_db_hz - table.carrier_db_hz[0])
    needed = table.monopulse_on_db_hz if sensor.needs_strong_carrier else table.carrier_db_hz[0]
    own = within(table.beam_drop_db) if sensor.scans else np.minimum(STARED * beamwidth, within(levels_db_hz - needed))
    return np.minimum(own, carrier), np.minimum(carrier, MAIN_BEAM * beamwidth)
