"""Parameters of a receiver: where its signal comes from, what is measured, and how it is simulated.

Every node that checks the station's file loads them, and none of the libraries of the receiver.
"""

from dataclasses import dataclass

from rf_pointing.core import Params, parameter

CARRIER, BAND, PREAMBLE = "carrier", "band", "preamble"
DETECTORS = (CARRIER, BAND, PREAMBLE)
LEVEL_KINDS = ("dbm", "c_n0_db_hz", "es_n0_db")
LEVELS = ("scpi", "rigctl", "level")
"""Receivers that give levels, not samples."""
COMMAND = "command"
LARGEST_DB = 300.0
UNKNOWN_FLOOR_DBM = -200.0
OUTLET_FORMATS = ("rtl_tcp", "vita49", "zmq", "sigmf")
MODULATIONS = ("cw", "bpsk", "qpsk", "fm")
SAMPLE_FORMATS = ("cf32", "ci16", "ci8", "cu8")


@dataclass(frozen=True, kw_only=True)
class SourceLinkParams(Params):
    """How the source is reached, and how long it may be silent."""

    host: str = parameter("localhost", "host of the source; of UDP, the address to receive on")
    port: int = parameter(1234, "its TCP or UDP port", 1, 65535)
    device: str = parameter(
        "", "serial port, e.g. /dev/ttyUSB0, or the arguments of an SDR; empty: over the network"
    )
    baud: int = parameter(9600, "speed of the serial port", 50, 4_000_000)
    file: str = parameter("", "recording: the .sigmf-meta file")
    latency_s: float = parameter(
        0.0, "time from the antenna to the arrival of a sample or level without a time stamp", 0.0,
        10.0,
    )  # fmt: skip
    silence_s: float = parameter(
        1.0, "time without a sample after which the source is lost", 0.1, 60.0
    )
    first_retry_s: float = parameter(0.5, "wait before the first attempt to reconnect", 0.05, 60.0)
    longest_retry_s: float = parameter(
        5.0, "longest wait; it doubles from attempt to attempt", 0.05, 3600.0
    )

    ordered = ("first_retry_s <= longest_retry_s",)


@dataclass(frozen=True, kw_only=True)
class IqParams(Params):
    """The samples of a software-defined radio."""

    rate_hz: float = parameter(2.4e6, "complex samples per second", 8e3, 1e8)
    format: str = parameter(
        "cf32", "samples over ZMQ: cf32, ci16, ci8 or cu8", choices=SAMPLE_FORMATS
    )
    centre_mhz: float = parameter(
        0.0, "frequency at the middle of the spectrum; 0: that of the band", 0.0, 400000.0
    )
    converter_mhz: float = parameter(
        0.0, "frequency that LNB or converter takes off before the radio", -400000.0, 400000.0
    )
    gain_db: float = parameter(30.0, "gain that rtl_tcp and soapy set", 0.0, 100.0)
    clock_ppm: float = parameter(
        0.0, "error of the radio's clock, positive when it is fast", -300.0, 300.0
    )
    swapped: bool = parameter(
        False, "whether the converter turns the spectrum over (its oscillator is above)"
    )


@dataclass(frozen=True, kw_only=True)
class SignalSearchParams(Params):
    """The signal that is looked for in the samples, and how."""

    kind: str = parameter(
        CARRIER, "carrier: a line; band: total power; preamble: a known sequence", choices=DETECTORS
    )
    uncertainty_hz: float = parameter(
        20e3, "half the range in which the signal is searched around its predicted frequency", 10.0,
        1e7,
    )  # fmt: skip
    loop_bandwidth_hz: float = parameter(8.0, "noise bandwidth of the phase-locked loop", 0.5, 15.0)
    band_hz: float = parameter(20e3, "bandwidth whose power is measured (band)", 100.0, 5e7)
    lock_sigmas: float = parameter(
        5.0, "level over the noise at which a signal counts as found", 3.0, 30.0
    )
    noise_time_constant_s: float = parameter(2.0, "averaging time of the noise density", 0.1, 100.0)
    preamble: str = parameter("", "symbols of the sequence: 0 and 1 (BPSK), or 0 to 3 (QPSK)")
    symbol_rate_hz: float = parameter(1e4, "symbols per second of preamble or modem", 1.0, 1e8)
    channels: int = parameter(
        1, "1: sum; 3: sum and the differences cross-elevation and elevation", 1, 3
    )


