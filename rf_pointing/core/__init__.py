"""Bottom layer: angles, checks, parameter sets, random streams, and the signals of a station."""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.core.angles import (
        MDEG,
        angular_distance_rad,
        azel_from_unit_vector,
        nearest_turn_rad,
        sky_offset_rad,
        unit_vector_from_azel,
        wrap_rad,
    )
    from rf_pointing.core.checks import (
        LONGEST_NAME,
        Line,
        as_finite_array,
        as_finite_pair,
        brief,
        id_of,
        is_number,
        name_of,
        names_in,
        one_of,
        require_between,
        require_choice,
        require_finite,
        require_id,
        require_name,
    )
    from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M, MU, SPEED_OF_LIGHT_M_S
    from rf_pointing.core.dates import DAY_S, from_utc_text, parse_utc, to_utc_text, utc_text
    from rf_pointing.core.derived import BandNumbers, Rows, Value, rounded, tuned
    from rf_pointing.core.hermite import Motion, Quintic
    from rf_pointing.core.kinematics import LEVEL, UP, Kinematics, mount_from_notes, mount_to_notes
    from rf_pointing.core.modes import Mode, Sensor
    from rf_pointing.core.mount_types import AZIMUTH_ELEVATION, axes_among
    from rf_pointing.core.parameters import (
        Params,
        flat,
        from_degrees,
        leaves,
        parameter,
        parameter_unit,
        read_parameter_files,
        to_degrees,
        with_leaves,
    )
    from rf_pointing.core.pass_outcome import (
        LEAST_SHARE,
        LOSS_OF_SIGNAL,
        OF_ANTENNA,
        SCANNED,
        SIDELOBE_DB,
        PassOutcome,
        gaussian_gain,
        gaussian_loss_db,
        received_power,
    )
    from rf_pointing.core.random_streams import random_stream
    from rf_pointing.core.refraction import RadioRefraction
    from rf_pointing.core.roots import bracketed_root
    from rf_pointing.core.signals import (
        AXES,
        BASE,
        BEAM,
        DESIGNATED,
        STANDBY,
        STANDBY_ROLE,
        Boresight,
        CarrierPower,
        HeldDirection,
        JointReading,
        JointTrajectory,
        MonopulseCluster,
        PointingError,
        SkyUncertainty,
        Target,
    )
    from rf_pointing.core.types import TURN, Array, BoolArray, ComplexArray, IntArray, Pair
    from rf_pointing.core.whole_file import (
        DATA_BYTES,
        JOURNAL_BYTES,
        KeptState,
        parse_json,
        parse_yaml,
        read_whole,
        write_whole,
    )

__getattr__ = lazily(__name__, __file__)
