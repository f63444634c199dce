"""True and estimated attitude or pose of an array sensor, from a bag.

An estimate and a truth of the same stamp belong together; a message without a partner is left out.
"""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore

from rf_pointing.array_sensors.attitude.quaternion import (
    conjugate,
    multiply,
    quaternion_to_rotation_vector,
)
from rf_pointing.core.types import Array
from rf_pointing.report.bag_source import open_bag
from rf_pointing.report.topics import types_of

Messages = dict[int, Any]


@dataclass(frozen=True)
class ArraySeries:
    """n epochs: time from the first, vectors (n, 3) in m (None without positions), quaternions (n,
    4), validity (n,).

    `covariance` (n, k, k) is that of the errors: rotation (k = 3), or position and rotation (k =
    6), in the reference axes.  `reasons` are those of all epochs without a valid estimate, also
    where nothing was published.  `hand_offs` are the times from which another station is received,
    with its name.
    """

    t_s: Array
    true_position_m: Array | None
    position_m: Array | None
    true_quaternion: Array
    quaternion: Array
    covariance: Array
    valid: NDArray[np.bool_]
    reasons: tuple[str, ...] = ()
    hand_offs: tuple[tuple[float, str], ...] = ()

    def nees(self, first: int, errors: Array) -> Array:
        """Normalised squared error (n,) of `errors` (n, 3), whose covariance begins at row `first`;
        3 is expected.
        """
        block = self.covariance[:, first : first + 3, first : first + 3]
        return np.asarray(
            np.einsum("ni,ni->n", errors, np.linalg.solve(block, errors[..., None])[..., 0])
        )

    @property
    def rotation_error_rad(self) -> Array:
        """Rotation vectors (n, 3) from true to estimated orientation, about the reference axes."""
        return quaternion_to_rotation_vector(
            multiply(self.quaternion, conjugate(self.true_quaternion))
        )

    @property
    def rotation_sigma_rad(self) -> Array:
        """Standard deviations (n, 3) of the rotation error."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance[:, -3:, -3:], axis1=1, axis2=2)))

    @property
    def position_error_m(self) -> Array:
        """Errors (n, 3) of the position; ValueError without positions."""
        if self.position_m is None or self.true_position_m is None:
            raise ValueError("an attitude sensor has no position")
        return self.position_m - self.true_position_m

    @property
    def position_sigma_m(self) -> Array:
        """Standard deviations (n, 3) of the position error."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance[:, :3, :3], axis1=1, axis2=2)))


def array_sensors(bag: Path) -> dict[str, str]:
    """Return what the array sensors of a bag measure, "attitude" or "relative_pose", by their
    namespaces.
    """
    with ExitStack() as stack:
        topics = {connection.topic for connection in open_bag(bag, stack).connections}
    found = {}
    for topic in sorted(topics):
        namespace, _, what = topic.rpartition("/")
        if what in ("attitude", "relative_pose") and f"{namespace}/sim/{what}" in topics:
            found[namespace] = what
    return found


def read_attitude_series(bag: Path, namespace: str) -> ArraySeries:
    """Return attitude against sim/attitude of one namespace.

    ValueError where a bag has no common stamp.
    """
    estimates, truth, received = _read(
        bag, f"{namespace}/attitude", f"{namespace}/sim/attitude", f"{namespace}/array_snapshots"
    )
    stamps = _common(estimates, truth, bag)
    return ArraySeries(
        t_s=_seconds(stamps),
        true_position_m=None,
        position_m=None,
        true_quaternion=np.array(
            [_components(truth[stamp].quaternion, "xyzw") for stamp in stamps]
        ),
        quaternion=np.array(
            [_components(estimates[stamp].orientation, "xyzw") for stamp in stamps]
        ),
        covariance=np.array([estimates[stamp].covariance for stamp in stamps]).reshape(-1, 3, 3),
        valid=np.array([estimates[stamp].valid for stamp in stamps]),
        reasons=tuple(message.reason for message in estimates.values() if not message.valid),
        hand_offs=hand_offs(received, stamps[0]),
    )


def read_pose_series(bag: Path, namespace: str) -> ArraySeries:
    """Return relative_pose against sim/relative_pose.

    A pose is published only while there is one, so all are valid.
    """
    estimates, truth, status = _read(
        bag,
        f"{namespace}/relative_pose",
        f"{namespace}/sim/relative_pose",
        f"{namespace}/relative_pose_status",
    )
    stamps = _common(estimates, truth, bag)
    found, true = ([messages[stamp].pose for stamp in stamps] for messages in (estimates, truth))
    return ArraySeries(
        t_s=_seconds(stamps),
        true_position_m=np.array([_components(each.pose.position, "xyz") for each in true]),
        position_m=np.array([_components(each.pose.position, "xyz") for each in found]),
        true_quaternion=np.array([_components(each.pose.orientation, "xyzw") for each in true]),
        quaternion=np.array([_components(each.pose.orientation, "xyzw") for each in found]),
        covariance=np.array([each.covariance for each in found]).reshape(-1, 6, 6),
        valid=np.ones(len(stamps), dtype=np.bool_),
        reasons=tuple(
            message.reason for stamp, message in status.items() if stamp not in estimates
        ),
    )


def hand_offs(received: Messages, first: int) -> tuple[tuple[float, str], ...]:
    """Return when another station begins to be received, and its name."""
    stamps = sorted(received)
    # Stations take turns block by block: one is new when two whole turns have passed without it.
    # One is too few: where another station sets or rises, the order changes.
    turns = 2 * len({name for message in received.values() for name in message.transmitters})
    last: dict[str, int] = {}
    found: dict[int, list[str]] = {}
    for index, stamp in enumerate(stamps):
        for name in received[stamp].transmitters:
            if index >= turns and (name not in last or index - last[name] > turns):
                found.setdefault(stamp, []).append(name)
            last[name] = index
    return tuple(
        ((stamp - first) / 1e9, ", ".join(sorted(names))) for stamp, names in found.items()
    )


def _read(bag: Path, *topics: str) -> list[Messages]:
    """Return the messages of each topic by stamp in nanoseconds.

    Of several with one stamp the last.
    """
    found: dict[str, Messages] = {topic: {} for topic in topics}
    with ExitStack() as stack:
        source = open_bag(bag, stack)
        types = dict(get_typestore(Stores.ROS2_JAZZY).fielddefs)
        for connection in source.connections:
            # The bag carries its own definitions: a recording of an older release stays readable.
            types.update(types_of(connection.msgtype, connection.msgdef))
        typestore = get_typestore(Stores.EMPTY)
        typestore.register(types)
        for reader in source.readers:
            wanted = [connection for connection in reader.connections if connection.topic in found]
            for connection, _, raw in reader.messages(wanted) if wanted else ():
                message: Any = typestore.deserialize_cdr(raw, connection.msgtype)
                stamp = message.header.stamp
                # In whole nanoseconds: stamps compared as floats would miss their partners.
                found[connection.topic][stamp.sec * 10**9 + stamp.nanosec] = message
    return [found[topic] for topic in topics]


def _common(estimates: Messages, truth: Messages, bag: Path) -> list[int]:
    stamps = sorted(estimates.keys() & truth.keys())
    if not stamps:
        raise ValueError(
            f"bag={bag}: {len(estimates)} estimates and {len(truth)} true values have no stamp in common"
        )
    return stamps


def _seconds(stamps: list[int]) -> Array:
    return np.array([(stamp - stamps[0]) / 1e9 for stamp in stamps])


def _components(message: Any, names: str) -> list[float]:
    return [getattr(message, name) for name in names]
