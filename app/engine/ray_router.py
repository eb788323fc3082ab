"""The router of Ray Serve: calls go to the hosts that an engine has chosen for them."""

from typing import Any

from ray.serve.request_router import PendingRequest, RequestRouter, RunningReplica

from app.engine import ray_call  # as a module: Ray copies what else the class refers to


class ChosenHosts(RequestRouter):
    """Sends each call to the first in its order of hosts."""

    supports_rejection_protocol = False  # the engines have queues of their own

    def update_replicas(self, replicas: list[RunningReplica]) -> None:
        """Note which hosts there are."""
        super().update_replicas(replicas)
        ray_call.HOSTS.clear()
        ray_call.HOSTS.update({each.replica_id.unique_id: each for each in replicas})

    def on_replica_actor_died(self, replica_id: Any) -> None:
        """Note that a host is gone."""
        super().on_replica_actor_died(replica_id)
        ray_call.HOSTS.pop(replica_id.unique_id, None)

    async def choose_replicas(
        self,
        candidate_replicas: list[RunningReplica],
        pending_request: PendingRequest | None = None,
    ) -> list[list[RunningReplica]]:
        """Return the first host in the order of a call that is there, and note it."""
        if pending_request is None:
            return []
        known = {each.replica_id.unique_id: each for each in candidate_replicas}
        call: ray_call.Call = pending_request.args[0]
        for name in call.order:
            if name in known:
                call.host = name
                return [[known[name]]]
        return []
