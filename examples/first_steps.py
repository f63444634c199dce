"""A pass, a pointing correction and a slew: scripts/run-python examples/first_steps.py."""

import rf_pointing as rp

station = rp.Station("dss13", band="X")
satellite = rp.elements("CBERS 2")
(found,) = station.passes(satellite, days=1, min_peak_deg=40.0)
print(f"pass: {found.aos_utc}, peak {found.peak_elevation_deg:.1f} deg")

look = station.look(satellite, at_t_s=found.tca_t_s)
print(f"correction: {look.azimuth_correction_deg:+.3f} and {look.elevation_correction_deg:+.3f} deg")

slew_s = station.slew_s(
    from_azimuth_deg=0.0, from_elevation_deg=60.0,
    to_azimuth_deg=found.aos_azimuth_deg, to_elevation_deg=found.aos_elevation_deg,
)  # fmt: skip
print(f"slew from azimuth 0, elevation 60 deg: {slew_s:.0f} s")
