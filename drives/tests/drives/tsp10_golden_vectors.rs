//! Every value, pattern and example that the stepper controller's manual prints, executed over the
//! bus. It prints no frame at all; those that the reference derives from its tables run besides.
//! Numbers are lines of the manual's text. What contradicts itself there is in [`SUSPECTS`].

use crate::common::{Bench, TARGET_REACHED, id, ms};
use syncline_canopen::cia402::State;
use syncline_canopen::nmt::Command;
use syncline_drives::mechanics::rigid::Rigid;
use syncline_drives::twin::node::Processor;
use syncline_drives::twin::tsp10::{Policies, StandbyUnit, Switches, Twin, TwinConfig};
use syncline_drives::twin::{Disturbance, ErrorClass, Kind, SimulatedDevice};

use Printed::{Id, Number, Text};

/// What is printed in two ways, or cannot be as printed, and what the twin does: none of it is
/// compared as it stands.
const SUSPECTS: [(u16, &str); 6] = [
    (
        162,
        "no states and no bit 7 for the fault reset; from Fault by a rising edge, as 167 explains",
    ),
    (
        241,
        "a row of 1002h is headed Profile Position; the bits are those of every mode",
    ),
    (
        558,
        "thousandths of the rated current, against 50 % of 0 to 100 (563-564); per cent by default",
    ),
    (
        599,
        "UNSIGNED32 and 0 to 14, against INTEGER16 (592) and the example of -1 (621); two bytes with a sign",
    ),
    (
        675,
        "6060h is the index of what shows the mode; it is 6061h (629, 672)",
    ),
    (
        857,
        "6098h is named Home offset; that is 607Ch, and 6098h the method (839)",
    ),
];

