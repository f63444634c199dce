"""The result of a fit: terms, uncertainty, residuals, and the terms that stay correlated."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.noise import NoiseScale
from rf_pointing.calibration.normal_equations import advice_for
from rf_pointing.calibration.pass_errors import PassErrors, PassPriors, SharedErrors, Sharing
from rf_pointing.core import LEVEL, Array, BoolArray, IntArray, Kinematics, Pair, require_finite

# Correlation above which two fitted terms are reported as poorly separated.
HIGH_CORRELATION = 0.95


@dataclass(frozen=True)
class Prior:
    """Knowledge of one term before the data: value and standard deviation in the term's unit."""

    value: float
    sigma: float

    def __post_init__(self) -> None:
        require_finite("prior value", self.value)
        require_finite("prior sigma", self.sigma)
        if self.sigma <= 0.0:
            raise ValueError(f"prior sigma={self.sigma} must be > 0")


@dataclass(frozen=True, eq=False)
class Nuisance:
    """Unknowns that a whole campaign has in common besides the terms.

    `partials` (2, n, q) of azimuth and elevation, and the sigma (q,) of each before the data.
    """

    name: str
    partials: Array
    sigma: Array


@dataclass(frozen=True)
class Rejected:
    """One observation the fit left out: its row in the input, and why."""

    row: int
    pass_id: int
    reason: str


@dataclass(frozen=True, kw_only=True, eq=False)
class FitResult:
    """Result of `fit_bias_model`; angles in rad, lags in s and s^2, times in UTC seconds.

    `names` are the fitted terms, in the order of `values`, `sigma` (k,) and `covariance` (k, k);
    `held` are the fixed ones.  Residuals (n,) are observed minus modelled for every input row, the
    rejected ones included, after the pass errors `pass_azimuth_rad` and `pass_elevation_rad` (zero
    if none were estimated); `used` (n,) says which rows counted.  `variance_azimuth` and
    `variance_elevation` are the mean squared residuals over sigma, 1 for a right sigma; `noise`
    says the same of slow residuals, None where it was not measured.  `pass_rows` (g, w, w) are the
    equations of each pass (`fit_problem.FitProblem.pass_rows`), None without pass errors, and
    `pass_places` (g,) which of the passes of the data each is; `priors`
    those of the terms.  `shared` and `sharing` are the errors of the sets of elements, None where
    the passes have their own only.  `nuisances` are what the whole campaign has in common, with
    their values (q,) and covariance (q, q).
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    held: Mapping[str, float]
    form: str
    station: str
    band: str
    condition: float
    residual_azimuth_rad: Array
    residual_elevation_rad: Array
    pass_azimuth_rad: Array
    pass_elevation_rad: Array
    cos_elevation: Array
    used: BoolArray
    rejected: tuple[Rejected, ...]
    variance_azimuth: float
    variance_elevation: float
    first_t_s: float
    last_t_s: float
    passes: int
    pass_errors: tuple[PassErrors, ...]
    pass_priors: PassPriors | None
    noise: tuple[NoiseScale, NoiseScale] | None
    pass_rows: Array | None
    pass_places: IntArray
    shared: SharedErrors | None
    sharing: Sharing | None
    nuisances: tuple[Nuisance, ...]
    nuisance_values: Array
    nuisance_covariance: Array
    priors: Mapping[str, Prior]
    mount: Kinematics = LEVEL

    @cached_property
    def sigma(self) -> Array:
        """Return the standard deviations of `values`."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def correlation(self) -> Array:
        """Return the correlation matrix of `values`."""
        return self.covariance / np.outer(self.sigma, self.sigma)

    @property
    def orbit_sigma(self) -> Array:
        """Return the sizes of the passes' errors, those of their elements included."""
        own = self.pass_priors.sigma if self.pass_priors is not None else np.zeros(0)
        return np.hypot(own, self.shared.priors.sigma) if self.shared is not None else own

    @property
    def coefficients(self) -> dict[str, float]:
        """Return fitted and held terms by name."""
        return {**self.held, **dict(zip(self.names, (float(v) for v in self.values), strict=True))}

    @property
    def model(self) -> BiasModel:
        """Return the bias model with these coefficients."""
        return BiasModel(self.coefficients, self.mount)

    def sigma_of(self, name: str) -> float:
        """Return the standard deviation of one fitted term."""
        return float(self.sigma[self.names.index(name)])

    def inseparable(
        self, threshold: float = HIGH_CORRELATION
    ) -> tuple[tuple[str, str, float], ...]:
        """Return the pairs of terms whose correlation reaches `threshold`, the worst first."""
        rows, columns = np.triu_indices(len(self.names), 1)
        pairs = [
            (self.names[i], self.names[j], float(self.correlation[i, j]))
            for i, j in zip(rows.tolist(), columns.tolist(), strict=True)
            if abs(self.correlation[i, j]) >= threshold
        ]
        return tuple(sorted(pairs, key=lambda pair: -abs(pair[2])))

    def separation_advice(self, threshold: float = HIGH_CORRELATION) -> tuple[str, ...]:
        """Return one sentence per poorly separated pair, with the data that would separate it."""
        return tuple(
            f"{first} and {second} (correlation {value:+.3f}): add {advice_for((first, second))}"
            for first, second, value in self.inseparable(threshold)
        )

    def rms_rad(self) -> Pair:
        """Return the rms residual of the used rows on the sky: cross-elevation, elevation."""
        # On the sky: a degree of azimuth at 80 deg of elevation moves the beam by 0.17 deg.
        across = (self.residual_azimuth_rad * self.cos_elevation)[self.used]
        up = self.residual_elevation_rad[self.used]
        return float(np.sqrt(np.mean(across**2))), float(np.sqrt(np.mean(up**2)))
