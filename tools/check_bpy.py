"""Name the system libraries that the bpy module misses on this machine, and the packages that bring them.

Run it with the Python of the environment that holds bpy. It exits with 1 where something is missing.
"""

from __future__ import annotations

import argparse
import importlib.util
import re
import shutil
import subprocess
import sys

DEBIAN = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libGLX.so.0": "libglx0",
    "libGLdispatch.so.0": "libglvnd0",
    "libICE.so.6": "libice6",
    "libOpenGL.so.0": "libopengl0",
    "libSM.so.6": "libsm6",
    "libX11-xcb.so.1": "libx11-xcb1",
    "libX11.so.6": "libx11-6",
    "libXau.so.6": "libxau6",
    "libXcursor.so.1": "libxcursor1",
    "libXdmcp.so.6": "libxdmcp6",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXi.so.6": "libxi6",
    "libXinerama.so.1": "libxinerama1",
    "libXrandr.so.2": "libxrandr2",
    "libXrender.so.1": "libxrender1",
    "libXt.so.6": "libxt6",
    "libXxf86vm.so.1": "libxxf86vm1",
    "libdbus-1.so.3": "libdbus-1-3",
    "libdrm.so.2": "libdrm2",
    "libgcc_s.so.1": "libgcc-s1",
    "libgomp.so.1": "libgomp1",
    "libstdc++.so.6": "libstdc++6",
    "libuuid.so.1": "libuuid1",
    "libwayland-client.so.0": "libwayland-client0",
    "libxcb.so.1": "libxcb1",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libz.so.1": "zlib1g",
}

FEDORA = {
    "libEGL.so.1": "libglvnd-egl",
    "libGL.so.1": "libglvnd-glx",
    "libGLX.so.0": "libglvnd-glx",
    "libGLdispatch.so.0": "libglvnd",
    "libICE.so.6": "libICE",
    "libOpenGL.so.0": "libglvnd-opengl",
    "libSM.so.6": "libSM",
    "libX11-xcb.so.1": "libX11-xcb",
    "libX11.so.6": "libX11",
    "libXau.so.6": "libXau",
    "libXcursor.so.1": "libXcursor",
    "libXdmcp.so.6": "libXdmcp",
    "libXext.so.6": "libXext",
    "libXfixes.so.3": "libXfixes",
    "libXi.so.6": "libXi",
    "libXinerama.so.1": "libXinerama",
    "libXrandr.so.2": "libXrandr",
    "libXrender.so.1": "libXrender",
    "libXt.so.6": "libXt",
    "libXxf86vm.so.1": "libXxf86vm",
    "libdbus-1.so.3": "dbus-libs",
    "libdrm.so.2": "libdrm",
    "libgcc_s.so.1": "libgcc",
    "libgomp.so.1": "libgomp",
    "libstdc++.so.6": "libstdc++",
    "libuuid.so.1": "libuuid",
    "libwayland-client.so.0": "libwayland-client",
    "libxcb.so.1": "libxcb",
    "libxkbcommon.so.0": "libxkbcommon",
    "libz.so.1": "zlib-ng-compat",
}


def missing_libraries(module: str) -> list[str]:
    """List the shared libraries that the loader does not find for a compiled module.

    Parameters
    ----------
    module : str
        Path of the module's shared object.

    Returns
    -------
    list of str
        Library names such as ``libX11.so.6``, sorted.
    """
    if shutil.which("ldd"):
        # ldd names every missing library at once, an import only the first.
        text = subprocess.run(["ldd", module], capture_output=True, text=True, check=False).stdout
        found = re.findall(r"^\s*(\S+) => not found", text, re.MULTILINE)
    else:
        text = subprocess.run(
            [sys.executable, "-c", "import bpy"], capture_output=True, text=True, check=False
        ).stderr
        found = re.findall(r"(lib[^\s:]+\.so[.\d]*): cannot open shared object file", text)
    return sorted(set(found))


def packages_for(libraries: list[str], names: dict[str, str]) -> list[str]:
    """Map libraries to packages of one distribution, leaving out those it has no name for."""
    return sorted({names[library] for library in libraries if library in names})


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--packages", action="store_true", help="print only the names of the missing Debian packages"
    )
    arguments = parser.parse_args()

    spec = importlib.util.find_spec("bpy")
    if spec is None or spec.origin is None:
        print(f"bpy is not installed for {sys.executable}.", file=sys.stderr)
        return 1
    missing = missing_libraries(spec.origin) if sys.platform == "linux" else []
    if arguments.packages:
        print(" ".join(packages_for(missing, DEBIAN)))
        return 0
    if not missing:
        return 0
    print(
        f"bpy needs {', '.join(missing)}; on Debian or Ubuntu:"
        f" apt-get install -y {' '.join(packages_for(missing, DEBIAN))}"
        f" (Fedora: dnf install {' '.join(packages_for(missing, FEDORA))})",
        file=sys.stderr,
    )
    unknown = [library for library in missing if library not in DEBIAN]
    if unknown:
        print(f"No package is known here for {', '.join(unknown)}.", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