#[derive(Clone, Copy)]
enum Printed {
    Number(i64),
    Text(&'static str),
    /// A number and the node id.
    Id(u32),
}

/// Every value and default that a table or an example prints: its line, the object, the value.
const VALUES: [(u16, u16, u8, Printed); 58] = [
    (207, 0x1000, 0, Number(0x0004_0192)),
    (249, 0x1008, 0, Text("TSP")),
    (259, 0x1009, 0, Text("513")),
    (271, 0x100A, 0, Text("060")),
    (286, 0x1018, 1, Number(0x41_4853)),
    (293, 0x1018, 2, Number(21)),
    (320, 0x1400, 1, Id(0x200)),
    (325, 0x1400, 2, Number(255)),
    (340, 0x1401, 1, Id(0x300)),
    (345, 0x1401, 2, Number(255)),
    (358, 0x1600, 1, Number(0x6040_0010)),
    (363, 0x1600, 2, Number(0x607A_0020)),
    (376, 0x1601, 1, Number(0x6040_0010)),
    (381, 0x1601, 2, Number(0x60FF_0020)),
    (396, 0x1800, 1, Id(0x4000_0180)),
    (401, 0x1800, 2, Number(255)),
    (416, 0x1801, 1, Id(0x4000_0280)),
    (421, 0x1801, 2, Number(255)),
    (434, 0x1A00, 1, Number(0x6041_0010)),
    (439, 0x1A00, 2, Number(0x6064_0020)),
    (452, 0x1A01, 1, Number(0x6041_0010)),
    (457, 0x1A01, 2, Number(0x606C_0020)),
    (480, 0x6075, 0, Number(400)),
    (500, 0x608F, 1, Number(0)),
    (506, 0x608F, 2, Number(1)),
    (524, 0x6092, 1, Number(10_000)),
    (530, 0x6092, 2, Number(1)),
    (536, 0x6092, 1, Number(10_000)),
    (544, 0x60A8, 0, Number(0xAC_0000)),
    (564, 0x2001, 1, Number(50)),
    (570, 0x2001, 2, Number(100)),
    (580, 0x2002, 0, Number(0)),
    (600, 0x2003, 1, Number(0)),
    (604, 0x2003, 2, Number(1)),
    (605, 0x2003, 3, Number(2)),
    (606, 0x2003, 4, Number(3)),
    (607, 0x2003, 5, Number(4)),
    (600, 0x2003, 6, Number(0)),
    (600, 0x2003, 7, Number(0)),
    (600, 0x2003, 8, Number(0)),
    (600, 0x2003, 9, Number(0)),
    (600, 0x2003, 10, Number(0)),
    (665, 0x6060, 0, Number(1)),
    (668, 0x6061, 0, Number(1)),
    (727, 0x6081, 0, Number(1)),
    (737, 0x6083, 0, Number(23)),
    (747, 0x6084, 0, Number(23)),
    (805, 0x6083, 0, Number(23)),
    (815, 0x6084, 0, Number(23)),
    (849, 0x607C, 0, Number(0)),
    (859, 0x6098, 0, Number(35)),
    (885, 0x6099, 1, Number(1)),
    (888, 0x6099, 2, Number(1)),
    (898, 0x609A, 0, Number(23)),
    // As the reference has them: the node id by S2 and S1 (108-112), no error, no referenced axis.
    (112, 0x1002, 0, Id(0)),
    (222, 0x1001, 0, Number(0)),
    (709, 0x6062, 0, Number(0)),
    (709, 0x6064, 0, Number(0)),
];

/// Every printed transition by command: its number, from, to, and bits 7, 3, 2, 1, 0 (147-163).
#[rustfmt::skip]
const TRANSITIONS: [(u8, State, State, &str); 15] = [
    (2, State::SwitchOnDisabled, State::ReadyToSwitchOn, "0x110"),
    (3, State::ReadyToSwitchOn, State::SwitchedOn, "00111"),
    (4, State::SwitchedOn, State::OperationEnabled, "01111"),
    (5, State::OperationEnabled, State::SwitchedOn, "00111"),
    (6, State::SwitchedOn, State::ReadyToSwitchOn, "0x110"),
    (7, State::ReadyToSwitchOn, State::SwitchOnDisabled, "0xx0x"),
    (7, State::ReadyToSwitchOn, State::SwitchOnDisabled, "0x01x"),
    (8, State::OperationEnabled, State::ReadyToSwitchOn, "0x110"),
    (9, State::OperationEnabled, State::SwitchOnDisabled, "0xx0x"),
    (10, State::SwitchedOn, State::SwitchOnDisabled, "0xx0x"),
    (10, State::SwitchedOn, State::SwitchOnDisabled, "0x01x"),
    (11, State::OperationEnabled, State::QuickStopActive, "0x01x"),
    (12, State::QuickStopActive, State::SwitchOnDisabled, "0xx0x"),
    (16, State::QuickStopActive, State::OperationEnabled, "01111"),
    // Suspect (162): "xxxx" without bit 7 is printed.
    (15, State::Fault, State::SwitchOnDisabled, "1xxxx"),
];

/// Bits 6 to 0 of the statusword in every state (173-180).
const PATTERNS: [(State, &str); 8] = [
    (State::NotReadyToSwitchOn, "0xx0000"),
    (State::SwitchOnDisabled, "1xx0000"),
    (State::ReadyToSwitchOn, "01x0001"),
    (State::SwitchedOn, "01x0011"),
    (State::OperationEnabled, "01x0111"),
    (State::QuickStopActive, "00x0111"),
    (State::FaultReactionActive, "0xx1111"),
    (State::Fault, "0xx1000"),
];

fn config(node: u8) -> TwinConfig {
    TwinConfig {
        processor: Processor::prompt(id(node)),
        ..TwinConfig::new(id(node))
    }
}

fn of(config: TwinConfig) -> Bench<Twin> {
    Bench::of([Twin::new(config)])
}

fn write(bench: &mut Bench<Twin>, index: u16, sub: u8, value: i32, bytes: usize) {
    let refused = bench.write(1, index, sub, &value.to_le_bytes()[..bytes]);
    assert_eq!(refused, Ok(()), "{index:04X}:{sub}");
}

/// Through the states by the printed commands, with a motor and ramps that can move.
fn enable(bench: &mut Bench<Twin>, mode: u8) {
    for (index, value) in [
        (0x6075, 3000),
        (0x6081, 20_000),
        (0x6083, 100_000),
        (0x6084, 100_000),
        (0x609A, 100_000),
    ] {
        write(bench, index, 0, value, 4);
    }
    write(bench, 0x6099, 1, 10_000, 4);
    write(bench, 0x6060, 0, mode.into(), 1);
    bring(bench, State::OperationEnabled);
}

/// Brings a controller that was just switched on to a state.
fn bring(bench: &mut Bench<Twin>, state: State) {
    let words: &[u16] = match state {
        State::SwitchOnDisabled => &[],
        State::ReadyToSwitchOn => &[0x06],
        State::SwitchedOn => &[0x06, 0x07],
        State::QuickStopActive => &[0x06, 0x07, 0x0F, 0x02],
        _ => &[0x06, 0x07, 0x0F],
    };
    for &word in words {
        bench.controlword(1, word);
    }
    if state == State::Fault {
        bench
            .twin()
            .disturb(Disturbance::Fault(ErrorClass::SwitchOff));
        bench.wait(ms(1));
    }
    assert_eq!(bench.twin().state(), state);
}

fn fits(bits: &str, width: usize, word: u16) -> bool {
    assert_eq!(bits.len(), width);
    bits.bytes()
        .rev()
        .enumerate()
        .all(|(place, bit)| bit == b'x' || u16::from(bit - b'0') == word >> place & 1)
}

fn reach(bench: &mut Bench<Twin>) {
    for _ in 0..1000 {
        if bench.read_u16(1, 0x6041, 0) & TARGET_REACHED != 0 {
            return;
        }
        bench.wait(ms(5));
    }
    panic!("no target within 5 s");
}

fn go(bench: &mut Bench<Twin>, target: i32) {
    bench.controlword(1, 0x0F);
    write(bench, 0x607A, 0, target, 4);
    bench.controlword(1, 0x1F);
    reach(bench);
}

/// 116-125; the maker's tool alone sets one of them.
#[test]
fn the_printed_bit_rates() {
    let printed = [1000, 800, 500, 250, 125, 100, 50].map(|kbit| kbit * 1000);
    let known = Kind::by_name("tsp10").unwrap().bitrates.iter().rev();
    assert!(known.eq(&printed));
}

/// With an address that one rotary switch holds, and with addresses that need both (108-112).
#[test]
fn every_printed_value() {
    for node in [1, 15, 16, 0x23, 127] {
        let mut bench = of(config(node));
        let mut wrong = vec![];
        for (line, index, sub, printed) in VALUES {
            let answer = bench.upload(node, index, sub).unwrap();
            let number = match printed {
                Text(text) => {
                    if answer != text.as_bytes() {
                        wrong.push(format!("{line}: {index:04X}:{sub} {answer:02X?}"));
                    }
                    continue;
                }
                Number(number) => number,
                // Nothing rests active but the limit switches' inputs, which rest high.
                Id(0) => i64::from(node) | 0b110 << 18,
                Id(base) => i64::from(base) + i64::from(node),
            };
            if answer != number.to_le_bytes()[..answer.len()] {
                wrong.push(format!("{line}: {index:04X}:{sub} {answer:02X?}"));
            }
        }
        assert!(wrong.is_empty(), "node {node}: {wrong:#?}");
    }
}

/// Those in which a drive stays.
const STATES: [State; 6] = [
    State::SwitchOnDisabled,
    State::ReadyToSwitchOn,
    State::SwitchedOn,
    State::OperationEnabled,
    State::QuickStopActive,
    State::Fault,
];

/// Each of both words that bits 4 to 6 and 8 make of a command, in each state.
#[test]
fn every_command_in_every_state() {
    let mut led = std::collections::BTreeSet::new();
    for from in STATES {
        for bits in 0..32_u16 {
            for others in [0, 0x170] {
                let mut bench = of(config(1));
                bring(&mut bench, from);
                let word = bits >> 4 << 7 | bits & 0xF | others;
                bench.controlword(1, word);
                let mut rows = TRANSITIONS.iter();
                let row = rows.find(|row| row.1 == from && fits(row.3, 5, bits));
                let to = row.map_or(from, |row| row.2);
                assert_eq!(bench.twin().state(), to, "{from:?}, {word:04X}");
                led.extend(row.map(|row| row.0));
            }
        }
    }
    assert_eq!(
        led.into_iter().collect::<Vec<_>>(),
        [2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 15, 16]
    );
}

/// The two transitions from power-on (145-146), those of an error (160-161), and each pattern.
#[test]
fn every_state_by_its_printed_bits() {
    let mut seen = vec![];
    let mut see = |state: State, word: u16| {
        let (_, bits) = PATTERNS.iter().find(|row| row.0 == state).unwrap();
        assert!(fits(bits, 7, word & 0x7F), "{state:?}: {word:04X}");
        seen.push(state);
    };
    let fresh = Twin::new(config(1));
    see(fresh.state(), fresh.statusword().0);
    for state in STATES {
        let mut bench = of(config(1));
        bring(&mut bench, state);
        see(state, bench.read_u16(1, 0x6041, 0));
    }
    let mut bench = of(config(1));
    enable(&mut bench, 3);
    write(&mut bench, 0x60FF, 0, 10_000, 4);
    bench.wait(ms(300));
    bench
        .twin()
        .disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
    let word = bench.read_u16(1, 0x6041, 0);
    see(bench.twin().state(), word);
    bench.wait(ms(500));
    assert_eq!(bench.twin().state(), State::Fault);
    assert!(PATTERNS.iter().all(|row| seen.contains(&row.0)), "{seen:?}");
}

/// 532-536: 10000 steps are a revolution; 508, 709: four counts a line, and without an encoder the
/// actual position is the demand.
#[test]
fn steps_and_lines_of_a_revolution() {
    for counts in [0, 4 * 1000] {
        let mut bench = of(config(1));
        write(&mut bench, 0x608F, 1, counts, 4);
        enable(&mut bench, 1);
        go(&mut bench, 10_000);
        bench.wait(ms(500));
        let turned = bench.twin().observe().position;
        assert!((turned - 1.0).abs() < 2e-3, "{turned}");
        let (demand, actual) = (bench.read_i32(1, 0x6062, 0), bench.read_i32(1, 0x6064, 0));
        assert_eq!(demand, 10_000);
        if counts == 0 {
            assert_eq!(actual, demand);
        } else {
            // 2.5 steps a count.
            assert!((actual - demand).abs() <= 20, "{actual}");
            assert!(matches!(actual.rem_euclid(5), 0 | 3), "{actual}");
        }
    }
}

/// 558-564, both readings of it: what holds a weight in standby at 50 % of 3 A does not at 50
/// thousandths.
#[test]
fn standby_current_as_the_table_and_as_the_text_have_it() {
    for (standby_unit, holds) in [
        (StandbyUnit::Percent, true),
        (StandbyUnit::Thousandths, false),
    ] {
        let mut bench = of(TwinConfig {
            mechanics: Rigid {
                load_torque: 0.3,
                coulomb_friction: 0.0,
                ..Rigid::default()
            }
            .into(),
            policies: Policies {
                standby_unit,
                ..Policies::default()
            },
            ..config(1)
        });
        enable(&mut bench, 1);
        bench.wait(ms(90));
        assert!(
            bench.twin().lost_steps().abs() < 100.0,
            "within the delay (570)"
        );
        bench.wait(ms(900));
        assert_eq!(bench.twin().lost_steps().abs() < 100.0, holds);
    }
}

/// 583: clockwise, seen looking at the shaft, is positive; 1 turns it round.
#[test]
fn direction_of_rotation() {
    for (setting, turned) in [(0, 1.0), (1, -1.0)] {
        let mut bench = of(config(1));
        write(&mut bench, 0x2002, 0, setting, 2);
        enable(&mut bench, 1);
        go(&mut bench, 10_000);
        bench.wait(ms(500));
        assert!((bench.twin().observe().position - turned).abs() < 2e-3);
    }
}

/// 602-621: the function of each of the ten inputs at both levels, by its flag in 1002h or by what it
/// starts, with the level that is printed for it and, negated, with the other.
#[test]
fn functions_of_inputs_and_their_levels() {
    let low = [1, 2];
    for input in 1..=10_u8 {
        for (function, bit) in [(1, 9), (2, 10), (3, 11), (4, 12), (10, 28)] {
            for sign in [1, -1] {
                let mut bench = of(config(1));
                for other in 2..=5 {
                    write(&mut bench, 0x2003, other, 0, 2);
                }
                write(&mut bench, 0x2003, input, sign * function, 2);
                let is_high_active = low.contains(&function) == (sign < 0);
                for level in [false, true] {
                    // What the switches along the axis drive rests: DE2 and DE3 high, DE4 low.
                    let level = match input {
                        2 | 3 => true,
                        4 => false,
                        _ => level,
                    };
                    let input_is = Disturbance::Input(input - 1, level);
                    bench.twin().disturb(input_is);
                    bench.wait(ms(1));
                    let status = bench.number(1, 0x1002, 0);
                    assert_eq!(status >> (17 + input) & 1, level.into(), "DE{input}");
                    let active = level == is_high_active;
                    let what = format!("DE{input} = {}, level {level}", sign * function);
                    assert_eq!(status >> bit & 1, active.into(), "{what}");
                }
            }
        }
    }
}

/// 603-617: of the functions without a flag in 1002h only the start of homing is described; the others
/// start nothing.
#[test]
fn functions_that_start() {
    for function in [0, 5, 6, 7, 8, 9, 11, 12, 13, 14] {
        let mut bench = of(config(1));
        write(&mut bench, 0x2003, 6, function, 2);
        write(&mut bench, 0x6098, 0, 24, 1);
        enable(&mut bench, 6);
        bench.twin().disturb(Disturbance::Input(5, true));
        bench.wait(ms(200));
        let has_moved = bench.read_i32(1, 0x6062, 0) != 0;
        assert_eq!(has_moved, function == 9, "{function}");
        assert_eq!(bench.twin().state(), State::OperationEnabled);
    }
}

/// 599-621 and 675: of both printed sizes, ranges and indices the ones that the examples have.
#[test]
fn what_the_twin_does_with_suspects() {
    let mut bench = of(config(1));
    assert_eq!(bench.read(1, 0x2003, 2).unwrap().len(), 2);
    for (value, answer) in [(-14, Ok(())), (14, Ok(())), (-15, Err(0x0609_0030))] {
        let value: i16 = value;
        assert_eq!(bench.write(1, 0x2003, 2, &value.to_le_bytes()), answer);
    }
    bench.write(1, 0x6060, 0, &[3]).unwrap();
    assert_eq!(bench.read(1, 0x6061, 0), Ok(vec![3]));
    assert_eq!(bench.write(1, 0x6061, 0, &[3]), Err(0x0601_0002));
    let lines: Vec<u16> = SUSPECTS.iter().map(|suspect| suspect.0).collect();
    assert!(lines.is_sorted());
    assert!(SUSPECTS.iter().all(|(_, reason)| !reason.is_empty()));
    let compared = VALUES.iter().map(|value| value.0);
    assert_eq!(compared.filter(|line| lines.contains(line)).count(), 0);
}

/// 912-919: from between the reference point and the upper limit switch to that, down to the reference
/// switch, back to its edge from above, off and on again, and the counter reads 5000.
#[test]
fn the_printed_homing_movement() {
    let mut bench = of(TwinConfig {
        position: 1.5,
        switches: Switches {
            lower_limit: Some(-2.0),
            upper_limit: Some(2.0),
            reference: Some(0.75..1.25),
        },
        ..config(1)
    });
    enable(&mut bench, 6);
    write(&mut bench, 0x607C, 0, 5000, 4);
    write(&mut bench, 0x6098, 0, 25, 1);
    bench.controlword(1, 0x1F);
    let mut turns = vec![];
    let mut direction = 1.0;
    let mut before = bench.read_i32(1, 0x6062, 0);
    for _ in 0..4000 {
        bench.wait(ms(1));
        if bench.number(1, 0x1002, 0) >> 8 & 1 != 0 {
            break;
        }
        let demand = bench.read_i32(1, 0x6062, 0);
        if f64::from(demand - before) * direction < 0.0 {
            direction = -direction;
            turns.push(bench.twin().observe().position);
        }
        before = demand;
    }
    // Up to the limit switch; down onto the reference switch; up off it; onto it again from above; and
    // up to the edge, which braking went past.
    assert_eq!(turns.len(), 4, "{turns:?}");
    assert!((2.0..2.2).contains(&turns[0]), "{turns:?}");
    assert!((1.0..1.25).contains(&turns[1]), "{turns:?}");
    assert!((1.25..1.45).contains(&turns[2]), "{turns:?}");
    assert!((1.0..1.25).contains(&turns[3]), "{turns:?}");
    bench.wait(ms(500));
    assert_eq!(bench.read_i32(1, 0x6064, 0), 5000);
    let at = bench.twin().observe().position;
    assert!((at - 1.25).abs() < 0.01, "{at}");
}

/// Not printed: the frames that the reference derives from the tables, in its order, node 1.
#[test]
fn the_frames_of_the_reference() {
    let mut bench = of(config(1));
    bench.nmt(Command::Start, 1);
    for request in [
        [0x23, 0x75, 0x60, 0x00, 0xB8, 0x0B, 0x00, 0x00],
        [0x23, 0x92, 0x60, 0x01, 0x10, 0x27, 0x00, 0x00],
        [0x23, 0x81, 0x60, 0x00, 0x10, 0x27, 0x00, 0x00],
        [0x23, 0x83, 0x60, 0x00, 0x50, 0xC3, 0x00, 0x00],
        [0x23, 0x84, 0x60, 0x00, 0x50, 0xC3, 0x00, 0x00],
        [0x2F, 0x60, 0x60, 0x00, 0x06, 0x00, 0x00, 0x00],
        [0x2F, 0x60, 0x60, 0x00, 0x03, 0x00, 0x00, 0x00],
        [0x2F, 0x60, 0x60, 0x00, 0x01, 0x00, 0x00, 0x00],
    ] {
        let confirmation = [0x60, request[1], request[2], request[3], 0, 0, 0, 0];
        assert_eq!(bench.request(1, request), confirmation);
    }
    let sent = |bench: &mut Bench<Twin>, id: u16, frames: &[[u8; 6]], millis: u64| {
        for frame in frames {
            bench.send(id, frame);
            bench.wait(ms(10));
        }
        bench.wait(ms(millis));
    };
    for (word, state) in [
        (0x06, State::ReadyToSwitchOn),
        (0x07, State::SwitchedOn),
        (0x0F, State::OperationEnabled),
    ] {
        sent(&mut bench, 0x201, &[[word, 0, 0, 0, 0, 0]], 0);
        assert_eq!(bench.twin().state(), state);
    }
    let from = bench.log.len();
    let absolute = [[0x0F, 0, 0x10, 0x27, 0, 0], [0x1F, 0, 0x10, 0x27, 0, 0]];
    sent(&mut bench, 0x201, &absolute, 1500);
    sent(&mut bench, 0x201, &absolute[..1], 100);
    let told = bench.received(from, 0x181);
    assert_eq!(told.last().unwrap(), &[0x37, 0x06, 0x10, 0x27, 0, 0]);
    let relative = [
        [0x4F, 0, 0x18, 0xFC, 0xFF, 0xFF],
        [0x5F, 0, 0x18, 0xFC, 0xFF, 0xFF],
    ];
    sent(&mut bench, 0x201, &relative, 1000);
    assert_eq!(bench.read_i32(1, 0x6064, 0), 9000);
    sent(&mut bench, 0x201, &[[0x0B, 0, 0x10, 0x27, 0, 0]], 0);
    assert_eq!(bench.twin().state(), State::QuickStopActive);
    sent(&mut bench, 0x201, &[[0x0F, 0, 0x10, 0x27, 0, 0]], 0);
    bench.write(1, 0x6060, 0, &[3]).unwrap();
    let from = bench.log.len();
    sent(&mut bench, 0x301, &[[0x0F, 0, 0xE8, 0x03, 0, 0]], 100);
    assert_eq!(bench.read_i32(1, 0x606C, 0), 1000);
    let told = bench.received(from, 0x281);
    // Bit 10 in this mode is open: the twin sets it once the velocity is reached.
    assert_eq!(told.last().unwrap()[0], 0x37);
    assert_eq!(told.last().unwrap()[1] & !0x04, 0x02);
    sent(&mut bench, 0x301, &[[0x0F, 0x01, 0xE8, 0x03, 0, 0]], 100);
    assert_eq!(bench.read_i32(1, 0x606C, 0), 0);
    bench
        .twin()
        .disturb(Disturbance::Fault(ErrorClass::SwitchOff));
    sent(&mut bench, 0x201, &[[0x80, 0, 0, 0, 0, 0]], 0);
    assert_eq!(bench.twin().state(), State::SwitchOnDisabled);
}
