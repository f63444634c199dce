"""Reported levels to carrier powers: dBm of a meter, C/N0 or Es/N0 of a modem.

    C/N0 = Es/N0 + 10 log R         (R symbols per second)
    C/N0 = (P - F) / F * B          (P power in the bandwidth B, F the same without a signal)

Where F is unknown, P stands for C: its changes are right, and the C/N0 is a level of its own scale.
The standard deviation is stated, or that of successive levels and half a step of the display.
"""

import math

from rf_pointing.core import CarrierPower
from rf_pointing.receiver.params import UNKNOWN_FLOOR_DBM, SignalReceiverParams
from rf_pointing.receiver.source import Level
from rf_pointing.rf.noise import BOLTZMANN_J_K

NEPER = 0.1 * math.log(10.0)
"""Relative change of a power per dB."""
SCATTER_LEVELS = 100
FEWEST = 8
FIRST_SIGMA_DB = 1.0
USUAL_STEP_DB = 0.1
LEVELS_DB_HZ = 0.0, 140.0


class LevelMeter:
    """Averages levels over a period; `take` returns the powers that are complete."""

    def __init__(self, params: SignalReceiverParams) -> None:
        self.params = params
        self.locked = True
        self.unlocked = 0
        self._levels: list[Level] = []
        self._before: tuple[float, float] | None = None
        self._scatter, self._count, self._step_db = 0.0, 0, math.inf

    def take(self, level: Level) -> list[CarrierPower]:
        """Take a level; one that comes late is left out, and so is what cannot be one."""
        found: list[CarrierPower] = []
        try:
            db = self.params.level.db(level.value)
        except ValueError:
            return []
        period_s = self.params.period_s
        if self._levels:
            if level.t_s <= self._levels[-1].t_s:
                return []
            if math.floor(level.t_s / period_s) != math.floor(self._levels[-1].t_s / period_s):
                found = [self._power()]
        if level.locked is not None:
            self.locked = level.locked
            self.unlocked += not level.locked
        self._levels.append(level)
        self._note(db)
        return found

    def _note(self, db: float) -> None:
        """Note how a level differs from the two before: a slow change has no second difference."""
        before = self._before
        if before is not None:
            if db != before[1]:
                self._step_db = min(self._step_db, abs(db - before[1]))
            self._count += 1
            share = max(1.0 / SCATTER_LEVELS, 1.0 / self._count)
            self._scatter += share * ((before[0] - 2.0 * before[1] + db) ** 2 / 6.0 - self._scatter)
        self._before = (db, db) if before is None else (before[1], db)

    @property
    def sigma_db(self) -> float:
        """Standard deviation of one level."""
        if self.params.level.sigma_db > 0.0:
            return self.params.level.sigma_db
        if self._count < FEWEST:
            return FIRST_SIGMA_DB
        # A display that has not moved yet says nothing of its step.
        step_db = self._step_db if math.isfinite(self._step_db) else USUAL_STEP_DB
        return math.hypot(math.sqrt(self._scatter), step_db / math.sqrt(12.0))

    def ratio_hz(self, db: float) -> float:
        """Return C/N0 in hertz that a level in dB means; below 0 where it is below the floor."""
        level = self.params.level
        if level.kind == "es_n0_db":
            return float(10.0 ** (0.1 * db) * self.params.signal.symbol_rate_hz)
        if level.kind == "c_n0_db_hz":
            return float(10.0 ** (0.1 * db))
        power_w = 10.0 ** (0.1 * (db - 30.0))
        if level.floor_dbm <= UNKNOWN_FLOOR_DBM:
            return float(power_w / (BOLTZMANN_J_K * self.params.system_noise_k))
        return float((10.0 ** (0.1 * (db - level.floor_dbm)) - 1.0) * level.bandwidth_hz)

    def _slope(self, ratio_hz: float) -> float:
        """Return the change of the ratio per dB of the level."""
        level = self.params.level
        known = level.kind == "dbm" and level.floor_dbm > UNKNOWN_FLOOR_DBM
        return NEPER * (ratio_hz + level.bandwidth_hz if known else ratio_hz)

    def _power(self) -> CarrierPower:
        levels, self._levels = self._levels, []
        values = [self.params.level.db(each.value) for each in levels]
        ratios = [self.ratio_hz(db) for db in values]
        ratio_hz = sum(ratios) / len(ratios)
        slope = self._slope(max(ratio_hz, 0.0))
        watts = BOLTZMANN_J_K * self.params.system_noise_k
        shown = ratio_hz if self.locked else 0.0
        low, high = LEVELS_DB_HZ
        return CarrierPower(
            t_s=levels[-1].t_s,
            # A device integrates about as long as it takes from level to level.
            integration_s=max(
                levels[-1].t_s - levels[0].t_s, self.params.period_s / max(len(levels), 1)
            ),
            power_w=max(ratio_hz, 0.0) * watts,
            sigma_w=slope * self.sigma_db / math.sqrt(len(levels)) * watts,
            carrier_to_noise_db_hz=min(max(10.0 * math.log10(max(shown, 1e-9)), low), high),
        )
