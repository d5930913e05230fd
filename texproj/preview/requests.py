"""What a request carries."""

from __future__ import annotations

from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request


async def body(request: Request) -> dict[str, Any]:
    """The JSON object that a request carries; only that type is read, which other web sites
    cannot send without asking first."""
    if request.headers.get("content-type", "").split(";")[0].strip() != "application/json":
        raise HTTPException(415, "send application/json")
    try:
        data = await request.json()
    except (ValueError, RecursionError):  # no JSON, no text, an integer of thousands of digits
        raise HTTPException(400, "not JSON") from None
    if not isinstance(data, dict):
        raise HTTPException(400, "expected a JSON object")
    return data
