"""A time as an operator writes it."""

from datetime import UTC, datetime

__all__ = ["parse_utc"]


def parse_utc(text: str) -> float:
    """Return UTC seconds of an ISO time; without a zone it is UTC."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise ValueError(f"start={text!r} must be an ISO time such as 2006-06-27T04:00:00") from error
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
