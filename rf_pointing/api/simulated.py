"""One simulated pass as a log in millidegrees, with its statistics and as a table."""

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import MDEG, utc_text
from rf_pointing.simulation import PassLog

if TYPE_CHECKING:
    from rf_pointing.api.passes import StationPass

CLUSTER_S = 0.1
"""Time between two samples of the log."""


@dataclass(frozen=True, eq=False)
class SimulatedPass:
    """Result of a simulated pass, ten samples a second; `log` has it in radians."""

    one: "StationPass"
    sensor: str
    log: PassLog = field(repr=False)

    def errors_mdeg(self, *modes: str) -> NDArray[np.float64]:
        """Return the true pointing errors (n, 2): cross-elevation and elevation, in millidegrees.

        Those of the samples in `modes` ("monopulse", "program", ...), of all when none is named.
        ValueError without a sample, with the fault that ended the pass: an unstable loop has no
        error that could be averaged.
        """
        errors = self.log.errors_rad(*modes) / MDEG
        if not len(errors):
            spent = ", ".join(f"{mode} {time_s:.1f} s" for mode, time_s in self.seconds.items())
            fault = f"; the antenna stopped: {self.log.fault}" if self.log.fault else ""
            raise ValueError(f"no sample in {', '.join(modes) or 'the pass'}; there are {spent or 'none'}{fault}")
        return errors

    def rms_mdeg(self, *modes: str) -> tuple[float, float]:
        """Return the rms error in cross-elevation and elevation; ValueError without a sample."""
        errors = self.errors_mdeg(*modes)
        cross, elevation = np.sqrt(np.mean(errors**2, axis=0)).tolist()
        return cross, elevation

    @property
    def seconds(self) -> dict[str, float]:
        """Time spent in each mode, in the order in which they began."""
        return {mode: CLUSTER_S * count for mode, count in Counter(self.log.mode).items()}

    def table(self) -> dict[str, NDArray[Any]]:
        """Return the samples as columns (n,): time, mode, errors, carrier over noise density."""
        cross, elevation = self.errors_mdeg().T
        return {
            "t_s": np.array(self.log.t_s), "mode": np.array(self.log.mode),
            "cross_elevation_mdeg": cross, "elevation_mdeg": elevation,
            "carrier_to_noise_db_hz": np.array(self.log.carrier_to_noise_db_hz),
        }  # fmt: skip

    def to_pandas(self) -> Any:
        """Return the same as a DataFrame with the times (UTC) as its index; needs pandas."""
        import pandas

        columns = self.table()
        index = pandas.to_datetime([utc_text(t_s) for t_s in columns["t_s"].tolist()], utc=True)
        return pandas.DataFrame(columns, index=index.rename("utc"))
