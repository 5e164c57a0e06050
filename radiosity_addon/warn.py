"""What the user should know, collected on the way: the report's `warnings`."""

from __future__ import annotations

from typing import Any

Warnings = list[dict[str, Any]]


def warn(warnings: Warnings, name: str, code: str, message: str) -> None:
    """Add a warning about the object or material `name`, once."""
    entry = {"object": name, "code": code, "message": message}
    if entry not in warnings:
        warnings.append(entry)


def as_line(warning: dict[str, Any]) -> str:
    """A warning as one line of text."""
    name = warning.get("object")
    return f"{name}: {warning['message']}" if name else str(warning["message"])
