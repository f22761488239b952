"""Variables of the environment that replace or restrict the OpenGL driver.

Mesa reads them, or libglvnd, which finds drivers for EGL. With a wrong value an installed driver
fails as if it were missing.
"""

import os
import re

from fastgen.errors import ContextError, shown

_NAMES = (
    *("MESA_GL_VERSION_OVERRIDE", "MESA_GLSL_VERSION_OVERRIDE", "MESA_EXTENSION_OVERRIDE"),
    *("MESA_LOADER_DRIVER_OVERRIDE", "GALLIUM_DRIVER", "LIBGL_ALWAYS_SOFTWARE"),
    *("LIBGL_DRIVERS_PATH", "LIBGL_DRIVERS_DIR", "GBM_BACKEND", "GBM_BACKENDS_PATH"),
    *("EGL_PLATFORM", "EGL_DRIVER", "EGL_DRIVERS_PATH"),
    *("__EGL_VENDOR_LIBRARY_FILENAMES", "__EGL_VENDOR_LIBRARY_DIRS"),
    *("__EGL_EXTERNAL_PLATFORM_CONFIG_FILENAMES", "__EGL_EXTERNAL_PLATFORM_CONFIG_DIRS"),
    *("VK_DRIVER_FILES", "VK_ICD_FILENAMES"),
)

_SOFTWARE_DRIVERS = ("llvmpipe", "softpipe", "swr")
"""Values of GALLIUM_DRIVER that OSMesa knows; any other ends the process."""

_LEAST_GLSL = 440


def advice(otherwise: str) -> str:
    """Return what to do about a driver that fails: unset variables, or `otherwise` without any."""
    found = [f"{name}={shown(os.environ[name])}" for name in _NAMES if os.environ.get(name)]
    if not found:
        return otherwise
    change, them = ("change", "them") if len(found) > 1 else ("changes", "it")
    return f"{', '.join(found)} in the environment {change} the driver; unset {them}"


def check_osmesa() -> None:
    """Raise ContextError if a variable has a value that would end the process in OSMesa."""
    driver = os.environ.get("GALLIUM_DRIVER") or _SOFTWARE_DRIVERS[0]
    version = os.environ.get("MESA_GLSL_VERSION_OVERRIDE") or str(_LEAST_GLSL)
    number = re.match("[0-9]{1,9}", version)
    if driver not in _SOFTWARE_DRIVERS or not number or int(number[0]) < _LEAST_GLSL:
        raise ContextError(f"osmesa: would end this process; {advice('')}")
