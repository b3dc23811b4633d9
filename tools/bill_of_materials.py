"""Write down what a release zip is made of, as CycloneDX 1.6 (https://cyclonedx.org/docs/1.6/json/).

One file for each zip: the extension, the wheels in the zip with their hashes and licences, and, since they
have to be there, Blender and its numpy.
"""

from __future__ import annotations

import datetime as dt
import uuid
from pathlib import Path
from typing import Any
from urllib.parse import quote

import fetch_wheels
import third_party

# Any fixed one: the same zip always has the same serial number.
_NAMESPACE = uuid.UUID("6f1b8a52-6f0c-5a43-9d0e-6d8c54a5b1d7")


def bill_of_materials(
    zip_path: Path, manifest: dict[str, Any], wheels: list[third_party.Wheel], numpy: str, moment: int
) -> dict[str, Any]:
    """Say what a zip is made of.

    Parameters
    ----------
    zip_path : Path
        The zip.
    manifest : dict
        Its manifest.
    wheels : list of Wheel
        The wheels in it.
    numpy : str
        Version of the numpy that the Blender which the zip is for has at least.
    moment : int
        When it was made, in seconds since 1970.

    Returns
    -------
    dict
        The bill, ready for JSON.
    """
    digest = fetch_wheels.hash_of(zip_path)
    name, version = manifest["id"], manifest["version"]
    (license_,) = (each.removeprefix("SPDX:") for each in manifest["license"])
    root = _component(
        "application",
        name,
        version,
        license_,
        f"pkg:generic/{name}@{version}?file_name={quote(zip_path.name)}",
    )
    root |= {"description": manifest["tagline"], "hashes": [_sha256(digest)]}
    blender = {
        "type": "application",
        "bom-ref": "blender",
        "name": "Blender",
        "description": "Not in the zip: the extension runs inside it.",
        "scope": "required",
        "licenses": [{"expression": "GPL-3.0-or-later"}],
        "properties": [
            {
                "name": "potmesil:versions",
                "value": f"{manifest['blender_version_min']} to before {manifest['blender_version_max']}",
            }
        ],
    }
    host = _component("library", "numpy", numpy, "BSD-3-Clause", f"pkg:pypi/numpy@{numpy}")
    host |= {"description": "Not in the zip: Blender's own, of this version or later."}
    components = [blender, host]
    refs = {"numpy": host["bom-ref"]}
    for wheel in wheels:
        purl = f"pkg:pypi/{wheel.name.lower()}@{wheel.version}?file_name={quote(wheel.path.name)}"
        component = _component("library", wheel.name, wheel.version, wheel.license, purl)
        component["hashes"] = [_sha256(fetch_wheels.hash_of(wheel.path))]
        if wheel.parts:
            component["components"] = [
                {
                    "type": "library",
                    "bom-ref": f"{purl}#{quote(part.name)}",
                    "name": part.name,
                    "licenses": [{"expression": part.license}],
                }
                for part in wheel.parts
            ]
        refs[wheel.name.lower()] = component["bom-ref"]
        components.append(component)
    needs = [{"ref": root["bom-ref"], "dependsOn": sorted(["blender", *refs.values()])}]
    needs += [
        {
            "ref": refs[wheel.name.lower()],
            "dependsOn": sorted(refs[each] for each in wheel.requires if each in refs),
        }
        for wheel in wheels
    ]
    needs += [{"ref": "blender", "dependsOn": [host["bom-ref"]]}]
    when = dt.datetime.fromtimestamp(moment, dt.UTC)
    return {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.uuid5(_NAMESPACE, digest)}",
        "version": 1,
        "metadata": {"timestamp": when.isoformat().replace("+00:00", "Z"), "component": root},
        "components": components,
        "dependencies": needs,
    }


def _component(kind: str, name: str, version: str, license_: str, purl: str) -> dict[str, Any]:
    return {
        "type": kind,
        "bom-ref": purl,
        "name": name,
        "version": version,
        "scope": "required",
        "licenses": [{"expression": license_}],
        "purl": purl,
    }


def _sha256(digest: str) -> dict[str, str]:
    return {"alg": "SHA-256", "content": digest}
