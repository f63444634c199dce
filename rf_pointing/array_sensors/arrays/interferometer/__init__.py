"""Polarized interferometer: relative position and attitude of two spacecraft from carrier phases and polarisation.

An array of three elements and a centre on each spacecraft, nine carriers in sequence, nine two-way ranges and four
polarisation couplings (PI83).  Design chain: `design`, `design_tables`, `link`, `mixer`; estimation: `initialize`,
`track`; over time: `InterferometerSource`, `InterferometerTracker`.
"""

from rf_pointing.array_sensors.arrays.interferometer.ambiguity_probability import (
    chain_error_rate,
    lane_sigma,
    required_ratio,
    step_error_probability,
    total_error_probability,
)
from rf_pointing.array_sensors.arrays.interferometer.ambiguity_resolution import (
    ResolvedRanges,
    carrier_range,
    resolve_ranges,
    sharpened_ranges,
)
from rf_pointing.array_sensors.arrays.interferometer.array_geometry import (
    ArrayParams,
    element_positions,
    path_lengths,
    two_way_ranges,
)
from rf_pointing.array_sensors.arrays.interferometer.carriers import (
    REPORT_SPEED_OF_LIGHT_M_S,
    CarrierPlan,
    carrier_phases,
    frequency_ratio,
)
from rf_pointing.array_sensors.arrays.interferometer.coupling import (
    coupling_amplitudes,
    elevation_from_polarisation,
    roll_from_polarisation,
)
from rf_pointing.array_sensors.arrays.interferometer.design import (
    Requirements,
    SystemDesign,
    amplitude_ripple_db,
    carrier_tracking_design,
    difference_tracking_design,
    direction_requirement_m,
    largest_phase_bias_rad,
    minimum_difference_hz,
    phase_sigma_rad,
    range_requirement_m,
    roll_requirement_snr,
)
from rf_pointing.array_sensors.arrays.interferometer.design_tables import (
    CarrierCountRow,
    carrier_count_row,
    carrier_count_table,
    cycle_error_table,
    link_powers_w,
)
from rf_pointing.array_sensors.arrays.interferometer.direction_finding import (
    forward_direction,
    reverse_direction_from_ranges,
)
from rf_pointing.array_sensors.arrays.interferometer.frames import (
    attitude_from_euler,
    direction_from_angles,
    euler_from_attitude,
    forward_angles,
    frame_rotation,
    rep103_from_spacecraft,
    reverse_angles,
    rotation_vector,
    spacecraft_from_rep103,
)
from rf_pointing.array_sensors.arrays.interferometer.initializer import (
    Geometry,
    aperture_excess,
    geometry_from_pose,
    initialize,
)
from rf_pointing.array_sensors.arrays.interferometer.link import (
    LinkParams,
    ReturnLink,
    link_snr,
    nonlinear_reflector,
    path_loss,
    required_power_w,
    simple_repeater,
)
from rf_pointing.array_sensors.arrays.interferometer.measurement import InterferometerMeasurement
from rf_pointing.array_sensors.arrays.interferometer.mixer import exponential_line, product_code, square_law_lines
from rf_pointing.array_sensors.arrays.interferometer.mixer_noise import mixed_powers_w, mixed_snr
from rf_pointing.array_sensors.arrays.interferometer.monte_carlo import LISTING, TrialErrors, run_trials
from rf_pointing.array_sensors.arrays.interferometer.motion import (
    DockingApproach,
    RelativeMotion,
    crude_attitude_rate,
    crude_velocity,
    moved,
)
from rf_pointing.array_sensors.arrays.interferometer.range_accuracy import (
    RangeNoise,
    phase_variance,
    range_covariance,
    range_noise,
    range_variance_from_nine,
    two_way_phase_variance,
    two_way_range_sigma,
)
from rf_pointing.array_sensors.arrays.interferometer.rate_filter import FilterParams, FilterState
from rf_pointing.array_sensors.arrays.interferometer.reading import ErrorFloor, Reading, read_ranges
from rf_pointing.array_sensors.arrays.interferometer.relative_pose import (
    RelativePose,
    TwoWayPose,
    attitude_from_directions,
    attitude_from_two_way,
    pose_from_two_way,
    reverse_direction,
    roll_from_directions,
    two_way_from_attitude,
    two_way_from_pose,
)
from rf_pointing.array_sensors.arrays.interferometer.rep103 import Rep103Pose, rep103_pose
from rf_pointing.array_sensors.arrays.interferometer.rf_simulation import (
    RadioParams,
    simulate_amplitudes,
    simulate_phases,
)
from rf_pointing.array_sensors.arrays.interferometer.schedule import Schedule
from rf_pointing.array_sensors.arrays.interferometer.sensitivity import (
    chord_variance,
    direction_variance,
    roll_variance,
    sum_range_bias_m,
)
from rf_pointing.array_sensors.arrays.interferometer.snapshot import Snapshot
from rf_pointing.array_sensors.arrays.interferometer.source import InterferometerSource
from rf_pointing.array_sensors.arrays.interferometer.system import InterferometerSystem
from rf_pointing.array_sensors.arrays.interferometer.tracker import (
    InterferometerTracker,
    PoseEstimate,
    TrackerOutput,
    TrackerParams,
    TrackerState,
)
from rf_pointing.array_sensors.arrays.interferometer.tracking_filter import SequenceParams, track, track_once
from rf_pointing.array_sensors.arrays.interferometer.tracking_steps import (
    direction_step,
    excitation_step,
    range_step,
    roll_step,
)
from rf_pointing.array_sensors.arrays.interferometer.transponder import (
    ANTENNAS,
    AVOIDED_BANDS_HZ,
    TRANSPONDERS,
    Antenna,
    Transponder,
    antennas_for_cone,
    choose_transponder,
    frequency_conflicts,
    range_rate_from_offsets,
)
from rf_pointing.array_sensors.arrays.interferometer.variant import CORRECTED, PUBLISHED

