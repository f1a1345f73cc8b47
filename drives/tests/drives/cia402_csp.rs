//! The drive by the profile alone on its bus: set-up, state machine, setpoints.

use crate::common::{Bench, id, ms};
use std::time::Duration;
use syncline_canopen::cia402::State;
use syncline_canopen::{CobId, nmt};
use syncline_drives::mechanics::rigid::Rigid;
use syncline_drives::twin::cia402_csp::{Policies, Twin, TwinConfig};
use syncline_drives::twin::{Disturbance, ErrorClass, SimulatedDevice};

const NODE: u8 = 1;

/// Increments for a revolution.
const REVOLUTION: f64 = 1_048_576.0;

impl Bench<Twin> {
    fn plain() -> Self {
        Self::of([Twin::new(TwinConfig::new(id(NODE)))])
    }

    fn state(&mut self) -> State {
        self.twin().state()
    }

    /// The state some time after a controlword.
    fn command(&mut self, word: u16) -> State {
        self.controlword(NODE, word);
        self.state()
    }

    /// The last EMCY.
    fn emcy(&self) -> Option<Vec<u8>> {
        self.received(0, CobId::emcy(id(NODE)).get()).pop()
    }

    /// In its mode, a period of 10 ms, R_PDO2 at SYNC, Operational and enabled.
    fn following(config: TwinConfig) -> Self {
        let mode = config.mode as u8;
        let mut bench = Self::of([Twin::new(config)]);
        bench.write(NODE, 0x6060, 0, &[mode]).unwrap();
        bench.write(NODE, 0x60C2, 1, &[10]).unwrap();
        bench.nmt(nmt::Command::Start, NODE);
        assert_eq!(bench.command(0x06), State::ReadyToSwitchOn);
        let position = bench.position();
        bench.cycles(1, 0x06, position);
        bench.cycles(2, 0x0F, position);
        assert_eq!(bench.state(), State::OperationEnabled);
        bench
    }

    fn position(&mut self) -> i32 {
        (self.twin().observe().position * REVOLUTION) as i32
    }

    /// Cycles of 10 ms with R_PDO2 and SYNC.
    fn cycles(&mut self, count: usize, word: u16, target: i32) {
        for _ in 0..count {
            let [c0, c1] = word.to_le_bytes();
            let [p0, p1, p2, p3] = target.to_le_bytes();
            self.send(CobId::r_pdo(2, id(NODE)).get(), &[c0, c1, p0, p1, p2, p3]);
            self.wait(ms(1));
            self.sync();
            self.wait(ms(9));
        }
    }

    fn statusword(&mut self) -> u16 {
        self.twin().statusword().0
    }
}

/// The transitions by their numbers, as far as commands lead to them.
#[test]
fn states_by_commands() {
    use State::{OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn};
    let mut bench = Bench::plain();
    assert_eq!(bench.state(), SwitchOnDisabled); // T0, T1
    bench.write(NODE, 0x605A, 0, &6i16.to_le_bytes()).unwrap();
    for (word, state) in [
        (0x06, ReadyToSwitchOn),  // T2
        (0x07, SwitchedOn),       // T3
        (0x0F, OperationEnabled), // T4
        (0x07, SwitchedOn),       // T5
        (0x06, ReadyToSwitchOn),  // T6
        (0x00, SwitchOnDisabled), // T7
        (0x06, ReadyToSwitchOn),
        (0x0F, OperationEnabled), // T3, T4
        (0x06, ReadyToSwitchOn),  // T8
        (0x0F, OperationEnabled),
        (0x00, SwitchOnDisabled), // T9
        (0x06, ReadyToSwitchOn),
        (0x07, SwitchedOn),
        (0x00, SwitchOnDisabled), // T10
        (0x06, ReadyToSwitchOn),
        (0x0F, OperationEnabled),
        (0x0B, QuickStopActive),  // T11
        (0x0F, OperationEnabled), // T16
        (0x0B, QuickStopActive),
        (0x00, SwitchOnDisabled), // T12
    ] {
        assert_eq!(bench.command(word), state, "{word:02X}h");
    }
}

#[test]
fn an_error_brakes_and_its_reset_needs_its_cause_gone() {
    let mut bench = Bench::following(TwinConfig::new(id(NODE)));
    let twin = bench.twin();
    twin.disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
    twin.disturb(Disturbance::FaultPersists(true));
    assert_eq!(bench.state(), State::FaultReactionActive); // T13
    bench.wait(ms(20));
    assert_eq!(bench.state(), State::Fault); // T14
    assert_eq!(bench.emcy().unwrap(), [0x11, 0x86, 0x21, 0, 0, 0, 0, 0]);
    assert_eq!(bench.number(NODE, 0x603F, 0) & 0xFFFF, 0x8611);
    assert_eq!(bench.number(NODE, 0x1003, 1) & 0xFFFF, 0x8611);
    assert_eq!(bench.command(0x80), State::Fault);
    let twin = bench.twin();
    twin.disturb(Disturbance::FaultPersists(false));
    assert_eq!(bench.command(0x00), State::Fault);
    assert_eq!(bench.command(0x80), State::SwitchOnDisabled); // T15
    assert_eq!(bench.number(NODE, 0x603F, 0) & 0xFFFF, 0);
}

