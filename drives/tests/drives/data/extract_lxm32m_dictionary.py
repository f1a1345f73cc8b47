#!/usr/bin/env python3
"""Extracts the LXM32M's objects from the reference into the table that the dictionary test expects.

usage: extract_lxm32m_dictionary.py REFERENCE > lxm32m_dictionary.csv

Reads the reference's sections 12 (1xxxh), 13 (6xxxh) and 14 (3xxxh), whose tables have different
columns. Shares nothing with the twin's own table. Columns of the result: index, subindex, bytes,
access, how it is known (printed; inferred from the name; disputed: overview and detail differ),
whether mappable into R_PDO and T_PDO.
"""
import sys

BYTES = {"U8": 1, "U16": 2, "U32": 4, "VisString8": 8,
         "UINT8": 1, "UINT16": 2, "UINT32": 4, "INT8": 1, "INT16": 2, "INT32": 4}


def access_of(cell):
    """RO or RW, and how it is known."""
    cell = cell.split(" (")[0]
    if cell.startswith("~"):
        return cell[1:], "inferred"
    if "/" in cell:
        overview, detail = (word.strip() for word in cell.split("/"))
        return (detail if detail in ("RO", "RW") else overview), "disputed"
    return cell, "printed"


def main():
    section = 0
    print("# index,sub,bytes,access,known,r_pdo,t_pdo")
    with open(sys.argv[1], encoding="utf-8") as reference:
        for line in reference:
            if line.startswith("## "):
                section = int(line[3:].split(".")[0])
            cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
            address = cells[0].split(":")
            if section not in (12, 13, 14) or len(address) != 2 or len(address[0]) != 4:
                continue
            if section == 12:
                kind, access, mark = cells[3], cells[4], "-"
            else:
                kind, mark, access = cells[2], cells[3], cells[4]
            if kind == "?":
                continue  # named in the text, absent from the manual's dictionary
            access, known = access_of(access)
            print(",".join([address[0], address[1], str(BYTES[kind.split()[0]]), access, known,
                            str(int(mark == "R")), str(int(mark == "T"))]))


main()
