"""The choices of a fit."""

from dataclasses import dataclass

from rf_pointing.core import Params, parameter, require_finite

__all__ = ["FitOptions", "Prior"]


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


@dataclass(frozen=True, kw_only=True)
class FitOptions(Params):
    """How the fit treats its data.

    `covariance` "white" takes the stated sigmas as independent noise; "sandwich" measures how the errors of a pass
    hang together (it needs many passes, edited beforehand).
    """

    form: str = parameter("printed", "model form: SATCAL (1)-(2) or exact rotations", choices=("printed", "rotation"))
    edit_sigma: float = parameter(3.0, "residuals beyond this many sigma are left out; 0: none", low=0.0, high=100.0)
    huber_sigma: float = parameter(0.0, "residuals beyond this many sigma count linearly; 0: squared", low=0.0, high=10)
    max_iterations: int = parameter(40, "bound of the editing and linearisation loop", low=1, high=1000)
    covariance: str = parameter("white", "how sigma is computed", choices=("white", "sandwich"))
    fewest_passes: int = parameter(3, "fewer passes are refused unless every term has a prior", low=1, high=1000)
    most_edited: float = parameter(
        0.33,
        "largest share of the observations that may be edited out; beyond it the data are refused",
        low=0.0,
        high=1.0,
    )
    scale_covariance: bool = parameter(False, "multiply the white covariance by the measured residual variance")

    def check_together(self) -> None:
        """Refuse editing before a sandwich: it cuts off the correlated errors that the sandwich has to measure."""
        if self.covariance == "sandwich" and self.edit_sigma > 0.0:
            raise ValueError(
                f"edit_sigma={self.edit_sigma} must be 0 with covariance='sandwich': edit in the pipeline beforehand, "
                "or sigma comes out up to 1.7 times too small"
            )
