"""Streaming parser of multipart forms: files go to disk at once, and all sizes are limited."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header

from planish.settings import ServeSettings
from planish.system import is_device_name
from planish.web.problems import HTTPProblem

FILE_FIELDS = ("scan", "photo", "camera")
_MAX_VALUE_BYTES = 1000
_MAX_FIELDS = 100
_MAX_NAME_BYTES = 150


@dataclass
class Form:
    """Uploaded files by form field, and the values of the other fields."""

    files: dict[str, list[Path]] = field(default_factory=lambda: {name: [] for name in FILE_FIELDS})
    values: dict[str, str] = field(default_factory=dict)


class FormReader:
    """Parses a form from chunks of any size.

    Parameters
    ----------
    content_type : str
        The Content-Type header.
    folder : Path
        Destination of the files.
    limits : ServeSettings
    """

    def __init__(self, content_type: str, folder: Path, limits: ServeSettings):
        kind, options = parse_options_header(content_type)
        if kind != b"multipart/form-data" or not options.get(b"boundary"):
            raise HTTPProblem(415, "expected a form with files: multipart/form-data, as sent by browsers and curl -F")
        self.form, self.folder, self.limits = Form(), folder, limits
        self.bytes_read = 0
        self.complete = False
        self._file: BinaryIO | None = None
        self._name, self._value = "", bytearray()
        self._header, self._header_value = bytearray(), bytearray()
        self._headers: dict[bytes, bytes] = {}
        try:
            self._parser = MultipartParser(options[b"boundary"], self._callbacks())  # type: ignore[arg-type]
        except FormParserError:
            raise HTTPProblem(422, "the form's boundary is too long") from None

    def feed(self, data: bytes) -> None:
        """Parse the next chunk.

        Raises
        ------
        HTTPProblem
            413 if a limit is exceeded, 415 or 422 if the form is invalid.
        """
        self.bytes_read += len(data)
        if self.bytes_read > self.limits.upload_mb * 1e6:
            raise too_large(self.limits)
        try:
            self._parser.write(data)
        except FormParserError:
            raise HTTPProblem(422, "the form is damaged: it is not valid multipart/form-data") from None

    def finish(self) -> Form:
        """Return the form after the last chunk."""
        if not self.complete:
            raise HTTPProblem(422, "the form was cut short: its end is missing")
        return self.form

    def close(self) -> None:
        """Close the file that is being written, if any."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _callbacks(self) -> dict[str, object]:
        return {
            "on_part_begin": self._begin,
            "on_header_field": lambda data, start, end: self._header.extend(data[start:end]),
            "on_header_value": lambda data, start, end: self._header_value.extend(data[start:end]),
            "on_header_end": self._end_header,
            "on_headers_finished": self._open,
            "on_part_data": lambda data, start, end: self._take(data[start:end]),
            "on_part_end": self._end,
            "on_end": self._complete,
        }

    def _begin(self) -> None:
        self._headers = {}
        self._value = bytearray()

    def _end_header(self) -> None:
        self._headers[bytes(self._header).lower()] = bytes(self._header_value)
        self._header, self._header_value = bytearray(), bytearray()

    def _open(self) -> None:
        kind, options = parse_options_header(self._headers.get(b"content-disposition", b""))
        if kind != b"form-data" or b"name" not in options:
            raise HTTPProblem(422, "a part of the form has no name")
        self._name = options[b"name"].decode("utf-8", "replace")
        if b"filename" in options:
            self._open_file(options[b"filename"].decode("utf-8", "replace"))
        elif self._name in FILE_FIELDS:
            raise HTTPProblem(422, f"{self._name} must be a file, not text")
        elif len(self.form.values) >= _MAX_FIELDS:
            raise HTTPProblem(413, f"the form has more than {_MAX_FIELDS} fields")

    def _open_file(self, name: str) -> None:
        if self._name not in FILE_FIELDS:
            raise HTTPProblem(422, f"files are accepted as {', '.join(FILE_FIELDS)}, not as {self._name[:60]!a}")
        if not name:  # sent by browsers if no file was chosen
            return
        if sum(map(len, self.form.files.values())) >= self.limits.files:
            raise HTTPProblem(413, f"too many files; the limit is {self.limits.files}")
        path = self.folder / plain_name(name)
        try:
            self._file = path.open("xb")
        except FileExistsError:
            raise HTTPProblem(422, f"two files are called {path.name!a}; give each a unique name") from None
        except OSError:
            raise HTTPProblem(422, f"{path.name!a} is not a valid file name here; rename the file") from None
        self.form.files[self._name].append(path)

    def _take(self, data: bytes) -> None:
        if self._file is not None:
            self._file.write(data)
        else:
            self._value.extend(data)
            if len(self._value) > _MAX_VALUE_BYTES:
                raise HTTPProblem(413, f"{self._name[:60]!a} is longer than {_MAX_VALUE_BYTES} bytes")

    def _end(self) -> None:
        if self._file is not None:
            self.close()
        elif self._name not in FILE_FIELDS:
            if self._name in self.form.values:
                raise HTTPProblem(422, f"{self._name[:60]!a} was sent twice")
            self.form.values[self._name] = self._value.decode("utf-8", "replace")

    def _complete(self) -> None:
        self.complete = True


def too_large(limits: ServeSettings) -> HTTPProblem:
    """Problem of an upload that exceeds the size limit."""
    return HTTPProblem(
        413, f"the upload is larger than the limit of {limits.upload_mb:g} MB; send fewer points or a smaller photo"
    )


def plain_name(name: str) -> str:
    """Check and normalize the name of an uploaded file.

    Raises
    ------
    HTTPProblem
        422 for names with path separators, invisible characters, or such that Windows does not take.

    Examples
    --------
    >>> plain_name("scan.obj")
    'scan.obj'
    >>> plain_name("../scan.obj")
    Traceback (most recent call last):
    planish.web.problems.HTTPProblem: '../scan.obj' is not a plain file name; rename the file
    """
    name = unicodedata.normalize("NFC", name)
    is_invalid = (
        not name.isprintable()
        or any(mark in name for mark in '/\\:*?"<>|')
        or name.startswith(".")
        or name != name.strip().rstrip(".")
        or is_device_name(name)
    )
    if is_invalid or not 0 < len(name.encode("utf-8", "replace")) <= _MAX_NAME_BYTES:
        raise HTTPProblem(422, f"{name[:60]!a} is not a plain file name; rename the file")
    return name
