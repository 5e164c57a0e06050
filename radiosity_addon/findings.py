"""What a check or a bake found, kept in the scene for the panel."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from .panel_words import in_panel_words


def keep_findings(scene: Any, warnings: Iterable[dict[str, Any]]) -> None:
    """Put warnings in place of older ones."""
    view = scene.radiosity_view
    view.findings.clear()
    for warning in warnings:
        finding = view.findings.add()
        finding.name = str(warning.get("object") or "")
        finding.code, finding.message = str(warning["code"]), in_panel_words(str(warning["message"]))
    view.checked = True
