"""python-canopen as the master of an I/O node by CiA 401.

usage: io_client.py EDS NODE INTERFACE KEY=VALUE...

EDS is the node's data sheet; INTERFACE and the rest open the bus with python-can. The node has just been
switched on, and nothing is wired to its inputs. Ends with code 0 and a line "ok" for each step, or with an
AssertionError. Every wait is bounded.
"""

from master import aborted, answers, ok, received, take_through, until


def bring_up(node):
    until("an answer", lambda: answers(node), 5)
    assert node.sdo[0x1000].raw == 0x000F0191
    assert node.sdo[0x1008].raw == "CiA 401 I/O"
    ok("an I/O node with digital and analog inputs and outputs")


def outputs(node):
    node.sdo[0x6200][1].raw = 0x21
    node.sdo[0x6200][2].raw = 0x43
    assert node.sdo[0x6300][1].raw == 0x4321
    node.sdo[0x6300][1].raw = 0
    assert node.sdo[0x6200][2].raw == 0
    node.sdo[0x6411][3].raw = -1234
    assert node.sdo[0x6411][3].raw == -1234
    ok("digital outputs by bytes and by words, analog outputs")


def process_data(node):
    node.tpdo.read()
    node.rpdo.read()
    assert [v.index for v in node.tpdo[1].map] == [0x6000, 0x6000]
    assert [v.index for v in node.rpdo[2].map] == [0x6411] * 4
    with received(node.tpdo[1], "no T_PDO on entering Operational"):
        node.nmt.state = "OPERATIONAL"
    out = node.rpdo[1]
    out[0].raw, out[1].raw = 0x0F, 0xF0
    out.transmit()
    until("the outputs", lambda: node.sdo[0x6300][1].raw == 0xF00F)
    # A change of polarity changes what the inputs read.
    with received(node.tpdo[1], "no T_PDO at a change"):
        node.sdo[0x6002][1].raw = 0x81
    assert node.tpdo[1][0].raw == 0x81
    ok("outputs by R_PDO, inputs by event")


def synchronous(node):
    node.nmt.state = "PRE-OPERATIONAL"
    inputs = node.tpdo[1]
    inputs.trans_type = 1
    inputs.save()
    node.nmt.state = "OPERATIONAL"
    for _ in range(3):
        with received(inputs, "no T_PDO after SYNC"):
            node.network.sync.transmit()
    ok("inputs by SYNC")


def falls_back(node):
    """Error values once the master's heartbeat is missing."""
    node.sdo[0x6206][1].raw = 0xFF
    node.sdo[0x6207][1].raw = 0x55
    node.sdo[0x1017].raw = 50
    node.sdo[0x1016][1].raw = 0x7F << 16 | 300
    node.network.send_message(0x77F, [5])
    node.emcy.reset()
    assert node.emcy.wait(0x8130, timeout=3) is not None, "no EMCY 8130h"
    until("Pre-Operational", lambda: node.nmt.state == "PRE-OPERATIONAL")
    ok("a missing heartbeat is found")


def aborts(node):
    sdo = node.sdo
    aborted(0x06010002, lambda: sdo.download(0x6000, 1, bytes(1)))
    aborted(0x06090011, lambda: sdo.upload(0x6200, 3))
    aborted(0x06070012, lambda: sdo.download(0x6200, 1, bytes(2)))
    aborted(0x06090030, lambda: sdo.download(0x6423, 0, b"\x02"))
    aborted(0x06090030, lambda: sdo.download(0x6421, 1, b"\x20"))
    ok("abort codes")


take_through(bring_up, outputs, process_data, synchronous, aborts, falls_back)
