"""A worker process of a sweep: orders come in on standard input, answers go out on standard output, until it closes."""

from __future__ import annotations

import os
import pickle
import queue
import sys
import threading
from typing import IO, Any


def main() -> None:
    """Serve until the parent is gone."""
    # standard output is for answers alone: what libraries print goes with the errors
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    orders: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(sys.stdin.buffer, orders), daemon=True).start()
    while True:
        pickle.dump(orders.get().perform(), answers)
        answers.flush()


def _listen(source: IO[bytes], orders: queue.SimpleQueue[Any]) -> None:
    """Take orders; when there can be no more the parent has ended, and what is under way is wanted by nobody."""
    while True:
        try:
            orders.put(pickle.load(source))
        except EOFError:
            os._exit(0)
        except Exception:  # an order that cannot be read: the parent learns it from the end of this process
            os._exit(1)
