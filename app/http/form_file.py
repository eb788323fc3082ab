"""A form with one file, whose content is passed on as it arrives."""

from collections.abc import AsyncIterator

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header

from app.errors import problem


class FormFile:
    """The file of a form; its name and type are known once its content has come.

    Starlette's form would go through the system's temporary folder, which may be in memory.
    """

    def __init__(self, content_type: str) -> None:
        _, options = parse_options_header(content_type)
        if b"boundary" not in options:
            raise problem("malformed_body", "the Content-Type of the form has no boundary")
        self.name = self.content_type = ""
        self._header = self._value = b""
        self._headers: dict[bytes, bytes] = {}
        self._parts = 0
        self._content = bytearray()
        self._parser = MultipartParser(
            options[b"boundary"],
            {
                "on_part_begin": self._begin,
                "on_header_field": self._add_to_header,
                "on_header_value": self._add_to_value,
                "on_header_end": self._end_header,
                "on_headers_finished": self._end_headers,
                "on_part_data": self._add_to_content,
            },
        )

    async def content(self, body: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
        """Yield the content of the file, from the body of the request."""
        try:
            async for chunk in body:
                self._parser.write(chunk)
                yield bytes(self._content)
                self._content.clear()
            self._parser.finalize()
        except FormParserError as error:
            raise problem("malformed_body", f"the form cannot be read: {error}") from error
        if not self._parts:
            raise problem("malformed_body", "the form has no file")

    def _begin(self) -> None:
        self._parts += 1
        if self._parts > 1:
            raise problem("malformed_body", "the form has more than one part")

    def _add_to_header(self, data: bytes, start: int, end: int) -> None:
        self._header += data[start:end]

    def _add_to_value(self, data: bytes, start: int, end: int) -> None:
        self._value += data[start:end]

    def _end_header(self) -> None:
        self._headers[self._header.lower()] = self._value
        self._header = self._value = b""

    def _end_headers(self) -> None:
        _, options = parse_options_header(self._headers.get(b"content-disposition"))
        if b"filename" not in options:
            raise problem("malformed_body", "the form has a field that is no file")
        self.name = _text(options[b"filename"])
        self.content_type = _text(self._headers.get(b"content-type", b""))

    def _add_to_content(self, data: bytes, start: int, end: int) -> None:
        self._content += data[start:end]


def _text(value: bytes) -> str:
    try:
        return value.decode()
    except UnicodeDecodeError:
        return value.decode("latin-1")
