//! Rigid tapping: in step with a measured spindle down, through its reversal, and up again, on `examples/drill`. What is
//! judged is where the simulated tool is when the simulated rotor is where it is.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_canopen::{CobId, Frame, NodeId};
use syncline_controller::control::fault::BlockCause;
use syncline_controller::control::{End, Event, Fault, State, ThreadFailure};
use syncline_controller::machine::Machine;
use syncline_controller::program::{NoThread, ProgramError, Programs};
use syncline_controller::session::Command;
use syncline_drives::twin::Disturbance;
use syncline_gcode::Turning;
use syncline_tests::command::machine_file;
use syncline_tests::rig::Rig;
use syncline_trajectory::synchronous::{BEYOND, LostStep};

use super::day::{assert_moves_within_limits, go, settle, state};
use super::threads::{ALLOWED, EVEN, FINE, RIPPLES, SETTLED, SPINDLE, Thread, told};

/// Where taps begin, mm.
const TOP: f64 = 40.0;

/// How much deeper or less deep than programmed a tap may be, mm.
const DEPTH: f64 = 0.05;

impl Thread {
    /// The way of the tool to where the spindle stands, and so much more that it is in step for a while.
    fn depth(&self) -> f64 {
        let turns = self.speed / 60.0;
        self.lead * (turns * (turns / 116.0 + 0.08) + 0.3 * turns + 1.0)
    }

    fn tap_program(&self) -> String {
        let code = if self.reverse { "M4" } else { "M3" };
        format!(
            "G21 G90 G61\n{code} S{}\nG0 X5 Z{TOP}\nG33.1 Z{:.6} K{}\nG0 Z45\nM5\nM2\n",
            self.speed,
            TOP - self.depth(),
            self.lead
        )
    }

    fn tap_rig(&self) -> Rig {
        self.rig_for(&self.tap_program())
    }
}

/// What became of a tap, mm.
#[derive(Debug)]
struct Tapped {
    /// The greatest distance of the tool from where the spindle wants it.
    off: f64,
    /// How much deeper than programmed its setpoints led.
    beyond: f64,
    samples: usize,
}

/// Goes on to the end.
fn tap(thread: &Thread, rig: &mut Rig) -> Tapped {
    let mut tapped = Tapped {
        off: 0.0,
        beyond: f64::NEG_INFINITY,
        samples: 0,
    };
    let (mut since, mut returns) = (None, false);
    while rig.step() {
        let Some(row) = rig.rows.last() else { continue };
        let (plan, at) = (row.plan, row.at.as_nanos() as f64 * 1e-9);
        if !plan.off_path || since.is_none() && plan.speed < 0.9 * thread.feed() {
            continue;
        }
        let since = *since.get_or_insert(at);
        let depth = TOP - plan.position[2];
        tapped.beyond = tapped.beyond.max(depth - thread.depth());
        returns |= plan.velocity[2] > 0.0;
        if at - since > SETTLED && !(returns && depth < thread.run_out()) {
            tapped.off = tapped.off.max(thread.off(rig).abs());
            tapped.samples += 1;
        }
    }
    tapped
}

/// Taps it: within what is allowed, within the limits, as deep as programmed, and back where it began.
fn assert_in_step(thread: &Thread) -> Tapped {
    let mut rig = thread.tap_rig();
    let tapped = tap(thread, &mut rig);
    let end = rig.end();
    assert_eq!(end, Some(End::Finished), "{thread:?}: {:?}", rig.events);
    assert!(tapped.samples > 300, "{thread:?}: {tapped:?}");
    assert!(tapped.off <= ALLOWED, "{thread:?}: {tapped:?}");
    assert!(tapped.beyond.abs() <= DEPTH, "{thread:?}: {tapped:?}");
    assert_eq!(told(&rig).len(), 1);
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
    tapped
}

// --- in step ---

#[test]
fn the_tool_is_in_step_through_the_reversal() {
    for (speed, ripple) in [100.0, 500.0, 1000.0, 1500.0].into_iter().zip(RIPPLES) {
        let (lead, counts) = (3.0, 4096);
        assert_in_step(&Thread {
            speed,
            lead,
            ripple,
            counts,
            ..EVEN
        });
    }
}

