#!/usr/bin/env python3
"""Extracts the TSP10-CBE's objects from the reference into the table that the dictionary test expects.

usage: extract_tsp10_dictionary.py REFERENCE > tsp10_dictionary.csv

Reads the table of the reference's section 7. Shares nothing with the twin's own table. Columns of the
result: index, subindex, bytes, access, whether it may be mapped, least and greatest value, default.
"-" is what is not printed, "id+" precedes a number to which the node id is added, a default in quotes
is a text.
"""
import re
import sys

BYTES = {"U8": 1, "U16": 2, "U32": 4, "I8": 1, "I16": 2, "I32": 4, "string": 3}
NAMED = {"bits 0, 1": ("0", "3"), "0..14, also negative": ("-14", "14")}


def span(cell):
    found = re.fullmatch(r"(\d+)\.\.(\d+)", cell)
    if found:
        return found.groups()
    if cell.startswith("from "):
        return cell[5:], str(2**32 - 1)
    return NAMED.get(cell, ("-", "-"))


def default(cell):
    text = re.search(r'"(.*)"', cell)
    if text:
        return f'"{text[1]}"'
    plus = re.fullmatch(r"(?:0x([0-9A-F]+)|([0-9A-F]+)h) \+ id", cell)
    if plus:
        return f"id+{int(plus[1] or plus[2], 16)}"
    if re.fullmatch(r"0x[0-9A-F]+|\d+", cell):
        return str(int(cell, 0))
    return "1" if cell == "= sub 1" else "-"


def main():
    inside = False
    print("# index,sub,bytes,access,mappable,least,greatest,default")
    with open(sys.argv[1], encoding="utf-8") as reference:
        for line in reference:
            if line.startswith("## "):
                inside = line.startswith("## 7.")
            cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
            if not inside or not re.fullmatch(r"[0-9A-F]{4}h", cells[0]):
                continue
            subs = cells[1].split(", ")
            if ".." in cells[1]:
                first, last = cells[1].split("..")
                subs = [str(sub) for sub in range(int(first), int(last) + 1)]
            defaults = cells[6].split(", ") if len(subs) == 2 else [cells[6]] * len(subs)
            for place, sub in enumerate(subs):
                kind, access = cells[3].split()[0], cells[4].replace("*", "").split()[0]
                print(",".join([cells[0][:4], sub, str(BYTES[kind]), access,
                                str(int("yes" in cells[8])), *span(cells[5]),
                                default(defaults[place])]))


main()
