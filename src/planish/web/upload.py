"""Receive an upload: from the request to a folder with a validated scan."""

from __future__ import annotations

import asyncio
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request

from planish.settings import ServeSettings
from planish.web.fields import read_fields
from planish.web.form import Form, FormReader, too_large
from planish.web.inspect_upload import inspect_upload
from planish.web.problems import HTTPProblem

_CHUNK_BYTES = 1 << 18
_MAX_DISCARDED_BYTES = 20e6
"""Bytes that are read and discarded after a refusal, for clients that read the response only after sending all."""


async def receive_upload(request: Request, job_folder: Path, limits: ServeSettings) -> tuple[str, dict[str, Any]]:
    """Read a request's form into `job_folder`/in and validate it.

    Returns
    -------
    title : str
    request_data : dict
        Fields of `planish.web.restore_upload.UploadRequest`, with the form's values as `fields`.

    Raises
    ------
    HTTPProblem
        408 on timeout, 413, 415 or 422; the folder is removed.
    """
    _check_content_length(request, limits)
    folder = job_folder / "in"
    reader: FormReader | None = None
    try:
        async with asyncio.timeout(limits.upload_seconds):
            await run_in_threadpool(folder.mkdir, parents=True)
            reader = FormReader(request.headers.get("content-type", ""), folder, limits)
            form = await _read_form(request, reader)
        return await run_in_threadpool(_validate, form, folder, limits)
    except BaseException as problem:
        if reader is not None:
            reader.close()
        await run_in_threadpool(shutil.rmtree, job_folder, ignore_errors=True)
        if isinstance(problem, TimeoutError):
            raise HTTPProblem(
                408, f"the upload exceeded the time limit of {limits.upload_seconds:g} s; send less"
            ) from None
        if isinstance(problem, ClientDisconnect):
            raise HTTPProblem(400, "the upload was cut short") from None
        if isinstance(problem, OSError):
            raise HTTPProblem(503, "the upload cannot be stored: the server's disk is full or failing") from problem
        raise


def _check_content_length(request: Request, limits: ServeSettings) -> None:
    content_length = request.headers.get("content-length", "")
    if content_length.isdigit() and int(content_length) > limits.upload_mb * 1e6:
        raise too_large(limits)


async def _read_form(request: Request, reader: FormReader) -> Form:
    buffer = bytearray()
    stream = request.stream()
    try:
        async for chunk in stream:
            buffer += chunk
            if len(buffer) >= _CHUNK_BYTES:
                await run_in_threadpool(reader.feed, bytes(buffer))
                buffer.clear()
        await run_in_threadpool(reader.feed, bytes(buffer))
        return reader.finish()
    except HTTPProblem:
        discarded = 0
        async for chunk in stream:
            discarded += len(chunk)
            if discarded > _MAX_DISCARDED_BYTES:
                break
        raise


def _validate(form: Form, folder: Path, limits: ServeSettings) -> tuple[str, dict[str, Any]]:
    read_fields(form.values)
    upload = inspect_upload(form, folder, limits)
    return upload.title, {**asdict(upload), "fields": form.values}
