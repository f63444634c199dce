"""How far the target is off the beam: the trackers, the searches and the state table."""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.tracking.autotrack import Autotrack, AutotrackInputs, AutotrackParams, AutotrackState
    from rf_pointing.tracking.lock_watch import LockWatch, LockWatchParams
    from rf_pointing.tracking.monopulse import MonopulseParams, MonopulseTracker
    from rf_pointing.tracking.monopulse_scan import MonopulseScanParams
    from rf_pointing.tracking.search import SpiralParams, SpiralSearch, StripSearch
    from rf_pointing.tracking.steptrack import StepTrackParams
    from rf_pointing.tracking.trim import (
        SkyMotion,
        TrackPath,
        TrimFilter,
        TrimParams,
        direction_rows,
        prior_for,
        prior_of,
    )

__getattr__ = lazily(__name__, __file__)
