"""`python -m radiosity ARGUMENTS`: the command line outside Blender, with the bpy wheel."""

from __future__ import annotations

import sys

from .radiosity_addon import interrupts

if __name__ == "__main__":
    interrupts.watch()
    # Loads NumPy and the solver.
    from .radiosity_addon import command

    sys.exit(command.main(sys.argv[1:]))
