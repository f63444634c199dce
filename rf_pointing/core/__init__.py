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
        as_finite_array,
        as_finite_pair,
        require_between,
        require_choice,
        require_finite,
    )
    from rf_pointing.core.constants import MU
    from rf_pointing.core.hermite import Motion, Quintic
    from rf_pointing.core.modes import Mode, Sensor
    from rf_pointing.core.parameters import (
        Params,
        from_degrees,
        leaves,
        parameter,
        parameter_unit,
        to_degrees,
        with_leaves,
    )
    from rf_pointing.core.pass_outcome import gaussian_gain, gaussian_loss_db
    from rf_pointing.core.random_streams import random_stream
    from rf_pointing.core.signals import (
        AXES,
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

__getattr__ = lazily(__name__, __file__)
