"""The cache policy of all stages: what is asked for decides the key, nothing else does."""

import json
from dataclasses import dataclass, field
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

from prefect.cache_policies import CachePolicy
from prefect.context import TaskRunContext
from prefect.transactions import IsolationLevel

from storage.artifacts import Place
from storage.fingerprint import code_fingerprint
from storage.locks import FOLDER
from tasks.stage import ledger, records
from tasks.stage.locks import FlockLockManager
from tasks.stage.signature import StageSignature


@dataclass
class StagePolicy(CachePolicy):
    """Key = building/storey/scan/stage/hash of code, versions, own parameters and input contents.

    One key computes once, even if two processes ask at the same moment; under the key's lock a
    record whose artifacts are not whole is dropped before the cache is looked at.
    """

    stage: str = ""
    fn: Any = None
    signature: StageSignature = field(default_factory=lambda: StageSignature((), (), False))

    def compute_key(
        self,
        task_ctx: TaskRunContext,
        inputs: dict[str, Any],
        flow_parameters: dict[str, Any],
        **kwargs: Any,
    ) -> str | None:
        """Return the key, and remember what was asked for.

        Prefect logs an error in here and goes on without a cache. So it is kept, and the task
        raises it.
        """
        place, task_run = inputs["place"], str(task_ctx.task_run.id)
        try:
            key = self._key(place, inputs)
            asked = ledger.Asked(place, self.stage, key, self.signature.refs(inputs))
        except Exception as error:
            ledger.remember(task_run, ledger.Asked(place, self.stage, "", [], error))
            return None
        ledger.remember(task_run, asked)
        return key

    def _key(self, place: Place, inputs: dict[str, Any]) -> str:
        parts = [self.stage, code_fingerprint(self.fn), self.signature.identity(inputs)]
        digest = sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:32]
        # names of places are checked: none leads out of the folder
        return f"{place.building}/{place.storey}/{place.scan or '_'}/{self.stage}/{digest}"


def policy_for(store: str, stage: str, fn: Any, signature: StageSignature) -> StagePolicy:
    """Return the policy of one stage in one store."""
    return StagePolicy(
        isolation_level=IsolationLevel.SERIALIZABLE,
        lock_manager=FlockLockManager(
            Path(store) / FOLDER,
            partial(records.drop_unless_sound, store),
            partial(records.hand_on, store),
        ),
        stage=stage,
        fn=fn,
        signature=signature,
    )
