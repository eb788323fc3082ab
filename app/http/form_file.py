"""A form with one file, whose content is passed on as it arrives."""

from collections.abc import AsyncIterator

from app.errors import problem
from app.http.form import Form


class FormFile:
    """The file of a form; its name and type are known once its content has come."""

    def __init__(self, content_type: str) -> None:
        self.name = self.content_type = ""
        self._parts = 0
        self._content = bytearray()
        self._form = Form(content_type, self._begin, self._content.extend)

    async def content(self, body: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
        """Yield the content of the file, from the body of the request."""
        async for chunk in body:
            self._form.write(chunk)
            yield bytes(self._content)
            self._content.clear()
        self._form.end()
        if not self._parts:
            raise problem("malformed_body", "the form has no file")

    def _begin(self, options: dict[bytes, bytes], content_type: bytes) -> None:
        self._parts += 1
        if self._parts > 1:
            raise problem("malformed_body", "the form has more than one part")
        if b"filename" not in options:
            raise problem("malformed_body", "the form has a field that is no file")
        self.name = _text(options[b"filename"])
        self.content_type = _text(content_type)


def _text(value: bytes) -> str:
    try:
        return value.decode()
    except UnicodeDecodeError:
        return value.decode("latin-1")
