"""The command line: one parser behind `python -m radiosity`, `blender -c radiosity` and the operator's options.

Imports no bpy before `main` has prepared the environment.
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from ..solver.errors import OutputError, RadiosityError, SettingsError
from ..solver.settings import ATLASES, PASSES, PRESETS, QUANTITIES, TARGETS
from . import compare_request, interrupts

PROGRAM = "radiosity"
# Arguments that are words of `solver.Settings`.
WORDS = ("target", "error", "uv_layer", "resolution", "texel_density", "max_pages", "atlas", "quantity", "passes",
         "only", "footprint", "margin", "seed", "threads")


class _Parser(argparse.ArgumentParser):
    """Tells of wrong arguments in one line, by SettingsError."""

    def error(self, message: str) -> NoReturn:
        raise SettingsError(f"{message} (see {self.prog} --help)")


def build_parser(*, blend: bool = True) -> argparse.ArgumentParser:
    """The parser of all sub-commands; with `blend` they take the .blend's path first, else the open file is meant."""
    parser = _Parser(prog=PROGRAM, description="Radiosity lightmaps for Blender scenes.", allow_abbrev=False)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)
    bake = commands.add_parser("bake", help="bake lightmaps or vertex colours", allow_abbrev=False)
    relight = commands.add_parser("relight", allow_abbrev=False,
                                  help="new lamp strengths and base colours into baked images, without a bake")
    check = commands.add_parser("check", help="tell what will bake and what will not, and why", allow_abbrev=False)
    for command in (bake, check, relight):
        if blend:
            command.add_argument("blend", type=Path, metavar="SCENE.blend", help="the scene")
        _add_words(command)
        _add_places(command)
        _add_groups(command, keep=command is not relight)
    compare = commands.add_parser("compare", help="bake with Cycles too, and tell the error and both times",
                                  allow_abbrev=False)
    if blend:
        compare.add_argument("blend", type=Path, metavar="SCENE.blend", help="the scene")
    _add_words(compare)
    compare_request.add_arguments(compare)
    return parser


def _add_words(parser: argparse.ArgumentParser) -> None:
    """The words of the settings; one that is not given is as the scene's panel has it."""
    words = parser.add_argument_group("what to bake; by default as the scene's Radiosity panel says")

    def add(name: str, **options: Any) -> None:
        words.add_argument(name, default=argparse.SUPPRESS, **options)

    quality = words.add_mutually_exclusive_group()
    quality.add_argument("--error", type=float, default=argparse.SUPPRESS, metavar="E",
                         help="wanted relative error of the light, .03 is 3 per cent")
    quality.add_argument("--preset", choices=PRESETS, default=argparse.SUPPRESS,
                         help=", ".join(f"{name} {error:g}" for name, error in PRESETS.items()))
    add("--target", choices=TARGETS, help="images, or a colour attribute on the mesh corners")
    add("--uv-layer", metavar="NAME", help="use this UV map as it is; else UVMap_Lightmap is made")
    add("--resolution", type=int, metavar="PX", help="pixels a side of each image")
    add("--texel-density", type=float, metavar="D", help="pixels per metre, instead of --resolution")
    add("--max-pages", type=int, metavar="N", help="most images of a shared atlas")
    add("--atlas", choices=ATLASES, help="one image an object, or shared pages")
    add("--quantity", choices=QUANTITIES, help="what a pixel says")
    add("--passes", choices=PASSES, help="which light")
    add("--only", action="append", metavar="NAME", help="bake this object; may be given again for more")
    add("--footprint", type=float, metavar="F", help="part of a texel, each way, that its value is the mean of")
    add("--margin", type=int, metavar="PX", help="pixels of dilation")
    add("--seed", type=int, metavar="N", help="same seed, same result")
    add("--threads", type=int, metavar="N", help="worker threads, 0 for all cores")


def _add_groups(parser: argparse.ArgumentParser, *, keep: bool) -> None:
    groups = parser.add_argument_group("light groups")
    if keep:
        groups.add_argument("--groups", choices=("none", "lamp", "collection", "all"), default=argparse.SUPPRESS,
                            help="lights to keep apart, so that `relight` can change them later")
        groups.add_argument("--reflectances", action=argparse.BooleanOptionalAction, default=argparse.SUPPRESS,
                            help="with --groups: keep what `relight` needs to follow other base colours too")
    groups.add_argument("--group-layers", action=argparse.BooleanOptionalAction, default=argparse.SUPPRESS,
                        help="write the groups as layers of an EXR file beside each image")


def _add_places(parser: argparse.ArgumentParser) -> None:
    places = parser.add_argument_group("where results go")
    places.add_argument("--output", type=Path, metavar="DIR", default=argparse.SUPPRESS,
                        help="folder of the image files (default: lightmaps, beside the .blend)")
    places.add_argument("--report", type=Path, metavar="PATH", default=argparse.SUPPRESS,
                        help="the report (default: report.json in the output folder)")
    places.add_argument("--save", type=Path, metavar="BAKED.blend", default=argparse.SUPPRESS,
                        help="write a .blend with the new UV maps and images; the scene's own file is never changed")
    places.add_argument("--pack", action=argparse.BooleanOptionalAction, default=argparse.SUPPRESS,
                        help="keep the images inside the saved .blend too")
    places.add_argument("--apply-modifiers", action=argparse.BooleanOptionalAction, default=argparse.SUPPRESS,
                        help="apply modifiers that keep a mesh from holding its result (default: with --save)")


