#!/usr/bin/env python3
"""Extracts the TWK CRN's objects from the reference into the table that the dictionary test expects.

usage: extract_twk_crn_dictionary.py REFERENCE > twk_crn_dictionary.csv

Reads the table of the reference's section 11. Shares nothing with the twin's own table. Columns of
the result: index, subindex, bytes, signed, access, mappable into a T_PDO, defaults with 4096 and
with 8192 steps per turn, each in hexadecimal, as a text in quotes, "id+" and a number to which the
node id is added, or "?" where the reference has none.
"""
import re
import sys

TYPES = {"U8": (1, 0), "U16": (2, 0), "U32": (4, 0), "I32": (4, 1)}
SIGNATURES = {"1010": "65766173", "1011": "64616F6C"}


def default_of(index, cell):
    """The default in the result's form, for both discs."""
    cell = re.sub(r"\*\*.*?\*\*", "", cell).strip()
    if cell == "signature":
        return [SIGNATURES[index]] * 2
    text = re.search(r'"(.*)"', cell)
    if text:
        return [f'"{text[1]}"'] * 2
    plus = re.fullmatch(r"([0-9A-F]+)h \+ id", cell)
    if plus:
        return [f"id+{plus[1]}"] * 2
    both = re.fullmatch(r"0x(\w+) or 0x(\w+)", cell)
    if both:
        return [both[1], both[2]]
    if cell in ("none", "varies"):
        return ["?", "?"]
    number = cell.split()[0]
    value = int(number, 0)
    # 100Bh: the node id itself.
    return ["id+0"] * 2 if index == "100B" else [f"{value:X}"] * 2


def rows(cells):
    """One line of the reference's table; it may be several rows of the dictionary."""
    index = cells[0].rstrip("h")
    subs = [sub.strip() for sub in cells[1].split(",")]
    kinds = [kind.split()[0] for kind in cells[3].split(",")]
    accesses = [access.strip() for access in cells[4].split(",")]
    defaults = [cells[5]] if cells[2] in ("Device name",) else cells[5].split(",")
    for place, sub in enumerate(subs):
        def of(column):
            return column[min(place, len(column) - 1)].strip()

        kind, cell = of(kinds), of(defaults)
        first, second = default_of(index, cell)
        if kind == "string":
            size, signed = len(first) - 2, 0
        else:
            size, signed = TYPES[kind]
        mappable = int("yes" in cells[7])
        yield [index, sub, str(size), str(signed), of(accesses), str(mappable), first, second]


def main():
    inside = False
    print("# index,sub,bytes,signed,access,t_pdo,default with 4096 steps,default with 8192 steps")
    with open(sys.argv[1], encoding="utf-8") as reference:
        for line in reference:
            if line.startswith("## "):
                inside = line.startswith("## 11.")
            cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
            if inside and re.fullmatch(r"[0-9A-F]{4}h", cells[0]):
                for row in rows(cells):
                    print(",".join(row))


main()