/// In a straight line to the target within the period, and there it rests: at SYNC after SYNC the
/// drive is where the SYNC before sent it.
#[test]
fn it_is_a_period_behind_and_rests_without_a_target() {
    let mut bench = Bench::following(TwinConfig::new(id(NODE)));
    assert_ne!(bench.statusword() & 0x1000, 0, "follows");
    let start = bench.position();
    // A tenth of a revolution a second, speeded up in the first period.
    for k in 1..=50 {
        bench.cycles(1, 0x0F, start + k * 1_049);
        let behind = start + k * 1_049 - bench.position();
        assert!(behind.abs() < 1_100, "{k}: {behind}");
    }
    let end = start + 50 * 1_049;
    bench.cycles(20, 0x0F, end);
    assert!((bench.position() - end).abs() < 60);
    assert_ne!(bench.statusword() & 0x0400, 0, "within its window");
}

/// In Cyclic Synchronous Velocity it goes from one velocity to the next in a straight line within the period; where it is
/// told not to, whatever 60C2h says, it goes there at once, and is half a period's way ahead for good, however its loops lag.
#[test]
fn a_velocity_is_reached_within_the_period_or_at_once() {
    // A tenth of a revolution a second.
    let velocity = 104_858;
    let [in_a_line, at_once] = [true, false].map(|interpolates| {
        let mut config = TwinConfig::new(id(NODE));
        config.mode = 9;
        config.policies.interpolates = interpolates;
        let mut bench = Bench::following(config);
        let start = bench.position();
        bench
            .write(NODE, 0x60FF, 0, &i32::to_le_bytes(velocity))
            .unwrap();
        bench.cycles(20, 0x0F, start);
        f64::from(bench.position() - start) / (0.01 * f64::from(velocity))
    });
    let ahead = at_once - in_a_line;
    assert!((ahead - 0.5).abs() < 0.05, "{in_a_line}, {at_once}");
}

#[test]
fn a_missing_sync_is_ridden_out_as_its_policy_says() {
    let mut bench = Bench::following(TwinConfig::new(id(NODE)));
    bench.wait(ms(20));
    assert_eq!(bench.state(), State::OperationEnabled);
    bench.wait(ms(20));
    assert!(bench.state() != State::OperationEnabled);
    let emcy = bench.emcy().unwrap();
    assert_eq!(emcy[..2], [0x00, 0x87]);

    let mut bench = Bench::following(TwinConfig {
        policies: Policies::tolerant(),
        ..TwinConfig::new(id(NODE))
    });
    bench.wait(ms(500));
    assert_eq!(bench.state(), State::OperationEnabled);
}

/// Where SYNC is a little late, the reference rests at its setpoint already, and the motor turns on: a quick stop that comes
/// with that SYNC takes the way of its ramp as one that comes in time does, half a revolution from 10 rev/s by 100 rev/s².
#[test]
fn a_quick_stop_behind_a_late_sync_brakes_by_its_ramp() {
    for late in [0, 500] {
        let mut bench = Bench::following(TwinConfig::new(id(NODE)));
        let ramp = (100.0 * REVOLUTION) as u32;
        bench.write(NODE, 0x6085, 0, &ramp.to_le_bytes()).unwrap();
        let mut target = bench.position();
        for k in 1..=20 {
            target += 10_486 * k.min(10);
            bench.cycles(1, 0x0F, target);
        }
        bench.wait(Duration::from_micros(late));
        let from = f64::from(bench.position());
        bench.cycles(1, 0x0B, target);
        assert_eq!(bench.state(), State::QuickStopActive);
        bench.wait(ms(200));
        assert_eq!(bench.state(), State::SwitchOnDisabled, "{:?}", bench.emcy());
        let way = (f64::from(bench.position()) - from) / REVOLUTION;
        assert!(
            (0.4..0.6).contains(&way),
            "{late} µs late: {way} revolutions"
        );
    }
}

#[test]
fn a_following_error_is_told_by_bit_13_or_is_a_fault() {
    for is_fault in [true, false] {
        let mut bench = Bench::following(TwinConfig {
            policies: Policies {
                following_error_is_fault: is_fault,
                ..Policies::default()
            },
            ..TwinConfig::new(id(NODE))
        });
        bench
            .write(NODE, 0x6065, 0, &5_000u32.to_le_bytes())
            .unwrap();
        bench.write(NODE, 0x6066, 0, &15u16.to_le_bytes()).unwrap();
        bench.twin().disturb(Disturbance::Block(true));
        let start = bench.position();
        bench.cycles(1, 0x0F, start + 20_000);
        assert_eq!(bench.statusword() & 0x2000, 0, "not for 15 ms yet");
        bench.cycles(2, 0x0F, start + 20_000);
        if is_fault {
            assert!(bench.state() != State::OperationEnabled);
        } else {
            assert_eq!(bench.state(), State::OperationEnabled);
            assert_ne!(bench.statusword() & 0x2000, 0);
        }
    }
}

