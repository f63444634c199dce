"""Outlets of generated samples: an rtl_tcp server, DIFI over UDP, a ZMQ PUB, a SigMF recording."""

import json
import select
import socket
import struct
import threading
import time
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.core.dates import to_utc_text
from rf_pointing.receiver.iq_sources import RTL_FREQUENCY, RTL_MAGIC
from rf_pointing.receiver.params import OutletParams
from rf_pointing.receiver.spectrum import Samples
from rf_pointing.receiver.vita49 import (
    CONTEXT,
    DATA,
    Context,
    Packet,
    encode_context,
    encode_packet,
    encode_samples,
)

R820T, GAINS = 5, 29
"""Tuner and number of its gains, as a usual RTL-SDR reports them."""
KEPT_S = 2.0
PAYLOAD = 360
"""Samples of a DIFI packet, so that it fits an Ethernet frame."""
CONTEXT_S = 0.5
WAIT_S = 0.1


class Outlet:
    """Base of the outlets; `send` never waits for any client."""

    def __init__(self, params: OutletParams, rate_hz: float, centre_hz: float) -> None:
        self.params, self.rate_hz, self.centre_hz = params, rate_hz, centre_hz
        self.lost = 0
        """Pieces that nobody took in time."""

    def send(self, samples: Samples, t_s: float) -> None:
        """Serve samples (channels, n), full scale 1, whose first one is of `t_s`."""
        raise NotImplementedError

    def close(self) -> None:
        """Release port or file."""


class RtlTcpServer(Outlet):
    """One client at a time gets unsigned bytes; its commands are read, its tuning is noted."""

    def __init__(self, params: OutletParams, rate_hz: float, centre_hz: float) -> None:
        super().__init__(params, rate_hz, centre_hz)
        self.tuned_hz: int | None = None
        self._queue: deque[bytes] = deque(maxlen=1000)
        self._ended = threading.Event()
        self._socket = socket.create_server((params.host, params.port), backlog=1)
        self._socket.settimeout(WAIT_S)
        self.port: int = self._socket.getsockname()[1]
        self.connected = False
        self._thread = threading.Thread(target=self._serve, name="rtl_tcp server", daemon=True)
        self._thread.start()

    def send(self, samples: Samples, _t_s: float) -> None:
        if self.connected:
            # A client that does not read loses what is older, as the device itself would.
            if len(self._queue) >= KEPT_S * self.rate_hz / samples.shape[1]:
                self._queue.popleft()
                self.lost += 1
            parts = np.rint(samples[0].view(np.float32) * 128.0 + 127.5)
            self._queue.append(np.clip(parts, 0.0, 255.0).astype(np.uint8).tobytes())

    def _serve(self) -> None:
        while not self._ended.is_set():
            try:
                client, _ = self._socket.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            with client:
                try:
                    self._talk(client)
                except OSError:
                    pass
                finally:
                    self.connected = False
                    self._queue.clear()

    def _talk(self, client: socket.socket) -> None:
        client.settimeout(KEPT_S)
        client.sendall(RTL_MAGIC + struct.pack(">II", R820T, GAINS))
        self.connected, commands = True, b""
        while not self._ended.is_set():
            if select.select([client], [], [], 0.0)[0]:
                more = client.recv(512)
                if not more:
                    return
                commands += more
            while len(commands) >= 5:
                command, value = struct.unpack(">BI", commands[:5])
                commands = commands[5:]
                self.tuned_hz = value if command == RTL_FREQUENCY else self.tuned_hz
            if self._queue:
                client.sendall(self._queue.popleft())
            else:
                time.sleep(0.002)

    def close(self) -> None:
        self._ended.set()
        self._socket.close()
        self._thread.join(timeout=2.0 * KEPT_S)


