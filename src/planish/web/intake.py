"""An upload on its way in: from the request to a folder with a scan that may be tried, or to a refusal."""

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
from planish.web.look import look
from planish.web.problems import Refusal

_PIECE = 1 << 18
_MOST_UNREAD = 20e6
"""Bytes that are read and thrown away after a refusal, for clients that listen only when they have said all."""


async def take_in(request: Request, home: Path, limits: ServeSettings) -> tuple[str, dict[str, Any]]:
    """Read a request's form into `home`/in, and check all of it.

    Returns
    -------
    title : str
    wanted : dict
        As `planish.web.work.restore_upload` takes it.

    Raises
    ------
    Refusal
        408 where it takes too long, 413, 415 and 422; nothing is left in the folder then.
    """
    _check_length(request, limits)
    folder = home / "in"
    reader: FormReader | None = None
    try:
        async with asyncio.timeout(limits.upload_seconds):
            await run_in_threadpool(folder.mkdir, parents=True)
            reader = FormReader(request.headers.get("content-type", ""), folder, limits)
            form = await _read(request, reader)
        return await run_in_threadpool(_checked, form, folder, limits)
    except BaseException as problem:
        if reader is not None:
            reader.close()
        await run_in_threadpool(shutil.rmtree, home, ignore_errors=True)
        if isinstance(problem, TimeoutError):
            raise Refusal(408, f"the upload took longer than {limits.upload_seconds:g} s; send less") from None
        if isinstance(problem, ClientDisconnect):
            raise Refusal(400, "the upload was cut short") from None
        if isinstance(problem, OSError):
            raise Refusal(503, "the upload cannot be kept: the server's disk is full or out of order") from problem
        raise


def _check_length(request: Request, limits: ServeSettings) -> None:
    told = request.headers.get("content-length", "")
    if told.isdigit() and int(told) > limits.upload_mb * 1e6:
        raise too_large(limits)


async def _read(request: Request, reader: FormReader) -> Form:
    waiting = bytearray()
    stream = request.stream()
    try:
        async for piece in stream:
            waiting += piece
            if len(waiting) >= _PIECE:
                await run_in_threadpool(reader.feed, bytes(waiting))
                waiting.clear()
        await run_in_threadpool(reader.feed, bytes(waiting))
        return reader.finish()
    except Refusal:
        unread = 0
        async for piece in stream:
            unread += len(piece)
            if unread > _MOST_UNREAD:
                break
        raise


def _checked(form: Form, folder: Path, limits: ServeSettings) -> tuple[str, dict[str, Any]]:
    read_fields(form.values)
    upload = look(form, folder, limits)
    return upload.title, {**asdict(upload), "fields": form.values}