#[test]
fn what_is_refused() {
    let mut bench = Bench::plain();
    for (index, sub, bytes, code) in [
        (0x6060, 0, &[7][..], 0x0609_0030), // another mode
        (0x1A00, 0, &[0], 0x0601_0000),     // mapped while it is on
        (0x608F, 1, &[0; 4], 0x0601_0002),
        (0x6091, 1, &[0; 4], 0x0601_0002),
        (0x60C2, 1, &[0], 0x0609_0030),
        (0x2000, 0, &[0], 0x0602_0000),
    ] {
        assert_eq!(
            bench.write(NODE, index, sub, bytes),
            Err(code),
            "{index:04X}"
        );
    }
    bench.nmt(nmt::Command::Start, NODE);
    assert_eq!(bench.write(NODE, 0x60C2, 1, &[2]), Err(0x0800_0022));
    bench.twin().disturb(Disturbance::Remote(false));
    assert_eq!(bench.write(NODE, 0x6040, 0, &[6, 0]), Err(0x0800_0021));
}

#[test]
fn a_lost_heartbeat_is_a_fault() {
    let mut bench = Bench::following(TwinConfig {
        policies: Policies::tolerant(),
        ..TwinConfig::new(id(NODE))
    });
    let watch = 0x7F_0000u32 | 50;
    bench.write(NODE, 0x1016, 1, &watch.to_le_bytes()).unwrap();
    bench.send(0x77F, &[5]);
    bench.wait(ms(30));
    assert_eq!(bench.state(), State::OperationEnabled);
    bench.wait(ms(60));
    assert_eq!(bench.state(), State::Fault);
    let emcy = bench.emcy().unwrap();
    assert_eq!(emcy[..3], [0x30, 0x81, 0x11]);
}

/// A supply that goes while the power stage is being switched on leaves it off; what is commanded once more switches it on.
#[test]
fn a_supply_that_goes_ends_the_way_on() {
    let mut bench = Bench::plain();
    let twin = bench.twin();
    twin.disturb(Disturbance::EnableTime(ms(100)));
    assert_eq!(bench.command(0x06), State::ReadyToSwitchOn);
    assert_eq!(bench.command(0x0F), State::SwitchedOn);
    bench.twin().disturb(Disturbance::Mains(false));
    for _ in 0..300 {
        bench.wait(ms(1));
        assert_eq!(bench.state(), State::SwitchedOn);
        assert!(!bench.twin().observe().is_powered);
    }
    assert_eq!(bench.emcy(), None);
    bench.twin().disturb(Disturbance::Mains(true));
    bench.wait(ms(300));
    assert_eq!(bench.state(), State::SwitchedOn);
    assert_eq!(bench.command(0x0F), State::SwitchedOn);
    bench.wait(ms(100));
    assert_eq!(bench.state(), State::OperationEnabled);
}

/// A motor that has lost its torque does not come to rest by braking: the power stage goes off, and the brake stops what hangs
/// on it.
#[test]
fn a_fault_reaction_that_does_not_stop_the_motor_ends() {
    let mut config = TwinConfig::new(id(NODE));
    config.servo.mechanics = Rigid {
        load_torque: -0.4,
        ..Rigid::default()
    }
    .into();
    let mut bench = Bench::following(config);
    bench.twin().disturb(Disturbance::LoseTorque(true));
    bench.wait(ms(50));
    let twin = bench.twin();
    twin.disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
    bench.wait(ms(300));
    assert_eq!(bench.state(), State::FaultReactionActive);
    bench.wait(ms(700));
    assert_eq!(bench.state(), State::Fault);
    assert_eq!(bench.twin().observe().velocity, 0.0);
}

/// Guarded by remote requests (100Ch, 100Dh) it goes on as long as they come, and brakes with a fault when they stay away,
/// SYNC and setpoints or not.
#[test]
fn a_guarded_drive_misses_its_master() {
    let mut bench = Bench::following(TwinConfig::new(id(NODE)));
    bench.write(NODE, 0x100C, 0, &[100, 0]).unwrap();
    bench.write(NODE, 0x100D, 0, &[4]).unwrap();
    let position = bench.position();
    for _ in 0..10 {
        assert!(bench.remote(0x700 + u16::from(NODE)).is_some());
        bench.cycles(30, 0x0F, position);
    }
    assert_eq!(bench.state(), State::OperationEnabled);
    bench.cycles(20, 0x0F, position);
    assert_eq!(bench.state(), State::Fault);
    assert_eq!(bench.emcy().unwrap()[..2], [0x30, 0x81]);
}
