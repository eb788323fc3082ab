"""The way into a cluster of Ray, which ``ray start`` makes of machines, and the hosts on them."""

import logging
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

NAMESPACE = "geodesic"
APPLICATION, DEPLOYMENT = "geodesic", "host"
RESOURCE = "geodesic"
"""Of each machine that is to have a host"""

_MOST_HOSTS = 32
"""Hosts that Ray would start; those beyond the machines wait until one joins"""
_MOST_CALLS = 100_000
"""Calls at one host: they wait in the queue of its engine, where callers take turns"""
_CHECK_S, _CHECK_TIMEOUT_S = 1.0, 5.0
_RECOVERY_S = 15
"""For which a controller that took over waits for hosts, and tells of none new; 30 by default.

It waits for those, too, that no machine is there for.
"""
VARIABLES = {
    "RAY_SERVE_USE_GRPC_BY_DEFAULT": "1",  # a third of the time, and a host hears of lost callers
    "RAY_SERVE_REPLICA_GRPC_MAX_MESSAGE_LENGTH": str(2**31 - 1),  # 4 MiB otherwise
    "RAY_SERVE_RUN_ROUTER_IN_SEPARATE_LOOP": "0",
    "RAY_SERVE_RUN_USER_CODE_IN_SEPARATE_THREAD": "0",
    "RAY_SERVE_LOG_TO_STDERR": "0",  # our own log tells what matters
}
"""Of all processes that call hosts, or are one; Ray reads them when it is imported"""


class ClusterError(Exception):
    """There is no way into the cluster; the message says what to do."""


def set_variables() -> None:
    """Set the variables of Ray for this process; nothing of Ray is imported yet."""
    if find_spec("ray") is None:
        raise ClusterError("Ray is not installed: pip install 'geodesic[cluster]'")
    os.environ.update(VARIABLES)


@contextmanager
def joined() -> Iterator[None]:
    """Be a client of the cluster inside the block, which has a host on each of its machines.

    Raises ``ClusterError`` where Ray does not run on this machine.
    """
    import ray

    on_end = signal.getsignal(signal.SIGTERM)
    try:
        ray.init("auto", namespace=NAMESPACE, log_to_driver=False, logging_level=logging.ERROR)
    except (ConnectionError, ValueError) as error:
        raise ClusterError(
            f"this machine is in no cluster ({error}): run `ray start` first, see docs/scaling.md"
        ) from error
    signal.signal(signal.SIGTERM, on_end)  # Ray has set one of its own
    _end_listener()
    try:
        _deploy()
        yield
    finally:
        ray.shutdown()


def _end_listener() -> None:
    """Have Ray's thread that prints errors of the cluster end once the head is away.

    It would ask again and again then, without a pause, and burn a core.
    """
    from ray._private.worker import global_worker

    global_worker.threads_stopped.set()


def _deploy() -> None:
    """Have Ray keep a host on each machine with our resource, on those that join later too."""
    from ray import serve
    from ray.serve.config import RequestRouterConfig

    from app.engine.ray_host import Host

    recovery = {"env_vars": {"RAY_SERVE_SLOW_STARTUP_WARNING_S": str(_RECOVERY_S)}}
    serve.start(proxy_location="Disabled", controller_options={"runtime_env": recovery})
    if APPLICATION in serve.status().applications:
        return
    router: dict[str, Any] = {
        "request_router_class": "app.engine.ray_router:ChosenHosts",
        "request_routing_stats_period_s": _CHECK_S,
        "request_routing_stats_timeout_s": _CHECK_TIMEOUT_S,
    }
    host: Any = serve.deployment(
        Host,
        name=DEPLOYMENT,
        num_replicas=_MOST_HOSTS,
        max_replicas_per_node=1,
        max_ongoing_requests=_MOST_CALLS,
        request_router_config=RequestRouterConfig(**router),
        health_check_period_s=_CHECK_S,
        health_check_timeout_s=_CHECK_TIMEOUT_S,
        graceful_shutdown_timeout_s=20,
        logging_config={"enable_access_log": False},
        ray_actor_options={
            "num_cpus": 0,
            "resources": {RESOURCE: 1},
            "runtime_env": {"env_vars": VARIABLES},
        },
    )
    # Its hosts are never all there, so that nobody waits for them.
    target = serve.RunTarget(target=host.bind(), name=APPLICATION, route_prefix=None)
    serve.run_many([target], wait_for_applications_running=False)
