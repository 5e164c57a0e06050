"""Intel Open Image Denoise through its C interface: the only file here that calls it.

Two libraries may be at hand: that of the package pyoidn, which has the filter for lightmaps (RTLightmap), and Blender's
own in the bpy wheel, which has the filter for rendered images alone (RT). Both are version 2.
Reference: Áfra, Intel Open Image Denoise, https://www.openimagedenoise.org (API documentation, version 2).
"""

from __future__ import annotations

import ctypes
import importlib.util
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import environment
from .environment import PeerError

Float = NDArray[np.floating[Any]]

# From the library's header: device type and image format.
DEVICE_CPU, FORMAT_FLOAT3 = 1, 3
LIGHTMAP, IMAGE = "RTLightmap", "RT"


@dataclass(frozen=True)
class Denoiser:
    """A library and the filter of it that is used."""

    library: Path
    filter: str


def blenders() -> Denoiser | None:
    """Blender's own library, filter RT; None where the bpy wheel has none."""
    found = importlib.util.find_spec("bpy")
    folders = list(found.submodule_search_locations or ()) if found else []
    libraries = [path for folder in folders for path in sorted(Path(folder).glob("lib/*OpenImageDenoise.*"))]
    return Denoiser(libraries[0], IMAGE) if libraries else None


def lightmap() -> Denoiser | None:
    """The library of the package pyoidn, filter RTLightmap; None where it is not installed."""
    libraries = [path for path in sorted(environment.packages().glob("*oidn*/**/*OpenImageDenoise.*"))
                 if path.suffix != ".py"]
    return Denoiser(libraries[0], LIGHTMAP) if libraries else None


class _Functions:
    """The library's functions with their types."""

    def __init__(self, path: Path) -> None:
        try:
            library = ctypes.CDLL(str(path))
        except OSError as problem:
            raise PeerError(f"Open Image Denoise at {path} can't be loaded: {problem}") from problem
        pointer, text, size = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t
        signatures: dict[str, tuple[Any, ...]] = {
            "NewDevice": (pointer, ctypes.c_int),
            "CommitDevice": (None, pointer),
            "ReleaseDevice": (None, pointer),
            "NewFilter": (pointer, pointer, text),
            "SetSharedFilterImage": (None, pointer, text, pointer, ctypes.c_int, size, size, size, size, size),
            "SetFilterBool": (None, pointer, text, ctypes.c_bool),
            "CommitFilter": (None, pointer),
            "ExecuteFilter": (None, pointer),
            "ReleaseFilter": (None, pointer),
            "GetDeviceError": (ctypes.c_int, pointer, ctypes.POINTER(text)),
        }
        for name, (result, *arguments) in signatures.items():
            function = getattr(library, f"oidn{name}")
            function.restype, function.argtypes = result, arguments
            setattr(self, name, function)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)


def denoise(denoiser: Denoiser, images: list[Float]) -> list[Float]:
    """High-dynamic-range images without their noise.

    Parameters
    ----------
    images : (rows, columns, 3) each, linear radiance; every pixel must hold a value (see `filled`).

    Returns
    -------
    New arrays of the same shapes, float32.

    Raises
    ------
    PeerError
        With what the library said.
    """
    call = _Functions(denoiser.library)
    device = call.NewDevice(DEVICE_CPU)
    try:
        call.CommitDevice(device)
        _check(call, device)
        return [_denoised(call, device, denoiser.filter, np.ascontiguousarray(image, np.float32)) for image in images]
    finally:
        call.ReleaseDevice(device)


def _denoised(call: _Functions, device: Any, kind: str, image: Float) -> Float:
    result = np.empty_like(image)
    rows, columns = image.shape[:2]
    made = call.NewFilter(device, kind.encode())
    try:
        _check(call, device)
        for name, array in ((b"color", image), (b"output", result)):
            call.SetSharedFilterImage(made, name, array.ctypes.data, FORMAT_FLOAT3, columns, rows, 0, 0, 0)
        if kind == IMAGE:
            # The filter for lightmaps takes no other range than this.
            call.SetFilterBool(made, b"hdr", True)
        call.CommitFilter(made)
        call.ExecuteFilter(made)
        _check(call, device)
    finally:
        if made:
            call.ReleaseFilter(made)
    return result


def _check(call: _Functions, device: Any) -> None:
    message = ctypes.c_char_p()
    if call.GetDeviceError(device, ctypes.byref(message)):
        raise PeerError(f"Open Image Denoise said: {(message.value or b'nothing').decode()}")


def filled(image: Float, covered: NDArray[np.bool_]) -> Float:
    """An image whose pixels that no chart covers have the value of the nearest that one does: no dark rim to smear.

    Parameters
    ----------
    image : (rows, columns, 3);  covered : (rows, columns).
    """
    from scipy.ndimage import distance_transform_edt

    if not covered.any():
        return image
    nearest = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    return np.asarray(image[tuple(nearest)])