def parse(argv: Sequence[str], *, blend: bool) -> argparse.Namespace:
    """The arguments; a preset has become an error, and paths are absolute.

    Raises
    ------
    SettingsError
        If they are wrong.
    """
    arguments = build_parser(blend=blend).parse_args(list(argv))
    if "preset" in arguments:
        arguments.error = PRESETS[arguments.preset]
    for name in ("blend", "output", "report", "save"):
        if name in arguments:
            setattr(arguments, name, getattr(arguments, name).expanduser().absolute())
    return arguments


def parse_options(text: str, command: str = "bake") -> argparse.Namespace:
    """The options of a sub-command from one line of text, for its operator.

    Raises
    ------
    SettingsError
        If they are wrong, or ask for the help, which would end Blender.
    """
    try:
        words = shlex.split(text)
    except ValueError as cause:
        raise SettingsError(f"options {text!r} can't be read: {cause}") from cause
    try:
        return parse([command, *words], blend=False)
    except SystemExit:
        raise SettingsError(f"options {text!r} ask for the help, which is on the terminal: leave it away to {command}"
                            ) from None


def request_of(arguments: argparse.Namespace, scene: Any, blend: str) -> Any:
    """The Request of these arguments over the settings of a scene whose .blend is `blend`.

    Raises
    ------
    SettingsError
        On a value that makes no sense, or if there is no folder to write to.
    """
    from .request import Request, folder_beside, not_own
    from .settings import groups_of, settings_of

    given = vars(arguments)
    settings = settings_of(scene, {name: given[name] for name in WORDS if name in given})
    output = given.get("output") or folder_beside(
        blend, scene.radiosity.output, advice="give a folder with --output, or save it first")
    save = not_own(given.get("save"), blend)
    return Request(settings, output, given.get("report"), save, given.get("pack", scene.radiosity.pack),
                   given.get("apply_modifiers", scene.radiosity.apply_modifiers or save is not None),
                   groups_of(scene, given), given.get("group_layers", scene.radiosity.group_layers),
                   given.get("reflectances", scene.radiosity.reflectances))


def compare_request_of(arguments: argparse.Namespace, scene: Any, blend: str) -> Any:
    """The CompareRequest of these arguments, as `request_of`."""
    from .settings import settings_of

    given = vars(arguments)
    settings = settings_of(scene, {name: given[name] for name in WORDS if name in given})
    return compare_request.request_of(given, settings, blend)


def main(argv: Sequence[str]) -> int:
    """`python -m radiosity`: open the .blend with Blender as a module, and do what is asked; returns the exit code."""
    try:
        arguments = parse(argv, blend=True)
    except RadiosityError as error:
        return _tell(error)
    with tempfile.TemporaryDirectory(prefix="radiosity-") as folder:
        # Importing bpy puts the user's extension wheels ahead of this Python's packages; an empty folder has none.
        os.environ.setdefault("BLENDER_USER_RESOURCES", folder)
        try:
            import bpy  # noqa: F401
        except ImportError:
            return _tell(OutputError("Blender is not there as a Python module: install it (pip install bpy), "
                                     "or use `blender -b scene.blend -c radiosity`"))
        from . import register, unregister
        from .blend_file import open_blend

        register()
        try:
            interrupts.refuse()
            open_blend(arguments.blend)
            interrupts.refuse()
            return _run(arguments)
        except RadiosityError as error:
            return _tell(error)
        finally:
            unregister()


def execute(argv: Sequence[str]) -> int:
    """`blender -b scene.blend -c radiosity ...`: do what is asked with the open file; returns the exit code."""
    try:
        return _run(parse(argv, blend=False))
    except RadiosityError as error:
        return _tell(error)
    except SystemExit as end:  # --help
        return int(end.code or 0)


def _run(arguments: argparse.Namespace) -> int:
    import bpy

    from .blend_file import leave_edit_mode

    scene, view_layer = bpy.context.scene, bpy.context.view_layer
    leave_edit_mode(view_layer)
    if arguments.command == "compare":
        from .compare_command import compare

        return compare(compare_request_of(arguments, scene, bpy.data.filepath), scene, view_layer)
    request = request_of(arguments, scene, bpy.data.filepath)
    if arguments.command == "check":
        from .check import check

        return check(request, scene, view_layer)
    if arguments.command == "relight":
        from .relight import relight_command

        return relight_command(request, scene, view_layer, vars(arguments))
    from .job import run
    from .summary import print_outcome

    outcome = run(request, scene, view_layer)
    print_outcome(outcome.report, request, outcome.exit_code)
    return outcome.exit_code


def _tell(error: RadiosityError) -> int:
    """One line on standard error; the exit code."""
    text = " ".join(str(error).split())
    print(f"{PROGRAM}: error: {text}", file=sys.stderr, flush=True)
    return error.exit_code
