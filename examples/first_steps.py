"""A pass, a pointing correction and a slew: scripts/run-python examples/first_steps.py."""

from math import degrees, radians

from rf_pointing.calibration import read_model
from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris import (
    TopocentricTrack,
    find_elements,
    first_pass_above,
    site,
    verification_elements,
)
from rf_pointing.planning import MachineParams
from rf_pointing.station.description import STATIONS

elements = find_elements(verification_elements(), "CBERS 2")
track = TopocentricTrack(elements, site("Goldstone DSS-13"))
found = first_pass_above(track, elements.epoch_t_s, radians(40.0), radians(5.0), 86400.0)
print(f"pass: {utc_text(found.aos_t_s)}, peak {degrees(found.peak_elevation_rad):.1f} deg")

look = track.sample([found.tca_t_s])
motion = (look.azimuth_rate_rad_s, look.elevation_rate_rad_s, 0.0, 0.0)
model = read_model(STATIONS / "bias_model_dss13_x.yaml").model
azimuth, elevation = model.offset_rad(look.azimuth_rad, look.elevation_rad, *motion)
print(f"correction: {degrees(azimuth[0]):+.3f} and {degrees(elevation[0]):+.3f} deg")

start = (found.aos_azimuth_rad, found.aos_elevation_rad)
slew_s = MachineParams().slew_s((0.0, radians(60.0)), start)
print(f"slew from azimuth 0, elevation 60 deg: {slew_s:.0f} s")
