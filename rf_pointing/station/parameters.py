"""Parameter sets of single nodes, without ROS, and those of controller and antenna.

The sets of the station's parts are declared where they are used; `derive/nodes.py` puts together
what each node has.
"""

import math
from dataclasses import dataclass
from ipaddress import ip_address
from typing import TYPE_CHECKING

from rf_pointing.core.angles import MDEG
from rf_pointing.core.modes import Sensor
from rf_pointing.core.parameters import Params, parameter

if TYPE_CHECKING:
    from rf_pointing.station.antenna.simulated_antenna import AntennaParams
    from rf_pointing.station.description import StationDescription
    from rf_pointing.station.pointing.params import ControllerParams


@dataclass(frozen=True, kw_only=True)
class ServoNodeParams(Params):
    """What is the node's own."""

    wrap_file: str = parameter("", "file that keeps the azimuth's turn over a restart; empty: not kept")
    state_file: str = parameter("", "file that keeps position, fault and rest over a restart; empty: not kept")
    enable_fault_injection: bool = parameter(False, "whether ~/inject_fault is offered")


@dataclass(frozen=True, kw_only=True)
class CommandKeyParams(Params):
    """Where the key of the commands is."""

    command_key_file: str = parameter(
        "", "file with the key that signs commands and calls; made if missing; empty: not signed"
    )


@dataclass(frozen=True, kw_only=True)
class PublisherParams(Params):
    """How far ahead and how often the target is published, and which passes count."""

    period_s: float = parameter(0.1, "time between two targets", low=0.02, high=10.0)
    lead_s: float = parameter(2.0, "how far ahead of its time a target is published", low=0.0, high=60.0)
    margin_s: float = parameter(5.0, "publishing begins before and ends after a pass by", low=0.0, high=600.0)
    mask_rad: float = parameter(math.radians(5.0), "elevation at which a pass begins and ends", low=0.0, high=1.5)
    span_s: float = parameter(86400.0, "how far ahead passes are looked for", low=60.0, high=2.6e6)
    state_file: str = parameter("", "file that keeps target, offsets and hold over a restart; empty: not kept")


@dataclass(frozen=True, kw_only=True)
class FileParams(Params):
    """Where the calibration is kept."""

    calibration_file: str = parameter("", "file of the feed's calibration; empty: none")


@dataclass(frozen=True, kw_only=True)
class ReceiverSeed(Params):
    """What differs from run to run."""

    seed: int = parameter(1, "seed of every noise source", low=0, high=2**31 - 1)


@dataclass(frozen=True, kw_only=True)
class CalibratorParams(Params):
    """Where the models live and how observations are taken."""

    folder: str = parameter("", "folder of models and observations; empty: none are kept after the node ends")
    keep_observations: bool = parameter(True, "whether observations are kept in the folder as well")
    model_file: str = parameter("", "model in force before one is accepted; empty: no correction")
    station: str = parameter("Goldstone DSS-13", "station that the model must belong to")
    band: str = parameter("X", "band that the model must belong to")
    spacing_s: float = parameter(1.0, "time between two observations", low=0.1, high=600.0)
    scan_spacing_s: float = parameter(
        8.0, "the same while the beam scans: estimates from the same window differ little", low=0.1, high=600.0
    )
    sigma_rad: float = parameter(
        2.0 * MDEG, "standard deviation of one observation on the sky, added to the sensor's own", low=1e-7, high=0.01
    )
    largest_error_rad: float = parameter(
        6.0 * MDEG, "sensed error above which nothing is observed: a tenth of a beamwidth", low=1e-7, high=0.1
    )
    settle_s: float = parameter(
        0.0, "time with a valid sensor before the first observation of a pass", low=0.0, high=600.0
    )


@dataclass(frozen=True, kw_only=True)
class ExecutiveParams(Params):
    """What belongs to the executive itself."""

    state_file: str = parameter("", "file that keeps the night over a restart; empty: not kept")
    folder: str = parameter("runs/night", "folder of recordings, journal and morning report")
    directives_file: str = parameter("", "further directives of the station (YAML); empty: the shipped ones")
    procedure_file: str = parameter("", "procedure of a pass (YAML); empty: the shipped one")
    recovery_file: str = parameter("", "recovery table (YAML); empty: the shipped one")
    sensor: str = parameter("", "sensor of passes that name none; empty: the station's")
    record: bool = parameter(True, "whether each pass is recorded and reported on")
    partners: str = parameter("", "namespaces of the antennas that share the schedule, separated by commas")


