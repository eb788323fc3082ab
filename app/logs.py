"""Logs: one line for each event, as JSON or for people, from all processes of the service.

Modules log with fields::

    logger = structlog.get_logger(module=__name__)
    logger.warning("worker lost", pid=17)

No line shows the values of local variables, headers or query strings: they may be secrets.
"""

import logging
import sys
from collections.abc import Mapping, MutableMapping
from contextlib import suppress
from typing import Any, Literal, TextIO

import orjson
import structlog
from structlog.typing import Processor

LogFormat = Literal["json", "text"]

_LEVEL = logging.INFO


def install(log_format: LogFormat | None, stream: TextIO | None = None) -> None:
    """Write all log lines of this process to ``stream``.

    Those of the standard library's loggers and warnings are among them.

    Parameters
    ----------
    log_format
        ``"json"`` for one object a line, ``"text"`` for people; None for text where the stream is a
        terminal, and JSON elsewhere.
    stream
        The stream to write to; standard error where None is named.
    """
    stream = stream or sys.stderr
    is_terminal = stream.isatty()
    is_text = log_format == "text" or (log_format is None and is_terminal)
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            *(_for_people(colors=is_terminal) if is_text else _AS_JSON),
        ],
        wrapper_class=structlog.make_filtering_bound_logger(_LEVEL),
        logger_factory=lambda *_names: _Lines(stream.buffer),
        cache_logger_on_first_use=True,
    )
    logging.basicConfig(handlers=[_Forward()], level=_LEVEL, force=True)
    logging.captureWarnings(capture=True)
    logging.getLogger("alembic.runtime.plugins").setLevel(logging.WARNING)  # a line each


class _Lines(structlog.BytesLogger):
    """A writer of lines; those that cannot be written are lost, and the service goes on."""

    def msg(self, message: bytes) -> None:
        """Write a line, unless the disk is full, the reader is gone, or the stream is closed."""
        with suppress(OSError, ValueError):
            super().msg(message)

    info = warning = error = critical = msg


def _to_json(event: Mapping[str, Any], **_options: Any) -> bytes:
    try:
        return orjson.dumps(event, default=_text_of)
    except TypeError:  # some text is none, such as the name of a file
        texts = {
            n: _text_of(value) if isinstance(value, str) else value for n, value in event.items()
        }
        return orjson.dumps(texts, default=_text_of)


def _text_of(value: object) -> str:
    """Return anything as text that can be encoded; file names may have bytes that are no text."""
    return str(value).encode(errors="replace").decode()


_AS_JSON: list[Processor] = [
    structlog.processors.format_exc_info,
    structlog.processors.JSONRenderer(_to_json),
]


def _for_people(*, colors: bool) -> list[Processor]:
    show = structlog.dev.ConsoleRenderer(
        colors=colors,
        sort_keys=False,
        exception_formatter=structlog.dev.plain_traceback,  # the other shows local variables
    )
    return [_escape, lambda *arguments: str(show(*arguments)).encode(errors="replace")]


def _escape(_logger: Any, _method: str, event: MutableMapping[str, Any]) -> dict[str, Any]:
    """Escape control characters: clients choose paths, and a terminal would obey them."""
    return {name: _printable(value) for name, value in event.items() if value is not None}


def _printable(value: Any) -> Any:
    if isinstance(value, str) and not value.isprintable():
        return value.encode("unicode_escape").decode()
    return value


class _Forward(logging.Handler):
    """A handler for the standard library's loggers, such as uvicorn's."""

    def emit(self, record: logging.LogRecord) -> None:
        """Log a record as all else; its level is the next lower one that has a name."""
        level = min(record.levelno // 10 * 10, logging.CRITICAL)
        logger = structlog.get_logger(module=record.name)
        logger.log(level, record.getMessage(), exc_info=record.exc_info)
