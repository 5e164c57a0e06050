"""`python -m radiosity ARGUMENTS`: the command line outside Blender, with the bpy wheel."""

from __future__ import annotations

import importlib
import os
import sys
import tempfile


def main() -> int:
    """Run the command line; the exit code is the command's."""
    with tempfile.TemporaryDirectory(prefix="radiosity-") as folder:
        # Importing bpy puts the user's extension wheels ahead of this Python's packages; an empty folder has none.
        os.environ.setdefault("BLENDER_USER_RESOURCES", folder)
        command = importlib.import_module(".radiosity_addon.command", __package__)
        code: int = command.main(sys.argv[1:])
        return code


if __name__ == "__main__":
    sys.exit(main())
