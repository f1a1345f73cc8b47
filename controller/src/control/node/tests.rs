use super::*;
use crate::bench::rig::Shape;
use Step::{Forget, Says, SetUp};
use syncline_canopen::time::Duration;

/// What happens to a node, at a time in µs.
enum Step {
    /// Data on 700h + id.
    Says(u64, &'static [u8]),
    /// [`DeviceNode::expect_boot`]
    Forget,
    /// [`DeviceNode::ask_set_up`]
    SetUp,
}

/// Its name, what the node did, when it is checked in µs, and what that tells.
type Case = (&'static str, &'static [Step], u64, Result<(), Fault>);

const LOST: Result<(), Fault> = fault(DeviceCause::HeartbeatLost);

const fn fault(cause: DeviceCause) -> Result<(), Fault> {
    Err(Fault::Device(0, cause))
}

const fn state(state: nmt::State) -> Result<(), Fault> {
    fault(DeviceCause::NmtState { state })
}

#[test]
fn a_heartbeat_is_missed_beyond_its_limit() {
    supervised(&[
        ("never heard", &[], 0, LOST),
        ("heard", &[Says(0, &[5])], 1, Ok(())),
        ("at the limit", &[Says(0, &[5])], 300_000, Ok(())),
        ("late", &[Says(0, &[5])], 300_001, LOST),
        (
            "each one counts anew",
            &[Says(0, &[5]), Says(300_000, &[5])],
            600_000,
            Ok(()),
        ),
        (
            "back after having been lost",
            &[Says(0, &[5]), Says(900_000, &[5])],
            900_001,
            Ok(()),
        ),
        ("forgotten", &[Says(0, &[5]), Forget], 1, LOST),
        (
            "no heartbeat by its length",
            &[Says(0, &[5]), Says(100_000, &[]), Says(100_000, &[0x7F, 0])],
            300_001,
            LOST,
        ),
    ]);
}

#[test]
fn a_boot_up_is_a_restart_unless_it_is_waited_for() {
    supervised(&[
        (
            "boot-up in the run",
            &[Says(0, &[0])],
            1,
            fault(DeviceCause::Rebooted),
        ),
        (
            "boot-up in the run, running since",
            &[Says(0, &[0]), Says(100_000, &[5])],
            100_001,
            fault(DeviceCause::Rebooted),
        ),
        (
            "boot-up before the set-up",
            &[Says(0, &[0]), SetUp],
            1,
            state(nmt::State::Initialising),
        ),
        (
            "boot-up is a sign of life",
            &[Says(0, &[0]), SetUp],
            300_000,
            state(nmt::State::Initialising),
        ),
        (
            "boot-up is no sign of life for ever",
            &[Says(0, &[0]), SetUp],
            300_001,
            LOST,
        ),
        (
            "started after the set-up",
            &[Says(0, &[0]), SetUp, Says(100_000, &[5])],
            400_000,
            Ok(()),
        ),
    ]);
}

#[test]
fn a_heartbeat_tells_the_state() {
    supervised(&[
        (
            "left Operational",
            &[Says(0, &[5]), Says(100_000, &[0x7F])],
            100_001,
            state(nmt::State::PreOperational),
        ),
        (
            "stopped, and late besides",
            &[Says(0, &[5]), Says(100_000, &[4])],
            400_001,
            LOST,
        ),
        (
            "stopped",
            &[Says(0, &[5]), Says(100_000, &[4])],
            400_000,
            state(nmt::State::Stopped),
        ),
        (
            "back in Operational",
            &[Says(0, &[0x7F]), Says(100_000, &[5])],
            100_001,
            Ok(()),
        ),
        (
            "a toggle bit, as in an answer to guarding: alive, its state unknown",
            &[Says(0, &[5]), Says(100_000, &[0x85])],
            400_000,
            fault(DeviceCause::UnknownNmtState { byte: 0x85 }),
        ),
        (
            "a byte that is no state: alive, its state unknown",
            &[Says(0, &[5]), Says(100_000, &[0x42])],
            400_000,
            fault(DeviceCause::UnknownNmtState { byte: 0x42 }),
        ),
    ]);
}

/// Heartbeat supervision with a limit of 300 ms. What a check tells it tells every time.
fn supervised(cases: &[Case]) {
    let shape = Shape::on_fewest_buses(1, Duration::from_millis(2)).unwrap();
    let layout = Arc::new(shape.layout());
    let at = |micros| Instant::ZERO + Duration::from_micros(micros);
    for (case, steps, check, expected) in cases {
        let mut node = DeviceNode::new(0, &layout);
        let id = CobId::error_control(node.device.spec().node);
        for step in *steps {
            match *step {
                Says(micros, data) => {
                    let heard = node.receive(at(micros), &Frame::new(id, data), None, &mut |_| ());
                    assert_eq!(heard, Ok(()), "{case}");
                }
                Forget => node.expect_boot(),
                SetUp => node.ask_set_up(),
            }
        }
        node.age = 0;
        for _ in 0..2 {
            let told = node.check_alive(at(*check), &mut |_| ());
            assert_eq!(told, *expected, "{case}");
        }
    }
}