__all__ = [
    "ANTENNAS",
    "AVOIDED_BANDS_HZ",
    "CORRECTED",
    "LISTING",
    "PUBLISHED",
    "REPORT_SPEED_OF_LIGHT_M_S",
    "TRANSPONDERS",
    "Antenna",
    "ArrayParams",
    "CarrierCountRow",
    "CarrierPlan",
    "DockingApproach",
    "ErrorFloor",
    "FilterParams",
    "FilterState",
    "Geometry",
    "InterferometerMeasurement",
    "InterferometerSource",
    "InterferometerSystem",
    "InterferometerTracker",
    "LinkParams",
    "PoseEstimate",
    "RadioParams",
    "RangeNoise",
    "Reading",
    "RelativeMotion",
    "RelativePose",
    "Rep103Pose",
    "Requirements",
    "ResolvedRanges",
    "ReturnLink",
    "Schedule",
    "SequenceParams",
    "Snapshot",
    "SystemDesign",
    "TrackerOutput",
    "TrackerParams",
    "TrackerState",
    "Transponder",
    "TrialErrors",
    "TwoWayPose",
    "amplitude_ripple_db",
    "antennas_for_cone",
    "aperture_excess",
    "attitude_from_directions",
    "attitude_from_euler",
    "attitude_from_two_way",
    "carrier_count_row",
    "carrier_count_table",
    "carrier_phases",
    "carrier_range",
    "carrier_tracking_design",
    "chain_error_rate",
    "choose_transponder",
    "chord_variance",
    "coupling_amplitudes",
    "crude_attitude_rate",
    "crude_velocity",
    "cycle_error_table",
    "difference_tracking_design",
    "direction_from_angles",
    "direction_requirement_m",
    "direction_step",
    "direction_variance",
    "element_positions",
    "elevation_from_polarisation",
    "euler_from_attitude",
    "excitation_step",
    "exponential_line",
    "forward_angles",
    "forward_direction",
    "frame_rotation",
    "frequency_conflicts",
    "frequency_ratio",
    "geometry_from_pose",
    "initialize",
    "lane_sigma",
    "largest_phase_bias_rad",
    "link_powers_w",
    "link_snr",
    "minimum_difference_hz",
    "mixed_powers_w",
    "mixed_snr",
    "moved",
    "nonlinear_reflector",
    "path_lengths",
    "path_loss",
    "phase_sigma_rad",
    "phase_variance",
    "pose_from_two_way",
    "product_code",
    "range_covariance",
    "range_noise",
    "range_rate_from_offsets",
    "range_requirement_m",
    "range_step",
    "range_variance_from_nine",
    "read_ranges",
    "rep103_from_spacecraft",
    "rep103_pose",
    "required_power_w",
    "required_ratio",
    "resolve_ranges",
    "reverse_angles",
    "reverse_direction",
    "reverse_direction_from_ranges",
    "roll_from_directions",
    "roll_from_polarisation",
    "roll_requirement_snr",
    "roll_step",
    "roll_variance",
    "rotation_vector",
    "run_trials",
    "sharpened_ranges",
    "simple_repeater",
    "simulate_amplitudes",
    "simulate_phases",
    "spacecraft_from_rep103",
    "square_law_lines",
    "step_error_probability",
    "sum_range_bias_m",
    "total_error_probability",
    "track",
    "track_once",
    "two_way_from_attitude",
    "two_way_from_pose",
    "two_way_phase_variance",
    "two_way_range_sigma",
    "two_way_ranges",
]
