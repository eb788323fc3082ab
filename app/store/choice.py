"""Choice of the store: a folder, or an object store by its URL."""

from pathlib import Path

from app.settings import Settings, variable_of
from app.store.folder_store import FolderStore
from app.store.interface import Store
from app.store.layout import StoreError


def store_of(settings: Settings) -> Store:
    """Return the store that the settings name; raises ``StoreError`` where it cannot be."""
    if isinstance(settings.store, Path):
        return FolderStore(settings.store)
    try:
        from app.store.object_store import ObjectStore  # an extra
        from app.store.objects import Objects
    except ImportError as error:
        extra = "pip install geodesic[cluster]"
        raise StoreError(f"{variable_of('store')} needs {error.name}: {extra}") from error
    try:
        objects = Objects.at(settings.store)
    except ValueError as error:
        raise StoreError(
            f"{variable_of('store')} is not the URL of a store, or an environment variable for it "
            f"is missing: {error}"
        ) from None
    return ObjectStore(objects, settings.folder, settings.copies_bytes, settings.store)
