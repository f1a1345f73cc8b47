#!/usr/bin/env python3
"""Writes THIRD-PARTY.txt: what the `syncline` program contains of others' work, with the notices that
its licences ask for. With --check it only says whether the file is up to date. With --of-the-wheel it writes
python/THIRD-PARTY.txt, which the Python package takes with it and which is made whenever that is built.

A licence's text stands once, with every library that has the very same one: most differ in their
copyright lines, which have to be kept.
"""

import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).parent.parent
# Folder, package, and what it is called.
PROGRAM = (ROOT, "syncline-controller", "program")
WHEEL = (ROOT / "python", "syncline-python", "Python package")
TARGET = "x86_64-unknown-linux-gnu"
# Of several licences to choose from, the first of these is taken.
CHOICE = ["MIT", "Apache-2.0", "BSD-3-Clause", "BSD-2-Clause", "Zlib", "ISC", "Unicode-3.0"]
NOTICES = re.compile(r"^(licen[cs]e|copying|copyright|notice|unlicense)", re.IGNORECASE)


def contained(folder, own):
    """The packages that are linked into one of ours, by name."""
    locked = ["--locked"] if folder == ROOT else []
    command = ["cargo", "metadata", "--format-version", "1", *locked, "--filter-platform", TARGET]
    metadata = json.loads(subprocess.check_output(command, cwd=folder))
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    waiting = [i for i, package in packages.items() if package["name"] == own]
    found = set()
    while waiting:
        here = waiting.pop()
        if here in found:
            continue
        found.add(here)
        for dependency in nodes[here]["deps"]:
            if any(kind["kind"] is None for kind in dependency["dep_kinds"]):
                waiting.append(dependency["pkg"])
    others = [packages[i] for i in found if packages[i]["source"]]
    return sorted(others, key=lambda package: (package["name"], package["version"]))


def notices(package):
    """The texts of the licence that is taken, as far as the package brings any."""
    folder = pathlib.Path(package["manifest_path"]).parent
    files = sorted(path for path in folder.iterdir() if path.is_file() and NOTICES.match(path.name))
    offered = re.split(r"\s+(?:OR|AND)\s+|[/()]", package["license"] or "")
    needs_all = " AND " in (package["license"] or "")
    taken = next((licence for licence in CHOICE if licence in offered), None)
    word = (taken or "").split("-")[0].lower()
    fitting = [path for path in files if word and word in path.name.lower()]
    general = [path for path in files if "-" not in path.stem and "_" not in path.stem]
    chosen = files if needs_all or not taken else fitting or general or files
    chosen = sorted(set(chosen) | {path for path in files if path.name.lower().startswith("notice")})
    return [path.read_text(errors="replace").replace("\r\n", "\n").strip() for path in chosen]


def document(folder, own, kind):
    packages = contained(folder, own)
    by_text = {}
    lines = [
        f"The {kind} `syncline` contains the work of others, named here with their licences and the",
        "notices that these ask for. Written by tests/notices.py.",
        "",
    ]
    for package in packages:
        title = f"{package['name']} {package['version']}"
        licence = package["license"] or "see its text"
        lines.append(f"{title}: {licence}")
        texts = notices(package)
        if not texts:
            authors = ", ".join(package["authors"]) or "its authors"
            lines.append(f"  brings no text; copyright {authors}")
        for text in texts:
            by_text.setdefault(text, []).append(title)
    for text, titles in by_text.items():
        lines += ["", "=" * 80, ", ".join(titles), "-" * 80, text]
    return "\n".join(line.rstrip() for line in "\n".join(lines).split("\n")) + "\n"


def main():
    of = WHEEL if "--of-the-wheel" in sys.argv[1:] else PROGRAM
    file, text = of[0] / "THIRD-PARTY.txt", document(*of)
    if "--check" not in sys.argv[1:]:
        file.write_text(text)
    elif not file.exists() or file.read_text() != text:
        sys.exit("THIRD-PARTY.txt is not up to date: run tests/notices.py")


if __name__ == "__main__":
    main()
