"""A cluster as an executor: `dask.distributed`, the extra `cluster`."""

import importlib.util
import ipaddress
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from urllib.parse import urlsplit

from camopt.scene.errors import InputError
from camopt.scene.text_file import excerpt

WAIT_SECONDS = 20
"""How long a scheduler and its first worker are waited for."""
RETRIES = 2
"""How often dask computes a task again that raised, which only a fault of the cluster makes it do."""


@contextmanager
def cluster(address: str, insecure: bool = False) -> Iterator[tuple[Executor, int]]:
    """The executor of the scheduler at `address` ("tcp://HOST:PORT" or "tls://HOST:PORT") and its number of threads.

    Whoever reaches a scheduler without TLS can run any program on its workers and here. So an address beyond this
    machine needs tls://, with the certificates of dask's own configuration, or `insecure`. Raises InputError for an
    address that is none or needs TLS, where `distributed` is not installed, and where nobody answers.
    """
    check_address(address, insecure)
    if importlib.util.find_spec("distributed") is None:
        raise InputError("--scheduler: dask.distributed is not installed: pip install 'camopt[cluster]'")
    from distributed import Client  # pyright: ignore[reportMissingImports]

    try:
        client = Client(address, timeout=WAIT_SECONDS, set_as_default=False)
    except (OSError, TypeError, ValueError) as error:  # a TypeError where tls:// has no certificates
        raise InputError(f"--scheduler {address}: no scheduler answers ({error})") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=WAIT_SECONDS)
        except TimeoutError:
            raise InputError(
                f"--scheduler {address}: has no workers; start some with `dask worker {address}`"
            ) from None
        threads: dict[str, int] = dict(client.nthreads())  # type: ignore[arg-type]  # a synchronous client answers
        yield client.get_executor(pure=False, retries=RETRIES), sum(threads.values())


def check_address(address: str, insecure: bool) -> None:
    """Raises InputError for an address that is none, or that needs TLS and does not ask for it."""
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError:
        parts, host, port = urlsplit(""), None, None
    if parts.scheme not in ("tcp", "tls") or not host or port is None:
        raise InputError(f"--scheduler {excerpt(address)}: expected tcp://HOST:PORT or tls://HOST:PORT")
    if parts.scheme == "tcp" and not insecure and not _loopback(host):
        raise InputError(
            f"--scheduler {excerpt(address)}: beyond this machine a scheduler without TLS lets anybody run programs on "
            f"its workers: use tls:// with certificates, or add --insecure in a network that you trust"
        )


def _loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