@dataclass(frozen=True, kw_only=True)
class HookParams(Params):
    """Where alarms go; empty: nowhere."""

    command: str = parameter("", "program that gets each message as JSON on its input; empty: none")
    webhook: str = parameter("", "http(s) address that each message is posted to as JSON; empty: none")
    mail_server: str = parameter("", "host:port of the SMTP server; empty: no e-mail")
    mail_from: str = parameter("station@localhost", "sender of the e-mails")
    mail_to: str = parameter("", "receivers of the e-mails, separated by commas")
    retry_s: float = parameter(5.0, "time between two tries to send", low=0.1, high=600.0)

    def check_together(self) -> None:
        """Refuse e-mail without a receiver, and addresses that are none."""
        if self.mail_server and not self.mail_to:
            raise ValueError(f"mail_to='' must name a receiver: mail_server={self.mail_server}")
        if self.mail_server and not self.mail_server.rpartition(":")[2].isdecimal():
            raise ValueError(f"mail_server={self.mail_server} must be host:port")
        if self.webhook and not self.webhook.startswith(("http://", "https://")):
            raise ValueError(f"webhook={self.webhook} must begin with http:// or https://")


@dataclass(frozen=True, kw_only=True)
class PageParams(Params):
    """Where the page is, and who may command."""

    address: str = parameter("127.0.0.1", "address to bind to; any but loopback needs token_file")
    port: int = parameter(8080, "TCP port; 0: any that is free", low=0, high=65535)
    hosts: str = parameter("", "further host names under which the page is reached, separated by commas")
    token_file: str = parameter("", "file (mode 600) with the token of commands; empty: one is made for this user")
    reports: str = parameter("runs", "folder whose reports are offered; empty: none")
    rate_hz: float = parameter(6.0, "how often what moves is sent to the viewers", low=1.0, high=20.0)
    viewers: int = parameter(50, "viewers at one time", low=1, high=1000)

    def check_together(self) -> None:
        """Refuse an address that others can reach without a token that somebody has chosen."""
        try:
            address = ip_address(self.address)
        except ValueError:
            raise ValueError(f"address={self.address} must be an IP address, as 127.0.0.1") from None
        if not address.is_loopback and not self.token_file:
            raise ValueError(
                f"address={self.address} can be reached by other computers: token_file='' must name the file of a token"
            )

    @property
    def names(self) -> set[str]:
        """The host names under which the page may be requested."""
        own = {"localhost", "127.0.0.1", "::1", self.address}
        return {name.lower() for name in (*own, *(each.strip() for each in self.hosts.split(","))) if name}


@dataclass(frozen=True, kw_only=True)
class RotctldNodeParams(Params):
    """How a recognised pass is tracked."""

    identify: bool = parameter(True, "whether points of a known satellite become its pass")
    sensor: str = parameter(Sensor.PROGRAM.value, "sensor of the passes; auto: the station's choice")


@dataclass(frozen=True, kw_only=True)
class ClockParams(Params):
    """Simulation time."""

    start_s: float = parameter(0.0, "UTC seconds since 1970 at which time starts", low=0.0, high=4.0e9)
    speed: float = parameter(1.0, "simulated seconds per second; 0: as fast as the graph follows", low=0.0, high=1e4)
    tick_s: float = parameter(0.02, "step of simulation time", low=0.001, high=1.0)


@dataclass(frozen=True, kw_only=True)
class ViewParams(Params):
    """What is drawn, and how often."""

    publish_tf: bool = parameter(
        True, "whether robot_description and the joints' transforms are published; false for robot_state_publisher"
    )
    radius_m: float = parameter(
        0.0, "radius of the sphere on which directions are drawn; 0: three diameters of the antenna", low=0.0, high=1e5
    )
    period_s: float = parameter(0.2, "time between two drawings of beam, target and Sun", low=0.2, high=10.0)


def controller_params(station: "StationDescription", band: str | None = None) -> "ControllerParams":
    """Return the parameter sets of the pointing controller; the default band if None."""
    from rf_pointing.station.pointing.params import ControllerParams

    return ControllerParams(**station.sets("pointing_controller", band))


def antenna_params(station: "StationDescription", band: str | None = None) -> "AntennaParams":
    """Return the parameter sets of the antenna's control unit; the default band if None."""
    from rf_pointing.station.antenna.simulated_antenna import AntennaParams

    return AntennaParams(**station.sets("antenna_servo", band))