@dataclass(frozen=True, kw_only=True)
class LevelParams(Params):
    """A level that a beacon receiver, modem, analyser or power meter reports."""

    kind: str = parameter(
        "dbm", "what the number is: dbm, c_n0_db_hz or es_n0_db", choices=LEVEL_KINDS
    )
    pattern: str = parameter(
        r"(?P<level>[-+]?\d+(\.\d+)?)",
        "regular expression with the group level, and lock where there is one",
    )
    locked: str = parameter("1", "text of the group lock that means a lock")
    request: str = parameter(
        "", "line that requests the level, or command; empty: it comes by itself (scpi: the usual)"
    )
    transport: str = parameter(
        "udp",
        "how `level` comes; command: a program prints it (snmpget)",
        choices=("udp", "tcp", "serial", COMMAND),
    )
    scale_db: float = parameter(1.0, "dB of one unit of the number", -100.0, 100.0)
    offset_db: float = parameter(0.0, "level in dB at the number 0", -500.0, 500.0)
    sigma_db: float = parameter(
        0.0, "standard deviation of one level; 0: from the scatter of the levels", 0.0, 20.0
    )
    floor_dbm: float = parameter(
        -200.0, "noise without a signal (dbm); -200: unknown", -200.0, 100.0
    )
    bandwidth_hz: float = parameter(1e4, "noise bandwidth of the measurement (dbm)", 1.0, 1e9)

    def db(self, value: float) -> float:
        """Return the level in dB that a number means; ValueError for what no receiver measures."""
        found = self.offset_db + self.scale_db * value
        if not abs(found) <= LARGEST_DB:
            raise ValueError(f"a level of {found:g} dB must be within {LARGEST_DB:.0f} dB of 0")
        return found


@dataclass(frozen=True, kw_only=True)
class SignalReceiverParams(Params):
    """A receiver: its source, and what is measured."""

    type: str = parameter(
        "simulated",
        "where the signal comes from: simulated, rtl_tcp, soapy, sigmf, zmq, vita49, scpi, rigctl, "
        "level, topic, or one of an entry point",
    )
    options: str = parameter("", "text for a receiver of one's own")
    period_s: float = parameter(0.1, "time between two carrier powers", 0.06, 10.0)
    frequency_hz: float = parameter(8.45e9, "frequency of the carrier", 1e6, 4e11)
    system_noise_k: float = parameter(
        120.0, "system noise temperature for powers in watts", 1.0, 1e4
    )
    link: SourceLinkParams = parameter(SourceLinkParams(), "how the source is reached")
    iq: IqParams = parameter(IqParams(), "samples of a radio")
    signal: SignalSearchParams = parameter(SignalSearchParams(), "what is measured in samples")
    level: LevelParams = parameter(LevelParams(), "what a reported level means")

    @property
    def level_known(self) -> bool:
        """Whether the C/N0 is one: a power without its noise is not."""
        level = self.level
        return self.type not in LEVELS or level.kind != "dbm" or level.floor_dbm > UNKNOWN_FLOOR_DBM


@dataclass(frozen=True, kw_only=True)
class OscillatorParams(Params):
    """Word lengths of an oscillator."""

    phase_bits: int = parameter(14, "phase bits that address the table", 2, 20)
    dithers: int = parameter(1, "uniform dithers of the phase", 0, 4)
    amplitude_bits: int = parameter(0, "bits of the output; 0: not reduced", 0, 24)
    table_bits: int = parameter(0, "bits of the table; 0: not reduced", 0, 24)


@dataclass(frozen=True, kw_only=True)
class GeneratorParams(Params):
    """A transmitter and a radio."""

    rate_hz: float = parameter(2.4e6, "complex samples per second", 8e3, 1e8)
    clock_ppm: float = parameter(
        0.0, "error of the radio's clock, positive when it is fast", -300.0, 300.0
    )
    modulation: str = parameter("cw", "modulation of the carrier", choices=MODULATIONS)
    symbol_rate_hz: float = parameter(
        1e4, "symbols per second; of fm, the frequency of the tone", 1.0, 1e7
    )
    roll_off: float = parameter(
        0.35, "roll-off of the symbols' root-raised-cosine pulses", 0.05, 1.0
    )
    deviation: float = parameter(2.0, "modulation index of fm", 0.1, 20.0)
    channels: int = parameter(1, "1: sum; 3: sum and differences", 1, 3)
    noise_dbfs: float = parameter(-30.0, "noise of a channel below full scale", -90.0, 10.0)
    bits: int = parameter(8, "bits of the converter; 0: none", 0, 16)
    line_offset_hz: float = parameter(5e3, "interfering line, from the carrier", -1e6, 1e6)
    line_db_hz: float = parameter(-100.0, "its C/N0; -100: none", -100.0, 120.0)
    oscillator: OscillatorParams = parameter(OscillatorParams(), "oscillator of the carrier")
    seed: int = parameter(1, "seed of every noise source", 0, 2**31 - 1)


@dataclass(frozen=True, kw_only=True)
class OutletParams(Params):
    """How generated samples are served."""

    format: str = parameter("rtl_tcp", "how samples are served", choices=OUTLET_FORMATS)
    host: str = parameter("127.0.0.1", "address to serve on; of vita49, where to send to")
    port: int = parameter(1234, "port to serve on, or to send to", 1, 65535)
    file: str = parameter("", "recording to write (sigmf), unless it exists: its .sigmf-meta file")