class DifiSender(Outlet):
    """A stream for each channel, its identifier the number of the channel."""

    def __init__(self, params: OutletParams, rate_hz: float, centre_hz: float) -> None:
        super().__init__(params, rate_hz, centre_hz)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._counts: dict[tuple[int, int], int] = {}
        self._context_s = -CONTEXT_S

    def send(self, samples: Samples, t_s: float) -> None:
        if abs(t_s - self._context_s) >= CONTEXT_S:
            self._context_s = t_s
            context = encode_context(
                Context(rate_hz=self.rate_hz, centre_hz=self.centre_hz, bits=16)
            )
            for channel in range(len(samples)):
                self._packet(CONTEXT, channel, t_s, context)
        for begin in range(0, samples.shape[1], PAYLOAD):
            for channel, row in enumerate(samples):
                payload = encode_samples(np.ascontiguousarray(row[begin : begin + PAYLOAD]))
                self._packet(DATA, channel, t_s + begin / self.rate_hz, payload)

    def _packet(self, kind: int, channel: int, t_s: float, payload: bytes) -> None:
        count = self._counts.get((kind, channel), 0)
        self._counts[kind, channel] = (count + 1) % 16
        # Nanoseconds: a float of seconds has no more.
        seconds, nanoseconds = divmod(round(t_s * 1e9), 10**9)
        packet = Packet(kind, channel, count, seconds, 1000 * nanoseconds, payload)
        try:
            self._socket.sendto(encode_packet(packet), (self.params.host, self.params.port))
        except OSError:
            self.lost += 1

    def close(self) -> None:
        self._socket.close()


class ZmqServer(Outlet):
    """A PUB of complex64, channels interleaved, as GNU Radio's ZMQ PUB sink."""

    def __init__(self, params: OutletParams, rate_hz: float, centre_hz: float) -> None:
        super().__init__(params, rate_hz, centre_hz)
        try:
            import zmq
        except ImportError as error:
            raise ValueError("format=zmq needs pyzmq: pip install rf_pointing[zmq]") from error
        self._socket: Any = zmq.Context.instance().socket(zmq.PUB)
        self._socket.bind(f"tcp://{params.host}:{params.port}")

    def send(self, samples: Samples, _t_s: float) -> None:
        self._socket.send(np.ascontiguousarray(samples.T).tobytes())

    def close(self) -> None:
        self._socket.close(linger=0)


class SigMfWriter(Outlet):
    """A recording of 16 bits; its meta file is written first, so that a killed run leaves both.

    One that exists is left as it is: the receiver replays it.
    """

    def __init__(self, params: OutletParams, rate_hz: float, centre_hz: float) -> None:
        super().__init__(params, rate_hz, centre_hz)
        path = Path(params.file)
        if path.suffix != ".sigmf-meta":
            raise ValueError(f"outlet.file={params.file!r} must end in .sigmf-meta")
        self._path, self._begun = path, False
        data = path.with_suffix(".sigmf-data")
        # Without a buffer: the receiver may read along.
        self._data = None if path.exists() else data.open("wb", buffering=0)

    def send(self, samples: Samples, t_s: float) -> None:
        if self._data is None:
            return
        if not self._begun:
            self._begun = True
            capture = {"core:sample_start": 0, "core:frequency": self.centre_hz,
                       "core:datetime": to_utc_text(t_s) + "Z"}  # fmt: skip
            about = {"core:datatype": "ci16_le", "core:sample_rate": self.rate_hz,
                     "core:version": "1.0.0", "core:num_channels": len(samples)}  # fmt: skip
            self._path.write_text(
                json.dumps({"global": about, "captures": [capture], "annotations": []})
            )
        parts = np.ascontiguousarray(samples.T).view(np.float32) * 32768.0
        self._data.write(np.clip(np.rint(parts), -32768, 32767).astype("<i2").tobytes())

    def close(self) -> None:
        if self._data is not None:
            self._data.close()


def make_outlet(params: OutletParams, rate_hz: float, centre_hz: float) -> Outlet:
    """Return the outlet of the parameters; OSError or ValueError where it cannot be opened."""
    kinds = {"rtl_tcp": RtlTcpServer, "vita49": DifiSender, "zmq": ZmqServer, "sigmf": SigMfWriter}
    return kinds[params.format](params, rate_hz, centre_hz)
