"""Warnings in the words of the panel: they name options of the command line, which a window does not have."""

from __future__ import annotations

import re

from .settings import RADIOSITY_PG_settings

# An option, switched off or not.
OPTION = re.compile(r"--(no-)?([a-z]+(?:-[a-z]+)*)")


def in_panel_words(text: str) -> str:
    """A warning with the names of settings in place of their options; an option without a setting stays."""
    return OPTION.sub(_in_words, text)


def _in_words(option: re.Match[str]) -> str:
    setting = RADIOSITY_PG_settings.bl_rna.properties.get(option[2].replace("-", "_"))
    if setting is None:
        return option[0]
    return f"{setting.name} off" if option[1] else str(setting.name)
