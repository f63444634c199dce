"""Descriptions of its topics that a bag stores: definitions of their types, and quality of service.

A bag has, for every topic, the full text of its type and the type's RIHS01 hash, so that it can be
read where the package is not installed.  Our own types keep their comments (units and signs).
With the profiles, `ros2 bag play` offers what the recorded publisher offered.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

_SEPARATOR = "=" * 80 + "\n"


@dataclass(frozen=True)
class Definitions:
    """Known message types; `texts` is the `.msg` text of those that were read from files."""

    typestore: Typestore
    texts: dict[str, str]

    def schema(self, type_name: str) -> str:
        """Return a type as rosbag2 stores it, with those in it; ValueError for an unknown one."""
        try:
            # Generated text has no comments; ours have the units, so they replace it part by part.
            generated, _ = self.typestore.generate_msgdef(type_name, ros_version=2)
        except (TypesysError, KeyError, AssertionError) as error:
            raise ValueError(f"type_name={type_name!r} has no complete message definition: {error}") from None
        root, *contained = generated.split(_SEPARATOR)
        parts = [self.texts.get(type_name, root)]
        parts += [self._with_comments(part) for part in contained]
        return _SEPARATOR.join(part.rstrip("\n") + "\n" for part in parts)

    def type_hash(self, type_name: str) -> str:
        """Return the RIHS01 hash of `type_name`, the one that the middleware announces."""
        # The hash of an incomplete type would be wrong without an error.
        self.schema(type_name)
        return self.typestore.hash_rihs01(type_name)

    def _with_comments(self, part: str) -> str:
        heading, _, body = part.partition("\n")
        package, _, name = heading.removeprefix("MSG: ").strip().partition("/")
        return f"{heading}\n{self.texts.get(f'{package}/msg/{name}', body)}"


def definitions(*folders: Path | str) -> Definitions:
    """Return the types of Jazzy and of the interface packages in `folders`.

    Each holds `package.xml` and `msg/*.msg`: a source or an installed `share/<package>`; ValueError
    for one that does not, and for a `.msg` file that cannot be parsed.
    """
    texts = {name: text for folder in folders for name, text in _package_texts(Path(folder)).items()}
    typestore = get_typestore(Stores.ROS2_JAZZY)
    for name, text in texts.items():
        try:
            typestore.register(get_types_from_msg(text, name))
        except TypesysError as error:
            raise ValueError(f"definition of {name} is not readable: {error}") from None
    return Definitions(typestore=typestore, texts=texts)


def _package_texts(folder: Path) -> dict[str, str]:
    manifest = folder / "package.xml"
    files = sorted((folder / "msg").glob("*.msg"))
    if not manifest.is_file() or not files:
        raise ValueError(f"folder={folder} is not an interface package: it needs package.xml and msg/*.msg")
    package = (ElementTree.parse(manifest).findtext("name") or "").strip()
    return {f"{package}/msg/{path.stem}": path.read_text(encoding="utf-8") for path in files}


_INFINITE = QosTime(9223372036, 854775807)


def qos_from_profile(profile: Any) -> Qos:
    """Return the offered profile of a QoS profile of rclpy, read by the names of its attributes."""
    return Qos(
        history=QosHistory[profile.history.name], depth=profile.depth,
        reliability=QosReliability[profile.reliability.name],
        durability=QosDurability[profile.durability.name],
        deadline=_duration(profile.deadline.nanoseconds),
        lifespan=_duration(profile.lifespan.nanoseconds),
        liveliness=QosLiveliness.AUTOMATIC, liveliness_lease_duration=_INFINITE,
        avoid_ros_namespace_conventions=False,
    )  # fmt: skip


def _duration(nanoseconds: int) -> QosTime:
    # A profile has 0 for "not set"; the graph and the recorder of ROS write that as infinite.
    if not nanoseconds or nanoseconds >= _INFINITE.sec * 10**9:
        return _INFINITE
    return QosTime(nanoseconds // 10**9, nanoseconds % 10**9)
