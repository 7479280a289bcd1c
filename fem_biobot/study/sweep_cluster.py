"""The cases of a sweep on a Dask cluster, by the address of its scheduler. The only module that knows Dask.

Workers must run this version of the package and see the sweep's folder at the same path.
"""

from __future__ import annotations

import queue
import secrets
from pathlib import Path
from typing import Any

import fem_biobot
from fem_biobot.errors import DesignError, FileError
from fem_biobot.study.sweep_runner import Order, first_of

_PATIENCE = 10  # s, for a scheduler to answer
# orders under way for each thread of the cluster, so that none waits for the network
_AHEAD = 2


class ClusterRunner:
    """Workers of a cluster.

    Parameters
    ----------
    address
        Of the scheduler, such as ``tcp://10.0.0.1:8786``.
    folder
        The sweep's folder, absolute.

    Raises
    ------
    DesignError
        Dask is not installed; no scheduler answers; it has no workers, or they run another version.
    FileError
        A worker does not see the folder.
    """

    def __init__(self, address: str, folder: Path) -> None:
        try:
            import distributed
        except ImportError:
            raise DesignError(
                f"--scheduler: found {address}, but Dask is not installed, expected it for a cluster: "
                'pip install "fem_biobot[cluster]"'
            ) from None
        self._ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        try:
            self._client: Any = distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            reason = " ".join(str(error).split())[:80]
            raise DesignError(
                f"--scheduler: found {address}, where no scheduler answers within {_PATIENCE} s ({reason}), expected "
                "the address of one, such as tcp://10.0.0.1:8786"
            ) from None
        self._under_way: dict[Any, str] = {}
        self._run = secrets.token_hex(4)
        try:
            self._refuse_strangers(address, folder)
        except BaseException:
            self.close()
            raise

    def _refuse_strangers(self, address: str, folder: Path) -> None:
        """Every worker must see the folder and run this version."""
        mark = folder / f".seen-{self._run}"
        mark.write_text(self._run)
        try:
            seen = self._client.run(_seen, str(mark))
        except ImportError:
            raise DesignError(f"--scheduler: {address}: a worker has no fem_biobot, expected it installed") from None
        finally:
            mark.unlink()
        if not seen:
            raise DesignError(f"--scheduler: found {address}, a scheduler without workers, expected one or more")
        for worker, (text, version) in seen.items():
            if text != self._run:
                raise FileError(
                    f"{folder}: not seen by the worker {worker}, expected a folder that all machines have at this path"
                )
            if version != fem_biobot.__version__:
                raise DesignError(
                    f"--scheduler: worker {worker} runs fem_biobot {version}, expected {fem_biobot.__version__} as here"
                )

    @property
    def capacity(self) -> int:
        """Some more orders than the cluster has threads now; it may grow meanwhile."""
        return _AHEAD * max(1, sum(self._client.nthreads().values()))

    def submit(self, name: str, order: Order) -> None:
        """See `Runner`."""
        future = self._client.submit(_performed, order, key=f"fem_biobot-{self._run}-{name}", pure=False)
        self._under_way[future] = name
        future.add_done_callback(self._ended.put)

    def wait(self) -> list[tuple[str, dict[str, Any] | str]]:
        """See `Runner`."""
        future = first_of(self._ended)
        name = self._under_way.pop(future)
        if future.status == "finished":
            return [(name, future.result())]
        error = future.exception() if future.status == "error" else future.status
        return [(name, f"its worker gave no answer: {' '.join(str(error).split())}")]

    def close(self) -> None:
        """See `Runner`; what a worker has begun it ends, for nobody."""
        self._client.close()


def _performed(order: Order) -> dict[str, Any]:
    return order.perform()


def _seen(mark: str) -> tuple[str, str]:
    """What a worker finds in a file, and its version of the package."""
    file = Path(mark)
    return file.read_text() if file.exists() else "", fem_biobot.__version__
