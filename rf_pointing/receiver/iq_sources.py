"""Sources of samples: rtl_tcp, SigMF recordings, GNU Radio over ZMQ, SoapySDR."""

import json
import os
import struct
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from rf_pointing.core import parse_utc, read_whole
from rf_pointing.receiver.source import CHUNK, WAIT_S, Arrival, ByteSource, Source
from rf_pointing.receiver.spectrum import Samples

RTL_MAGIC, RTL_HEADER = b"RTL0", 12
RTL_FREQUENCY, RTL_RATE, RTL_GAIN_MODE, RTL_GAIN, RTL_AGC = 1, 2, 3, 4, 8
PIECE_S = 0.02
SOON_S = 10.0
"""A recording that begins so soon is waited for."""
LARGEST = 1e9
"""Larger floats are garbage; the sum of their squares would overflow."""
FULL_SCALE: dict[str, tuple[Any, float]] = {
    "cu8": (np.dtype(np.uint8), 128.0),
    "ci8": (np.dtype(np.int8), 128.0),
    "ci16": (np.dtype("<i2"), 32768.0),
}


def decoded(data: bytes, kind: str, channels: int = 1) -> tuple[Samples, float]:
    """Return samples (channels, n), full scale 1, and the share at the ends of the scale.

    `kind` is a SigMF datatype without its byte order; channels are interleaved sample by sample.
    """
    if kind == "cf32":
        parts = np.frombuffer(data, dtype="<f4").astype(np.float32)
        # A stream of floats may be of any scale, and NaN would stay in every average.
        good = np.abs(parts) < LARGEST
        clipped = 1.0 - float(np.mean(good)) if len(parts) else 0.0
        if clipped:
            parts[~good] = 0.0
    else:
        dtype, scale = FULL_SCALE[kind]
        raw = np.frombuffer(data, dtype=dtype)
        ends = np.iinfo(dtype)
        clipped = float(np.count_nonzero((raw == ends.min) | (raw == ends.max))) / max(len(raw), 1)
        parts = raw.astype(np.float32)
        # Unsigned bytes have their zero between two values.
        parts -= np.float32(127.5 if kind == "cu8" else 0.0)
        parts *= np.float32(1.0 / scale)
    samples = parts.view(np.complex64).reshape(-1, channels).T
    return np.ascontiguousarray(samples), clipped


class RtlTcp(ByteSource):
    """`rtl_tcp`: unsigned bytes over TCP, without time stamps."""

    def greet(self) -> None:
        params = self.params
        self._odd, self._header = b"", True
        received_hz = abs(params.frequency_hz - 1e6 * params.iq.converter_mhz)
        centre_hz = 1e6 * params.iq.centre_mhz or received_hz
        # `rtl_tcp` tunes whole hertz, below 2^32.
        if not 0.0 < centre_hz < 2**32:
            raise ValueError(
                f"iq.centre_mhz={1e-6 * centre_hz} must be < 4294.967: state iq.converter_mhz"
            )
        tuning = {RTL_RATE: params.iq.rate_hz, RTL_FREQUENCY: centre_hz, RTL_AGC: 0}
        for command, value in (
            tuning | {RTL_GAIN_MODE: 1, RTL_GAIN: 10.0 * params.iq.gain_db}
        ).items():
            self.send(struct.pack(">BI", command, round(value)))

    def read(self) -> Sequence[Arrival]:
        data = self._odd + self.receive()
        if self._header:
            if len(data) >= 4 and data[:4] != RTL_MAGIC:
                raise ConnectionError(f"this is not rtl_tcp: it begins with {data[:4]!r}")
            if len(data) < RTL_HEADER:
                self._odd = data
                return ()
            data, self._header = data[RTL_HEADER:], False
        even = len(data) & ~1
        self._odd = data[even:]
        if not even:
            return ()
        samples, clipped = decoded(data[:even], "cu8")
        return (self.iq(samples, clipped=clipped),)


class SigMf(Source):
    """A SigMF recording, replayed in time: at its own while the station's clock is within it.

    Else its first sample is now.  One that is still written is followed.
    """

    _own = False
    _data: BinaryIO | None = None

    def open(self) -> None:
        path, link = Path(self.params.link.file), self.params.link
        self._about = about = read_sigmf(path)
        if about.rate_hz != self.params.iq.rate_hz:
            raise ValueError(
                f"iq.rate_hz={self.params.iq.rate_hz} must be {about.rate_hz}, that of {path.name}"
            )
        self._data = path.with_suffix(".sigmf-data").open("rb")
        now_s, begun_s = self.now_s(), about.recorded_s
        if begun_s is not None:
            longest_s = self._samples / about.rate_hz + link.silence_s
            self._own |= -SOON_S <= now_s - begun_s < longest_s
        self._begun_s = begun_s if self._own and begun_s is not None else now_s
        self._at = max(0, int((now_s - self._begun_s) * about.rate_hz))
        # A gap in the count begins a new stream.
        self.index += 1

    @property
    def _samples(self) -> int:
        assert self._data is not None
        return self._data.seek(0, os.SEEK_END) // self._about.sample_bytes

    def read(self) -> Sequence[Arrival]:
        rate, each = self.params.iq.rate_hz, self._about.sample_bytes
        due = int((self.now_s() - self._begun_s) * rate)
        count = min(due, self._samples) - self._at
        if count < PIECE_S * rate:
            # Before it counts as silent, which says less.
            if due - self._at > 0.8 * self.params.link.silence_s * rate:
                raise ConnectionError("the recording has ended")
            time.sleep(0.5 * PIECE_S)
            return ()
        assert self._data is not None
        self._data.seek(self._at * each)
        # At most a piece at a time: a clock that jumped does not load it all.
        data = self._data.read(min(count, int(4 * PIECE_S * rate)) * each)
        samples, clipped = decoded(data, self._about.kind, self._about.channels)
        t_s = self._begun_s + self._at / rate
        self._at += samples.shape[1]
        return (self.iq(samples, clipped=clipped, t_s=t_s, centre_hz=self._about.centre_hz),)

    def close(self) -> None:
        if self._data is not None:
            self._data.close()


