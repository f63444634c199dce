"""The option that names the antenna, refused where ROS would refuse it later in words of its own."""

import argparse

from rclpy.exceptions import InvalidNamespaceException
from rclpy.validate_namespace import validate_namespace

__all__ = ["add_namespace_option"]


def add_namespace_option(parser: argparse.ArgumentParser) -> None:
    """Add --namespace to a command line; the slash before it may be left out."""
    parser.add_argument("--namespace", type=_namespace, default="/gs1", help="namespace of the antenna (default: /gs1)")


def _namespace(text: str) -> str:
    name = text if text.startswith("/") else f"/{text}"
    if name == "/":
        raise argparse.ArgumentTypeError(f"{text!r} must name the antenna, as /gs1 does")
    try:
        validate_namespace(name)
    except InvalidNamespaceException as error:
        reason = str(error).splitlines()[0]
        raise argparse.ArgumentTypeError(f"{text!r} is no ROS namespace: {reason}") from error
    return name
