"""A form with files, read as it comes: the files go to the disk at once, and nothing grows beyond its limit."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header

from planish.settings import ServeSettings
from planish.web.problems import HTTPProblem

FILE_FIELDS = ("scan", "photo", "camera")
_MAX_VALUE_BYTES = 1000
_MAX_FIELDS = 100
_MAX_NAME_BYTES = 150


@dataclass
class Form:
    """What came: the files by the field they came in, as they were called; and the values of the other fields."""

    files: dict[str, list[Path]] = field(default_factory=lambda: {name: [] for name in FILE_FIELDS})
    values: dict[str, str] = field(default_factory=dict)


class FormReader:
    """Takes a form's bytes in pieces of any size.

    Parameters
    ----------
    content_type : str
        The header.
    folder : Path
        For the files.
    limits : ServeSettings
    """

    def __init__(self, content_type: str, folder: Path, limits: ServeSettings):
        kind, options = parse_options_header(content_type)
        if kind != b"multipart/form-data" or not options.get(b"boundary"):
            raise HTTPProblem(415, "a form with files is wanted: multipart/form-data, as browsers and curl -F send it")
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
        """Take the next piece.

        Raises
        ------
        HTTPProblem
            413 beyond a limit, 415 or 422 where the form is not what is wanted.
        """
        self.bytes_read += len(data)
        if self.bytes_read > self.limits.upload_mb * 1e6:
            raise too_large(self.limits)
        try:
            self._parser.write(data)
        except FormParserError:
            raise HTTPProblem(422, "the form is damaged, and no multipart/form-data") from None

    def finish(self) -> Form:
        """Say that all has come."""
        if not self.complete:
            raise HTTPProblem(422, "the form was cut short: its end is missing")
        return self.form

    def close(self) -> None:
        """Close the file that is being written, if there is one."""
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
            raise HTTPProblem(422, f"{self._name} is to be a file; it came as a text")
        elif len(self.form.values) >= _MAX_FIELDS:
            raise HTTPProblem(413, f"the form has more than {_MAX_FIELDS} fields")

    def _open_file(self, name: str) -> None:
        if self._name not in FILE_FIELDS:
            raise HTTPProblem(422, f"files are taken as {', '.join(FILE_FIELDS)}; one came as {self._name[:60]!a}")
        if not name:  # what browsers send where no file was chosen
            return
        if sum(map(len, self.form.files.values())) >= self.limits.files:
            raise HTTPProblem(413, f"at most {self.limits.files} files are taken at once")
        path = self.folder / plain_name(name)
        try:
            self._file = path.open("xb")
        except FileExistsError:
            raise HTTPProblem(422, f"two files are called {path.name!a}; each needs a name of its own") from None
        except OSError:
            raise HTTPProblem(422, f"a file cannot be called {path.name!a} here; give it another name") from None
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
                raise HTTPProblem(422, f"{self._name[:60]!a} came twice")
            self.form.values[self._name] = self._value.decode("utf-8", "replace")

    def _complete(self) -> None:
        self.complete = True


def too_large(limits: ServeSettings) -> HTTPProblem:
    """For uploads beyond the limit."""
    return HTTPProblem(413, f"at most {limits.upload_mb:g} MB are taken at once; send fewer points or a smaller photo")


def plain_name(name: str) -> str:
    """The name of a file in the upload's folder.

    Raises
    ------
    HTTPProblem
        422 for names that lead elsewhere or cannot be seen.

    Examples
    --------
    >>> plain_name("scan.obj")
    'scan.obj'
    >>> plain_name("../scan.obj")
    Traceback (most recent call last):
    planish.web.problems.Refusal: '../scan.obj' is no plain name of a file; give it another
    """
    name = unicodedata.normalize("NFC", name)
    is_invalid = (
        not name.isprintable() or any(mark in name for mark in "/\\:") or name.startswith(".") or name != name.strip()
    )
    if is_invalid or not 0 < len(name.encode("utf-8", "replace")) <= _MAX_NAME_BYTES:
        raise HTTPProblem(422, f"{name[:60]!a} is no plain name of a file; give it another")
    return name