class Recording(NamedTuple):
    """Contents of a .sigmf-meta file; a centre frequency or time that it leaves out is None."""

    rate_hz: float
    kind: str
    channels: int
    centre_hz: float | None
    recorded_s: float | None

    @property
    def sample_bytes(self) -> int:
        """Bytes of the samples of one moment."""
        return 2 * self.channels * part_bytes(self.kind)


def part_bytes(kind: str) -> int:
    """Return the bytes of a real or imaginary part."""
    return 4 if kind == "cf32" else int(FULL_SCALE[kind][0].itemsize)


def read_sigmf(path: Path) -> Recording:
    """Return what a .sigmf-meta file says about its samples.

    Raises ValueError for what is not SigMF, or of a datatype that is not read here.
    """
    try:
        content = json.loads(read_whole(path))
        about, capture = content["global"], (content.get("captures") or [{}])[0]
        kind, rate = str(about["core:datatype"]), float(about["core:sample_rate"])
    except (OSError, KeyError, TypeError, json.JSONDecodeError) as error:
        raise ValueError(f"{path}: is not SigMF: {error}") from error
    kind = kind.removesuffix("_le")
    if kind not in (*FULL_SCALE, "cf32"):
        raise ValueError(f"{path}: core:datatype={kind} must be cf32_le, ci16_le, ci8 or cu8")
    stamp, centre = capture.get("core:datetime"), capture.get("core:frequency")
    return Recording(
        rate, kind, int(about.get("core:num_channels", 1)), float(centre) if centre else None,
        parse_utc(stamp.removesuffix("Z")) if stamp else None,
    )  # fmt: skip


class Zmq(Source):
    """GNU Radio's ZMQ PUB sink, or any PUB of plain samples; the extra [zmq]."""

    _socket: Any = None

    def open(self) -> None:
        try:
            import zmq
        except ImportError as error:
            raise ValueError(
                "receiver.type=zmq needs pyzmq: pip install rf_pointing[zmq]"
            ) from error
        link = self.params.link
        self._again = zmq.Again
        self._socket = zmq.Context.instance().socket(zmq.SUB)
        self._socket.setsockopt(zmq.RCVTIMEO, int(1000 * WAIT_S))
        self._socket.setsockopt(zmq.SUBSCRIBE, b"")
        self._socket.connect(f"tcp://{link.host}:{link.port}")

    def read(self) -> Sequence[Arrival]:
        try:
            data = b"".join(self._socket.recv_multipart()[-1:])
        except self._again:
            return ()
        iq, channels = self.params.iq, self.params.signal.channels
        each = 2 * channels * part_bytes(iq.format)
        if len(data) % each or not data:
            self.refuse("message of odd length")
            return ()
        samples, clipped = decoded(data, iq.format, channels)
        return (self.iq(samples, clipped=clipped),)

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close(linger=0)
            self._socket = None


class Soapy(Source):
    """Any radio of SoapySDR; Debian's python3-soapysdr."""

    _device: Any = None
    _stream: Any = None

    def open(self) -> None:
        try:
            import SoapySDR
        except ImportError as error:
            raise ValueError(
                "receiver.type=soapy needs SoapySDR: apt install python3-soapysdr"
            ) from error
        params, self._soapy = self.params, SoapySDR
        receive = SoapySDR.SOAPY_SDR_RX
        received_hz = abs(params.frequency_hz - 1e6 * params.iq.converter_mhz)
        self._device = SoapySDR.Device(params.link.device)
        numbers = list(range(params.signal.channels))
        for channel in numbers:
            self._device.setSampleRate(receive, channel, params.iq.rate_hz)
            self._device.setFrequency(receive, channel, 1e6 * params.iq.centre_mhz or received_hz)
            self._device.setGain(receive, channel, params.iq.gain_db)
        self._stream = self._device.setupStream(receive, SoapySDR.SOAPY_SDR_CF32, numbers)
        self._device.activateStream(self._stream)
        self._buffers = np.zeros((len(numbers), CHUNK // 8), dtype=np.complex64)

    def read(self) -> Sequence[Arrival]:
        found = self._device.readStream(self._stream, list(self._buffers), self._buffers.shape[1],
                                        timeoutUs=int(1e6 * WAIT_S))  # fmt: skip
        if found.ret in (self._soapy.SOAPY_SDR_TIMEOUT, 0):
            return ()
        if found.ret == self._soapy.SOAPY_SDR_OVERFLOW:
            self.losses["overflow"] += 1
            # The number of lost ones is unknown: a gap in the count begins a new stream.
            self.index += 1
            return ()
        if found.ret < 0:
            raise ConnectionError(f"SoapySDR: {self._soapy.errToStr(found.ret)}")
        parts = self._buffers[:, : found.ret].view(np.float32)
        clipped = float(np.mean(np.abs(parts) >= 0.999))
        return (self.iq(self._buffers[:, : found.ret].copy(), clipped=clipped),)

    def close(self) -> None:
        device, stream, self._device, self._stream = self._device, self._stream, None, None
        if stream is not None:
            device.deactivateStream(stream)
            device.closeStream(stream)
