"""BWG and DSS13-ID recomputed: every number of the two articles that one plant can answer for.

The plant, its fitted parameters and what cannot hold at once are described in docs/math/plant.md
and controllers.md.
"""

from rf_pointing.papers.row import Row
from rf_pointing.papers.servo_feedforward import feedforward_rows
from rf_pointing.papers.servo_identification import identification_rows
from rf_pointing.papers.servo_monopulse import monopulse_rows
from rf_pointing.papers.servo_noise import noise_rows
from rf_pointing.papers.servo_wind import wind_rows


def rows(seed: int = 1) -> list[Row]:
    """Return the rows, measured now; `seed` sets noise and wind."""
    return [
        *feedforward_rows(),
        *monopulse_rows(),
        *noise_rows(seed),
        *wind_rows(seed),
        *identification_rows(seed),
    ]
