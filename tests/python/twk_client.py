"""python-canopen as the master of an absolute encoder TWK CRN.

usage: twk_client.py EDS NODE INTERFACE KEY=VALUE...

EDS is the encoder's data sheet; INTERFACE and the rest open the bus with python-can. The encoder has
just been switched on and stands still at its zero. Ends with code 0 and a line "ok" for each step, or
with an AssertionError. Every wait is bounded.
"""

import struct

from master import (
    aborted, answers, ok, protocol_aborts, received, silence_aborts, take_through, until,
)

SAVE, LOAD = 0x65766173, 0x64616F6C


def bring_up(node):
    # It says nothing when it has booted.
    until("an answer", lambda: answers(node), 5)
    assert node.sdo[0x1000].raw == 0x00020196
    assert node.sdo[0x1008].raw == "Encoder CRN"
    assert (node.sdo[0x6501].raw, node.sdo[0x6502].raw) == (8192, 4096)
    assert node.sdo[0x6503].raw == 0
    ok("expedited and segmented upload")


def position(node):
    node.sdo[0x6000].raw = 4
    node.sdo[0x6001].raw = 1000
    node.sdo[0x6002].raw = 16_000
    node.sdo[0x6003].raw = 1234
    assert node.sdo[0x6004].raw == 1234
    node.sdo[0x6000].raw = 5
    assert node.sdo[0x6003].raw == 0, "the code sequence deletes the preset"
    assert node.sdo[0x6004].raw == 15_999, "mirrored"
    node.sdo[0x6003].raw = 1234
    ok("code sequence, scaling, preset")


def process_data(node):
    node.tpdo.read()
    change, synchronous = node.tpdo[1], node.tpdo[3]
    assert [v.index for v in change.map] == [v.index for v in synchronous.map] == [0x6004]
    assert (change.trans_type, synchronous.trans_type) == (254, 1)
    with received(change, "no T_PDO on entering Operational"):
        node.nmt.state = "OPERATIONAL"
    for _ in range(3):
        with received(synchronous, "no T_PDO after SYNC"):
            node.network.sync.transmit()
        assert synchronous[0x6004].raw == 1234
    node.sdo[0x6200].raw = 20
    for _ in range(3):
        assert change.wait_for_reception(1), "no T_PDO by the clock"
    node.sdo[0x6200].raw = 0
    node.nmt.state = "PRE-OPERATIONAL"
    ok("position by SYNC and by the clock")


def aborts(node):
    """All that the server has but those of a broken encoder: 0606 0000h, 0800 0022h."""
    sdo = node.sdo
    aborted(0x05040001, lambda: block_upload(sdo))
    protocol_aborts(node, 0x6001)
    silence_aborts(node, 0x6001)
    aborted(0x06010002, lambda: sdo.download(0x6004, 0, bytes(4)))
    aborted(0x06020000, lambda: sdo.upload(0x1018, 1))
    aborted(0x06070012, lambda: sdo.download(0x6000, 0, bytes(4)))
    aborted(0x06070013, lambda: sdo.download(0x6000, 0, bytes(1)))
    aborted(0x06090011, lambda: sdo.upload(0x6004, 1))
    for index, sub, data in [
        (0x6000, 0, struct.pack("<H", 2)),
        (0x6001, 0, bytes(4)),
        (0x6003, 0, struct.pack("<I", 16_000)),
        (0x1800, 2, b"\xff"),
        (0x2000, 0, b"\x41"),
        (0x2001, 0, b"\x04"),
    ]:
        aborted(0x06090030, lambda: sdo.download(index, sub, data))
    aborted(0x08000020, lambda: sdo.download(0x1010, 1, bytes(4)))
    ok("abort codes")


def block_upload(sdo):
    with sdo.open(0x1008, 0, "rb", block_transfer=True) as text:
        text.read()


def storage(node):
    node.sdo[0x6401][1].raw = 11
    node.sdo[0x100C].raw = 100
    node.sdo[0x1010][1].raw = SAVE
    node.nmt.send_command(0x81)
    until("an answer", lambda: answers(node), 5)
    assert node.sdo[0x6401][1].raw == 11, "stored"
    assert node.sdo[0x6004].raw == 1234, "the preset as well"
    assert node.sdo[0x100C].raw == 0, "guarding is not stored"
    ok("stored values outlive a reset")


take_through(bring_up, position, process_data, aborts, storage)
