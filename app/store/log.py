"""The store's log lines."""


def warn(event: str, **fields: object) -> None:
    """Write a warning with these fields."""
    import structlog  # a tenth of the start of the command line, which has no log

    structlog.get_logger(module="app.store").warning(event, **fields)