/// The table of `docs/measured.md`.
#[test]
#[ignore = "half a minute; prints"]
fn how_far_out_of_step_taps_are() {
    for counts in [4096, FINE] {
        for lead in [0.5, 1.5, 3.0] {
            for speed in [100.0, 300.0, 500.0, 1000.0, 1500.0] {
                let worst = RIPPLES.map(|ripple| {
                    let thread = Thread {
                        speed,
                        lead,
                        ripple,
                        counts,
                        ..EVEN
                    };
                    let tapped = tap(&thread, &mut thread.tap_rig());
                    [tapped.off, tapped.beyond].map(|mm| 1e3 * mm)
                });
                println!("| {counts} | {lead} | {speed} | {worst:.1?} |");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// Either way round.
    #[test]
    fn any_tap_is_in_step(
        speed in 100.0..1500.0f64, lead in 0.5..3.0f64, reverse in any::<bool>(), part in 0.0..0.02f64, periods in 1..4u32,
        counts in select(vec![4096, 65_536, FINE]),
    ) {
        let (speed, lead) = ((speed * 10.0).round() / 10.0, (lead * 100.0).round() / 100.0);
        assert_in_step(&Thread { speed, lead, reverse, taper: 0.0, ripple: (part, periods), counts });
    }
}

/// Right and left, at two places each: the spindle is turned round twice for each, and has its direction behind.
#[test]
fn cycles_tap_hole_by_hole() {
    for (code, cycle, turns) in [("M3", "G84", 1.0), ("M4", "G74", -1.0)] {
        let program = format!(
            "G21 G90\n{code} S600\nG0 X5 Z40\nG99 {cycle} X5 Z20 R38 K1.5\nX10\nG80\nG1 Z37 F1000\nM5\nM2\n"
        );
        let mut rig = Rig::new("drill", &[], &program, |_, _| ());
        let (mut lowest, mut directions) = (f64::INFINITY, Vec::new());
        while rig.step() {
            let Some(row) = rig.rows.last() else { continue };
            if row.plan.off_path {
                lowest = lowest.min(row.plan.position[2]);
            }
            let speed = row.spindle.map_or(0.0, |it| it.speed) * turns;
            if speed.abs() > 500.0 && directions.last() != Some(&(speed > 0.0)) {
                directions.push(speed > 0.0);
            }
        }
        assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
        assert_eq!(told(&rig).len(), 2);
        assert!(
            told(&rig).iter().all(|off| *off < ALLOWED),
            "{:?}",
            told(&rig)
        );
        assert!((lowest - 20.0).abs() < DEPTH, "{lowest}");
        assert_eq!(directions, [true, false, true, false, true]);
        rig.trace().assert_within_limits();
    }
}

// --- operators and faults ---

fn goes_back(rig: &Rig) -> bool {
    let row = rig.rows.last();
    row.is_some_and(|row| row.plan.off_path && row.plan.velocity[2] > 1.0)
}

/// Held in mid-tap it comes back, and holds there.
#[test]
fn a_hold_waits_until_it_is_back() {
    let mut rig = EVEN.tap_rig();
    rig.run_until(|rig| goes_back(rig));
    rig.command(Command::FeedHold);
    rig.run_until(|rig| told(rig).len() == 1);
    let until = rig.rows.len() + 300;
    rig.run_to_row(until);
    assert_eq!(rig.session.status().state, State::Held);
    let at = rig.rows.last().unwrap().plan.position[2];
    assert!((at - TOP).abs() < 1e-3, "{at}");
    rig.command(Command::Resume);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    rig.trace().assert_within_limits();
}

fn failure(rig: &mut Rig) -> ThreadFailure {
    let fault = rig.finish_with_fault();
    assert!(rig.events.contains(&Event::TapLeft { line: 4 }));
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
    match fault {
        Fault::Block(4, BlockCause::Thread(failure)) => failure,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_spindle_that_is_blocked_leaves_the_tap_and_tells_so() {
    let mut rig = EVEN.tap_rig();
    rig.run_until(|rig| goes_back(rig));
    rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    let told = match failure(&mut rig) {
        ThreadFailure::LostStep(lost) => matches!(lost, LostStep::Behind { .. }),
        ThreadFailure::NotTurning => true,
    };
    assert!(told);
}

/// It may be in the work: who resumes is told so, and nothing moves or turns before cycle start.
#[test]
fn a_tap_that_was_left_is_told_before_the_program_is_resumed() {
    let mut rig = Rig::staying_on("drill", &[], |_, _| ());
    rig.goes_on = false;
    settle(&mut rig);
    let file = rig.folder.file("part.ngc", &EVEN.tap_program());
    rig.command(Command::Load(file));
    rig.command(Command::Run { from_line: None });
    rig.run_until(|rig| goes_back(rig));
    go(&mut rig, Command::Stop);
    assert!(rig.events.contains(&Event::TapLeft { line: 4 }));
    let there = rig.rows.last().unwrap().plan.position;
    go(&mut rig, Command::Resume);
    assert_eq!(state(&rig), State::Held, "{:?}", rig.refused);
    let (_, told) = rig.messages.last().expect("a message");
    assert!(told.contains("turn one out by hand"), "{told}");
    let until = rig.rows.len() + 200;
    rig.run_to_row(until);
    let row = rig.rows.last().unwrap();
    assert_eq!(row.plan.position, there);
    assert_eq!(row.functions.spindle.turning, Turning::Off);
    go(&mut rig, Command::CycleStart);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert_eq!(self::told(&rig).len(), 1);
    assert_moves_within_limits(&mut rig);
}

/// Where the spindle goes on as before the tap goes no deeper than what `check` left room for.
#[test]
fn a_spindle_that_is_not_turned_round_is_stopped_at_the_bottom() {
    for speed in [200.0, 1500.0] {
        let thread = Thread { speed, ..EVEN };
        let mut rig = thread.tap_rig();
        let sent = CobId::r_pdo(1, NodeId::new(4).unwrap());
        let mut fastest = 0;
        rig.bus().forger = Some(Box::new(move |frames| {
            for frame in frames {
                if let [c0, c1, v0, v1, v2, v3] = *frame.data()
                    && frame.id() == sent.into()
                {
                    let velocity = i32::from_le_bytes([v0, v1, v2, v3]);
                    fastest = fastest.max(velocity);
                    // Until it is told to stand.
                    let told = if velocity == 0 { 0 } else { fastest };
                    let [v0, v1, v2, v3] = told.to_le_bytes();
                    *frame = Frame::new(sent, &[c0, c1, v0, v1, v2, v3]);
                }
            }
        }));
        let failure = failure(&mut rig);
        let told = match failure {
            ThreadFailure::LostStep(lost) => matches!(lost, LostStep::TooDeep),
            ThreadFailure::NotTurning => true,
        };
        assert!(told, "{failure:?}");
        let taps = rig.rows.iter().filter(|row| row.plan.off_path);
        let deepest = taps.map(|row| TOP - row.plan.position[2]);
        let beyond = deepest.fold(0.0, f64::max) - thread.depth();
        assert!(beyond <= BEYOND * thread.lead, "{beyond}");
    }
}

#[test]
fn what_the_axes_cannot_is_refused_when_the_program_is_checked() {
    let file = machine_file("drill");
    let machine = Machine::load(&file).unwrap();
    let programs = Programs::new(&machine, &file).unwrap();
    let tap = |text: &str| {
        let text = format!("G21 G90\nM3 S1500\n{text}\nM2\n");
        let program = programs.text("tap.ngc", text.as_bytes());
        program.check(machine.rest()).map(|_| ())
    };
    let refused = |text: &str| match tap(text).unwrap_err() {
        ProgramError::Thread { source, .. } => source,
        other => panic!("{other}"),
    };
    tap("G33.1 Z-60 K3").unwrap();
    tap("G84 Z-60 R0 F4500").unwrap();
    tap("G33.1 Z-149.2 K3").unwrap();
    let short = refused("G33.1 Z-10 K3");
    assert!(matches!(short, NoThread::TooShort { .. }), "{short}");
    let fast = refused("G33.1 Z-60 K11");
    assert!(matches!(fast, NoThread::TooFast { .. }), "{fast}");
    for deep in ["G33.1 Z-149.8 K3", "G84 Z-149.8 R0 K3"] {
        let deep = refused(deep);
        assert!(matches!(deep, NoThread::NoRoom { .. }), "{deep}");
    }
}

#[test]
fn a_second_run_sends_the_same_frames() {
    let thread = Thread {
        ripple: (0.02, 2),
        ..EVEN
    };
    let frames = || {
        let mut rig = thread.tap_rig();
        assert_eq!(rig.finish(), End::Finished);
        rig.frames()
    };
    assert_eq!(frames(), frames());
}
