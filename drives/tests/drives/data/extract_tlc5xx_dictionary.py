#!/usr/bin/env python3
"""Extracts the TLC5xx's objects from the reference into the table that the dictionary test expects.

usage: extract_tlc5xx_dictionary.py REFERENCE > tlc5xx_dictionary.csv

Reads the tables of the reference's section 14. Shares nothing with the twin's own table. Columns of
the result: index, subindex, bytes, access, into which PDOs it may be mapped (R, T or -), least and
greatest value, default. A "-" stands for what is not printed or not readable; "id+" precedes a number
to which the node id is added; a default in quotes is a text.
"""
import re
import sys

BYTES = {"U8": 1, "U16": 2, "U32": 4, "I8": 1, "I16": 2, "I32": 4, "VS8": 8, "VS16": 16}


def clean(cell):
    """A cell without the reference's marks and doubts."""
    return re.sub(r"\[[^]]*\]", "", cell).strip().strip("()")


def limits(cell):
    found = re.fullmatch(r"(-?\d+)\.\.\s*(-?\d+)", clean(cell))
    return found.groups() if found else ("-", "-")


def default(cell):
    cell = clean(cell)
    if cell.endswith("+node"):
        return f"id+{int(cell[:-5], 16)}"
    if re.fullmatch(r"-?\d+", cell):
        return cell
    if cell.startswith("0x"):
        return str(int(cell, 16))
    return cell if cell.startswith('"') else "-"


def main():
    inside = False
    print("# index,sub,bytes,access,pdo,least,greatest,default")
    with open(sys.argv[1], encoding="utf-8") as reference:
        for line in reference:
            heading = re.match(r"##+ (\d+)(?:\.(\d+))?", line)
            if heading:
                inside = heading[1] == "14" and heading[2] is not None and 2 <= int(heading[2]) <= 9
            cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
            if not inside or not re.fullmatch(r"[0-9A-F]{4}h", cells[0]):
                continue
            index, sub, _, kind, access, pdo, span, value = cells[:8]
            print(",".join([index[:4], sub, str(BYTES[kind.rstrip("?")]), access.strip("(?)"), pdo,
                            *limits(span), default(value)]))


main()
