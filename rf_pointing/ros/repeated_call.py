"""A service call that is made again while its answer is late.

A server drops its answer, and tells nobody, where its middleware does not know the caller's end of
the service within 0.1 s: that happens to callers that have just started, and on busy machines.
"""

import time
from typing import Any

AGAIN_S = 5.0


class RepeatedCall:
    """A call that may be made twice, made every `AGAIN_S` of wall time until an answer comes.

    The first goes out with the first look at `done` that is `after_s` later than now.
    """

    def __init__(self, client: Any, request: Any, after_s: float = 0.0) -> None:
        self._client, self._request = client, request
        self._next_s = time.monotonic() + after_s
        self._futures: list[Any] = []

    @property
    def made(self) -> bool:
        """Whether the service was there to be called."""
        return bool(self._futures)

    def done(self) -> bool:
        """Return whether an answer is there; call again where it is time and the service ready."""
        if not self._answered() and time.monotonic() >= self._next_s and self._client.service_is_ready():
            self._futures.append(self._client.call_async(self._request))
            self._next_s = time.monotonic() + AGAIN_S
        return self._answered()

    def _answered(self) -> bool:
        return any(each.done() for each in self._futures)

    def result(self) -> Any:
        """Return the first answer, or None; the client does not wait for the others any longer."""
        late = [each for each in self._futures if not each.done()]
        for each in late:
            self._client.remove_pending_request(each)
        return next((each.result() for each in self._futures if each not in late), None)
