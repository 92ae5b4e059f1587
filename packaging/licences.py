#!/usr/bin/env python3
"""Prints the licences of all that is built into bokehcam: the crates of the default features, and the fonts; with an
argument, `python` or `gst`, of all that is built into what is made there. Each text stands once, below those that it is for.
Needs cargo, which fetches what a build has left out: metadata takes crates of tests, too."""

import json
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
FOLDER = ROOT.joinpath(*sys.argv[1:2])
TEXTS = ("license", "licence", "copying", "notice", "unlicense")


def built_in():
    """Packages that the program is linked with, by name."""
    version = subprocess.run(["cargo", "-vV"], check=True, capture_output=True, text=True).stdout
    host = next(line.split()[1] for line in version.splitlines() if line.startswith("host:"))
    command = ["cargo", "metadata", "--format-version=1", "--locked", "--filter-platform", host]
    metadata = json.loads(subprocess.run(command, check=True, capture_output=True, text=True, cwd=FOLDER).stdout)
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    found, waiting = set(), [metadata["resolve"]["root"]]
    while waiting:
        for dependency in nodes[waiting.pop()]["deps"]:
            normal = any(kind["kind"] is None for kind in dependency["dep_kinds"])
            if normal and dependency["pkg"] not in found:
                found.add(dependency["pkg"])
                waiting.append(dependency["pkg"])
    packages = [package for package in metadata["packages"] if package["id"] in found]
    return sorted(packages, key=lambda package: (package["name"], package["version"]))


def texts(folder):
    """The licence files of a folder, as their texts."""
    files = sorted(file for file in folder.iterdir() if file.is_file() and file.name.lower().startswith(TEXTS))
    return [file.read_text(encoding="utf-8", errors="replace").strip() for file in files]


def main():
    by_text, without = {}, []
    print("bokehcam contains these, under the licences that are named; their texts follow.\n")
    for package in built_in():
        name = f"{package['name']} {package['version']}"
        print(f"{name}: {package['license']}" + (f", {package['repository']}" if package["repository"] else ""))
        found = texts(pathlib.Path(package["manifest_path"]).parent)
        if not found:
            without.append(f"{name}: {package['license']}, by {', '.join(package['authors']) or 'its authors'}")
        for text in found:
            by_text.setdefault(text, []).append(name)
    if FOLDER == ROOT:
        print("Roboto Regular and Medium: Apache-2.0")
        for text in texts(ROOT / "src/preview/fonts"):
            by_text.setdefault(text, []).append("Roboto")
    if without:
        print("\nThese bring no text of their own:\n" + "\n".join(without))
    for text, names in by_text.items():
        print("\n" + "-" * 100 + "\n" + ", ".join(names) + "\n\n" + text)


main()
