"""`python -m radiosity ARGUMENTS`: the command line outside Blender, with the bpy wheel."""

from __future__ import annotations

import sys

from .radiosity_addon import command

if __name__ == "__main__":
    sys.exit(command.main(sys.argv[1:]))
