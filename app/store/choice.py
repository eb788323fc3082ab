"""Choice of the store: a folder, or an object store by its URL."""

from pathlib import Path

from app.settings import Settings, variable_of
from app.store.layout import StoreError
from app.store.store import Store


def store_of(settings: Settings) -> Store:
    """Return the store that the settings name; raises ``StoreError`` where it cannot be."""
    if isinstance(settings.store, Path):
        return Store(settings.store)
    try:
        from app.store.bucket import Bucket  # an extra
        from app.store.bucket_store import BucketStore
    except ImportError as error:
        extra = "pip install geodesic[cluster]"
        raise StoreError(f"{variable_of('store')} needs {error.name}: {extra}") from error
    try:
        objects = Bucket.at(settings.store)
    except ValueError as error:
        raise StoreError(
            f"{variable_of('store')} is not the URL of a store, or an environment variable for it "
            f"is missing: {error}"
        ) from None
    return BucketStore(objects, settings.folder, settings.copies_bytes, settings.store)
