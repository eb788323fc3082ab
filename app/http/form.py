"""Forms (multipart/form-data), read part by part as they arrive."""

from collections.abc import Callable

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header

from app.errors import problem


class Form:
    """A form, whose parts are passed on as they arrive.

    Starlette's form would go through the system's temporary folder, which may be in memory.

    Parameters
    ----------
    content_type
        The header of the request.
    on_part
        Is called at the beginning of each part, with the options of its Content-Disposition and its
        own Content-Type.
    on_data
        Is called with the content of the part, bit by bit.
    """

    def __init__(
        self,
        content_type: str,
        on_part: Callable[[dict[bytes, bytes], bytes], None],
        on_data: Callable[[bytes], None],
    ) -> None:
        _, options = parse_options_header(content_type)
        if b"boundary" not in options:
            raise problem("malformed_body", "the Content-Type of the form has no boundary")
        self._on_part = on_part
        self._header = self._value = b""
        self._headers: dict[bytes, bytes] = {}
        self._parser = MultipartParser(
            options[b"boundary"],
            {
                "on_part_begin": self._headers.clear,
                "on_header_field": self._add_to_header,
                "on_header_value": self._add_to_value,
                "on_header_end": self._end_header,
                "on_headers_finished": self._end_headers,
                "on_part_data": lambda data, start, end: on_data(data[start:end]),
            },
        )

    def write(self, data: bytes) -> None:
        """Read a bit of the body; raises ``ProblemError`` where it is no form."""
        try:
            self._parser.write(data)
        except FormParserError as error:
            raise _unreadable(error) from error

    def end(self) -> None:
        """Refuse a body that has not ended."""
        try:
            self._parser.finalize()
        except FormParserError as error:
            raise _unreadable(error) from error

    def _add_to_header(self, data: bytes, start: int, end: int) -> None:
        self._header += data[start:end]

    def _add_to_value(self, data: bytes, start: int, end: int) -> None:
        self._value += data[start:end]

    def _end_header(self) -> None:
        self._headers[self._header.lower()] = self._value
        self._header = self._value = b""

    def _end_headers(self) -> None:
        _, options = parse_options_header(self._headers.get(b"content-disposition"))
        self._on_part(options, self._headers.get(b"content-type", b""))


def _unreadable(error: FormParserError) -> Exception:
    return problem("malformed_body", f"the form cannot be read: {error}")
