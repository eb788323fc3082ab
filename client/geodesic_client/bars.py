"""Progress as a bar, by the extra ``progress``."""

from collections.abc import Iterator
from contextlib import contextmanager

from geodesic_client.flow import Progress


@contextmanager
def progress_bar(label: str) -> Iterator[Progress]:
    """Show a bar, and yield the function that moves it, to pass as ``progress=`` to a method."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        message = "a bar needs tqdm: pip install 'geodesic-client[progress]'"
        raise ImportError(message) from None
    with tqdm(total=1.0, desc=label, bar_format="{desc} {percentage:3.0f}% {bar}") as bar:
        yield lambda share: bar.update(share - bar.n)
