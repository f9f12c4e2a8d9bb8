"""What lies at an address that stores share, compared with an undisturbed store."""

import json
from hashlib import sha256

from services import BUCKET, SECRET

from storage.remote import is_content_named

__all__ = ["BUCKET", "check_same"]


def check_same(shared: dict[str, str], undisturbed: dict[str, bytes]) -> None:
    """Raise AssertionError unless all of an undisturbed store is there too, and nothing damaged.

    More may lie there, as the store is not pruned at its address.
    """
    found = objects(shared)
    for name, data in found.items():
        if is_content_named(name):
            assert sha256(data).hexdigest().startswith(name[-32:-8]), f"damaged: {name}"
    for name, data in undisturbed.items():
        assert name in found, f"not shared: {name}"
        there = found[name]
        if name.startswith(".cache/"):  # of a record, what it leads to
            there = json.loads(there)["result"].encode()
        assert there == data, f"other: {name}"


def objects(shared: dict[str, str]) -> dict[str, bytes]:
    """Return all objects at an address, by their names below it."""
    import fsspec

    system = fsspec.filesystem(
        "s3",
        key=shared["AWS_ACCESS_KEY_ID"],
        secret=SECRET,
        endpoint_url=shared["AWS_ENDPOINT_URL"],
        use_listings_cache=False,
        skip_instance_cache=True,
    )
    root = shared["MAPSENSE_REMOTE"].removeprefix("s3://")
    return {path.removeprefix(f"{root}/"): system.cat_file(path) for path in system.find(root)}
