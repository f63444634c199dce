"""A certificate in words, for the operator, and as plain values for a file."""

import dataclasses
import math
from typing import Any

from rf_pointing.core import SIDELOBE_DB, to_degrees
from rf_pointing.planning.certificate import Branch, Certificate

# From here on fresh elements are worth a word.
WORTH_S, WORTH_DB = 5.0, 0.2
# What is left out or, `reasons`, goes under the name that it has in the file and on the wire.
NOT_PLAIN = ("crossing", "axes_rad", "branches", "machine", "mount", "reasons")


def certificate_lines(certificate: Certificate) -> list[str]:
    """Return the certificate as text: the machine, one line for every branch, and the verdict."""
    rate, acceleration = certificate.machine.rate_limit_rad_s, certificate.machine.acceleration_limit_rad_s2
    machine = (
        f"machine: {_pair(rate)} deg/s, {_pair(acceleration)} deg/s^2; "
        f"sky peak {math.degrees(certificate.sky_peak_rad):.2f} deg"
    )
    mount, names = certificate.mount, [name.replace("_", " ") for name in certificate.mount.axes]
    if not mount.level:
        machine += f"; mount {mount.type}" + (
            f" leaning to {math.degrees(mount.train_rad):.0f} deg" * bool(mount.tilt_rad)
        )
    rates = f"rate {names[0][:2]} {names[1][:2]} deg/s"
    columns = (
        f"  {'branch':<17}{f'{names[0]} deg':>17}{f'{names[1]} deg':>16}{rates:>18}{'closest limit':>35}"
        f"{'mask':>7}{'Sun':>7}{'keyhole':>9}{'lost':>8}{'slew':>7}{'unwind':>8}"
    )
    lines = [f"certificate of {certificate.name}: {machine}", columns]
    for branch in certificate.branches:
        mark = ">" if branch is certificate.chosen else " " if branch.works else "x"
        lines.append(f"{mark} {_row(branch)}")
        lines += [f"    refused: {reason}" for reason in branch.reasons]
    chosen = certificate.chosen
    if chosen is None:
        return [*lines, f"REFUSED: {certificate.reason}"]
    verdict = f"taken: {chosen.label}, start at {names[0]} {math.degrees(chosen.start_rad[0]):.1f} deg"
    if chosen.keyhole_s > 0.0:
        deep = "more than " if chosen.peak_loss_db >= SIDELOBE_DB else ""
        how = (
            "unwinds in the pass"
            if chosen.turned
            else "waits at the stop"
            if chosen.at_stop
            else "crosses the keyhole at its limits"
            if not mount.level
            else "crosses the zenith at its limits"
        )
        verdict += (
            f"; {how}: {chosen.keyhole_s:.1f} s off target, {chosen.lost_s:.1f} s below half "
            f"power, up to {deep}{chosen.peak_loss_db:.1f} dB"
        )
    if chosen.late_s > 0.0:
        verdict += f"; arrives {chosen.late_s:.0f} s after acquisition"
    if chosen.acquisition_s > 0.0:
        verdict += f"; {chosen.acquisition_s:.0f} s expected until a sensor holds the target"
    if certificate.acquisition_band:
        verdict += f", acquired in the {certificate.acquisition_band} band"
    for fixed in certificate.machine.fixed_elevation_rad:
        verdict += f"; elevation fixed at {math.degrees(fixed):.1f} deg: {chosen.lost_s:.0f} s below half power"
    verdict += f"; expected pointing loss {chosen.mean_loss_db:.2f} dB"
    if chosen.held_s is not None and chosen.held_90_s is not None and chosen.loss_90_db is not None:
        verdict += (
            f"; {chosen.held_s:.0f} s held, {chosen.held_90_s:.0f} s and at most {chosen.loss_90_db:.2f} dB with 90 %"
        )
        if chosen.fresh_held_90_s is not None and chosen.fresh_loss_90_db is not None:
            more_s, less_db = chosen.fresh_held_90_s - chosen.held_90_s, chosen.loss_90_db - chosen.fresh_loss_90_db
            if more_s >= WORTH_S or less_db >= WORTH_DB:
                verdict += f"; fresh elements would bring {max(more_s, 0.0):.0f} s and {max(less_db, 0.0):.2f} dB"
    if chosen.search_rate_rad_s and chosen.search_rate_rad_s != chosen.peak_rate_rad_s:
        verdict += f"; in a search up to {_pair(chosen.search_rate_rad_s)} deg/s"
    if certificate.carrier_to_noise_db_hz:
        least, most = certificate.carrier_to_noise_db_hz
        verdict += f", C/N0 {least:.1f} to {most:.1f} dB-Hz"
    return [*lines, verdict]


def certificate_values(certificate: Certificate) -> dict[str, Any]:
    """Return the certificate as names and plain values, angles in degrees."""
    values = _plain(certificate)
    values["accepted"], values["refusal"] = certificate.chosen is not None, certificate.reason
    values["branches"] = [
        {
            **_plain(branch), "refusals": list(branch.reasons), "works": branch.works,
            "chosen": branch is certificate.chosen,
        }
        for branch in certificate.branches
    ]  # fmt: skip
    values["machine"] = _plain(certificate.machine)
    if not certificate.mount.level:
        values["mount"] = _plain(certificate.mount)
    return values


def _plain(record: Any) -> dict[str, Any]:
    names = [item.name for item in dataclasses.fields(record) if item.name not in NOT_PLAIN]
    pairs = (to_degrees(name, getattr(record, name)) for name in names)
    return {name: list(value) if isinstance(value, tuple) else value for name, value in pairs}


def _row(branch: Branch) -> str:
    low, high = (math.degrees(value) for value in branch.azimuth_range_rad)
    bottom, top = (math.degrees(value) for value in branch.elevation_range_rad)
    limit = f"{math.degrees(branch.limit_margin_rad):.2f} deg to {branch.closest_limit}"
    return (
        f"{branch.label:<17}{f'{low:.1f} to {high:.1f}':>17}{f'{bottom:.1f} to {top:.1f}':>16}"
        f"{_pair(branch.peak_rate_rad_s):>18} {limit:>34}"
        f"{math.degrees(branch.mask_margin_rad):>7.2f}{math.degrees(branch.sun_margin_rad):>7.1f}"
        f"{branch.keyhole_s:>7.1f} s{branch.lost_s:>6.1f} s{branch.preposition_s:>5.0f} s{branch.unwind_s:>6.0f} s"
    )


def _pair(values: tuple[float, ...]) -> str:
    return " ".join(f"{math.degrees(value):.3g}" for value in values)
