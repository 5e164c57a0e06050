"""One bake as the user asked for it: the solver's settings and where results go."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from ..solver.errors import OutputError, SettingsError
from ..solver.settings import Settings
from ..solver.whole_file import part_of, reason
from .report import is_report

DEFAULT_FOLDER = "lightmaps"
REPORT_NAME = "report.json"
# Endings of the other files that we write: a report by such a name would take the place of one, or lose its own to it.
OTHERS = (".blend", ".exr", ".html", ".png")


@dataclass(frozen=True)
class Request:
    """What is asked of a bake.

    Parameters
    ----------
    settings : how to bake.
    output : folder of the image files; None for a bake into the open .blend alone.
    report : path of report.json; None for the one in `output`.
    save : path of a .blend to write with the results; None leaves files as they are.
    pack : keep the images inside the .blend too, so that it needs no other file.
    apply_modifiers : where modifiers stop the UV map from being stored, apply them.
    groups : which lights are kept apart for a relight: "none", by "lamp", by "collection", or "all" lamps in one.
    group_layers : write the groups as layers of an EXR file beside each image.
    reflectances : with groups, keep what a relight needs to follow other reflectances too.
    passed_over : names of objects that are selected and left out, since they have no mesh.
    """

    settings: Settings = field(default_factory=Settings)
    output: Path | None = None
    report: Path | None = None
    save: Path | None = None
    pack: bool = False
    apply_modifiers: bool = False
    groups: str = "none"
    group_layers: bool = False
    reflectances: bool = False
    passed_over: tuple[str, ...] = ()

    @property
    def keep_paths(self) -> bool:
        """Whether a bake keeps its paths (see `solver.paths`): they are of use with groups alone."""
        return self.reflectances and self.groups != "none"

    @property
    def report_path(self) -> Path | None:
        """Where report.json goes, or None."""
        if self.report is not None:
            return self.report
        return self.output / REPORT_NAME if self.output is not None else None

    def check_writable(self) -> list[Path]:
        """Fail before the long work if a result could not be written; the folders that had to be made for it.

        They are listed the outermost first; none of them stays where it fails.

        Raises
        ------
        OutputError
            With the folder's path and what to do.
        SettingsError
            See `refuse_names`.
        """
        self.refuse_names()
        files = [path for path in (self.report_path, self.save) if path is not None]
        made: list[Path] = []
        try:
            for folder in dict.fromkeys([*([self.output] if self.output else []), *(path.parent for path in files)]):
                made += (path for path in (*reversed(folder.parents), folder) if not os.path.exists(path))
                _check_folder(folder)
            for path in files:
                _check_name(path)
                if path.exists() and not path.is_file():
                    raise OutputError(f"{path} is no file: give the name of a file")
                if path.exists() and not os.access(path, os.W_OK):
                    raise OutputError(f"{path} may not be written: change its rights or choose another name")
        except (OutputError, OSError):
            remove_empty(made)
            raise
        return made

    def refuse_names(self) -> None:
        """Refuse names by which the report or the .blend would take the place of something else.

        Raises
        ------
        SettingsError
            With the path and what to do.
        """
        if self.save is not None and self.save.suffix.lower() != ".blend":
            raise SettingsError(f"--save {self.save} does not end in .blend: give the name of a .blend")
        path = self.report_path
        if path is None:
            return
        if path.suffix.lower() in OTHERS:
            raise SettingsError(f"--report {path} has the name of an image, a page or a scene: let it end in .json")
        if os.path.isfile(path) and not is_report(path):
            raise SettingsError(f"{path} is no report, and only reports are overwritten by one: give the report "
                                "another name (--report), or choose another output folder")


def folder_beside(blend: str, folder: str = "", *, advice: str) -> Path:
    """The output folder: absolute, or relative to the .blend's folder when it starts with `//` or is empty.

    Raises
    ------
    SettingsError
        If it depends on the .blend's folder and the .blend was never saved.
    """
    if folder and not folder.startswith("//"):
        return Path(folder).expanduser().absolute()
    if not blend:
        raise SettingsError(f"the .blend is not saved, so there is no folder for the lightmaps: {advice}")
    return Path(blend).absolute().parent / (folder.removeprefix("//") or DEFAULT_FOLDER)


def not_own(save: Path | None, blend: str) -> Path | None:
    """The path to save at, which must not be the open .blend's.

    Raises
    ------
    SettingsError
        If it is: the scene's own file is never changed.
    """
    if save is not None and blend and save.resolve() == Path(blend).resolve():
        raise SettingsError(f"--save {save} is the scene's own file, which a bake never changes: give another name")
    return save


def remove_empty(folders: Iterable[Path]) -> None:
    """Take folders away again that nothing was written to, the last made first."""
    for folder in reversed(list(folders)):
        with contextlib.suppress(OSError):
            folder.rmdir()


def _check_name(path: Path) -> None:
    """Ask for the file, and for what stands in for it while it is written: a name may be too long for the system."""
    try:
        for name in (path, part_of(path)):
            with contextlib.suppress(FileNotFoundError):
                name.stat()
    except OSError as cause:
        raise OutputError(f"{path} can't be written ({reason(cause)}): choose another name") from cause


def _check_folder(folder: Path) -> None:
    """Make the folder and try to write in it: rights alone don't tell on network drives or as root."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as cause:
        raise OutputError(f"folder {folder} can't be written to ({reason(cause)}): "
                          "change its rights or choose another folder") from cause
