#!/usr/bin/env python3
"""Prints the licences of all crates and fonts built into the packaged bokehcam, or with the argument `python` or `gst` into
the Python package or the GStreamer plugin. Each text is printed once, below the names of its crates.
Needs cargo, which fetches crates that the build did not need: the metadata includes those of tests."""

import json
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
MADE = (sys.argv[1:] or ["program"])[0]
# Arguments for cargo, by product.
PACKAGES = {
    "program": ["bokehcam-cli", "--no-default-features", "--features=packaged"],
    "python": ["bokehcam-python"],
    "gst": ["gst-plugin-bokehcam"],
}
TEXTS = ("license", "licence", "copying", "notice", "unlicense")


def built_in():
    """Returns the linked third-party packages, by name."""
    def cargo(*arguments):
        return subprocess.run(["cargo", *arguments], check=True, capture_output=True, text=True, cwd=ROOT).stdout

    tree = cargo("tree", "--locked", "--edges=normal,no-proc-macro", "--prefix=none", "--format={p}", "--package", *PACKAGES[MADE])
    linked = {tuple(line.split()[:2]) for line in tree.splitlines() if line}
    metadata = json.loads(cargo("metadata", "--format-version=1", "--locked"))
    packages = [package for package in metadata["packages"] if package["source"] and (package["name"], "v" + package["version"]) in linked]
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
    if MADE == "program":
        print("Roboto Regular and Medium: Apache-2.0")
        for text in texts(ROOT / "crates/window/src/fonts"):
            by_text.setdefault(text, []).append("Roboto")
    if without:
        print("\nThese bring no text of their own:\n" + "\n".join(without))
    for text, names in by_text.items():
        print("\n" + "-" * 100 + "\n" + ", ".join(names) + "\n\n" + text)


main()
