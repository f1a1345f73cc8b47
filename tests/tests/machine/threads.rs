//! Threads: axes in step with a spindle whose angle its drive measures, on `examples/drill`. What is judged is where the
//! simulated tool is when the simulated rotor is where it is.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_controller::control::fault::BlockCause;
use syncline_controller::control::{End, Event, Fault, Row, State, ThreadFailure};
use syncline_controller::machine::{COORDINATES, Machine};
use syncline_controller::program::{NoThread, ProgramError, Programs};
use syncline_controller::session::{Command, Override, SwitchChange};
use syncline_drives::twin::{Config, Disturbance};
use syncline_tests::command::machine_file;
use syncline_tests::rig::Rig;
use syncline_trajectory::synchronous::LostStep;

use super::day::{assert_moves_within_limits, go, settle, state};
use super::driven_spindle::tell_spindle;

const X: usize = 0;
pub(super) const Z: usize = 2;
pub(super) const SPINDLE: usize = 3;
/// Counts in a turn that the spindle's drive has itself.
pub(super) const FINE: u32 = 1_048_576;
/// Of X and Z, mm.
const PITCHES: [f64; 2] = [10.0, 5.0];

/// What a tool may be off by, mm.
pub(super) const ALLOWED: f64 = 0.010;
/// From so long behind the ramp on, s: then the drive has come to rest after it.
pub(super) const SETTLED: f64 = 0.1;

fn drill(replacements: &[(&str, &str)], program: &str) -> Rig {
    let mut rig = Rig::new("drill", replacements, program, |_, _: &mut Config| ());
    rig.goes_on = false;
    rig
}

/// A thread, and the spindle that it is cut with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Thread {
    pub(super) speed: f64,
    pub(super) lead: f64,
    pub(super) reverse: bool,
    /// How far X goes while Z goes by 1.
    pub(super) taper: f64,
    /// Amplitude of the speed, a part of it, and periods a turn.
    pub(super) ripple: (f64, u32),
    pub(super) counts: u32,
}

pub(super) const EVEN: Thread = Thread {
    speed: 600.0,
    lead: 1.5,
    reverse: false,
    taper: 0.0,
    ripple: (0.0, 1),
    counts: FINE,
};

impl Thread {
    /// mm/s
    pub(super) fn feed(&self) -> f64 {
        self.lead * self.speed / 60.0
    }

    /// From Z40 down: a second in step, and what is needed before and behind.
    pub(super) fn length(&self) -> f64 {
        1.4 * self.feed() + 2.0
    }

    /// Which way the tool goes, in X and Z.
    pub(super) fn direction(&self) -> [f64; 2] {
        let along = self.taper.hypot(1.0);
        [self.taper / along, -1.0 / along]
    }

    pub(super) fn program(&self) -> String {
        let [x, z] = self.direction().map(|share| share * self.length());
        let code = if self.reverse { "M4" } else { "M3" };
        format!(
            "G21 G90 G61\n{code} S{}\nG0 X5 Z40\nG33 X{:.6} Z{:.6} K{}\nG0 Z45\nM5\nM2\n",
            self.speed,
            5.0 + x,
            40.0 + z,
            self.lead
        )
    }

    fn rig(&self) -> Rig {
        self.rig_for(&self.program())
    }

    /// The drive's loops have a fine encoder, and what it tells counts more coarsely.
    pub(super) fn rig_for(&self, program: &str) -> Rig {
        let (part, periods) = self.ripple;
        let load = format!("load = 0.004\nspeed_ripple = {part}\nripple_periods = {periods}");
        let counts = format!("encoder_increments = {}\nhas_resolution = 0", self.counts);
        let changes = [
            ("load = 0.004", &*load),
            ("encoder_increments = 1_048_576", &counts),
        ];
        let mut rig = Rig::new("drill", &changes, program, |drive, config| {
            if drive == SPINDLE {
                let mut assumed = config.assumed.iter_mut();
                let counts = assumed.find(|(name, _)| *name == "encoder_increments");
                counts.unwrap().1 = FINE;
            }
        });
        rig.goes_on = false;
        let each = (FINE / self.counts) as i32;
        tell_spindle(&mut rig, move |count| count.div_euclid(each));
        rig
    }

    /// The way to rest, mm, and what the axes lag behind their setpoints.
    pub(super) fn run_out(&self) -> f64 {
        let (v, a, j) = (self.feed(), 2000.0, 50_000.0);
        v * (v / a + a / j + 0.010)
    }

    /// By how much the tool is out of step now, mm, and for how long it has been along, s.
    pub(super) fn off(&self, rig: &mut Rig) -> f64 {
        let [x, z] = [X, Z].map(|axis| rig.twin(axis).observe());
        let spindle = rig.twin(SPINDLE).observe();
        // The twins were stepped last at instants of their own.
        let at = |it: syncline_drives::twin::Observation| it.at.unwrap().as_nanos() as f64 * 1e-9;
        let now = at(z);
        let there =
            |it: syncline_drives::twin::Observation| it.position + it.velocity * (now - at(it));
        let place = [PITCHES[0] * there(x) - 5.0, PITCHES[1] * there(z) - 40.0];
        let direction = self.direction();
        let along = place[0] * direction[0] + place[1] * direction[1];
        let turns = if self.reverse {
            -there(spindle)
        } else {
            there(spindle)
        };
        let off = along - self.lead * turns;
        // Where it begins is any whole turn.
        off - (off / self.lead).round() * self.lead
    }

    /// Goes on to the thread's end: by how much the tool was out of step at most, mm, in how many samples.
    fn cut(&self, rig: &mut Rig) -> (f64, usize) {
        let (mut worst, mut samples, mut since) = (0.0_f64, 0, None);
        while rig.step() {
            let Some(row) = rig.rows.last() else { continue };
            let (plan, at) = (row.plan, row.at.as_nanos() as f64 * 1e-9);
            if !plan.off_path || plan.speed < 0.9 * self.feed() {
                continue;
            }
            let since = *since.get_or_insert(at);
            let [x, z] = self.direction();
            let along = x * (plan.position[0] - 5.0) + z * (plan.position[2] - 40.0);
            let left = self.length() - along;
            if at - since > SETTLED && left > self.run_out() {
                worst = worst.max(self.off(rig).abs());
                samples += 1;
            }
        }
        (worst, samples)
    }
}

pub(super) fn told(rig: &Rig) -> Vec<f64> {
    let threads = rig.events.iter().filter_map(|event| match event {
        Event::Threaded { off, .. } => *off,
        _ => None,
    });
    threads.collect()
}

/// Cuts it: within what is allowed, within the limits, from a whole turn of the spindle on.
fn assert_in_step(thread: &Thread) -> f64 {
    let mut rig = thread.rig();
    let (worst, samples) = thread.cut(&mut rig);
    assert_eq!(
        rig.end(),
        Some(End::Finished),
        "{thread:?}: {:?}",
        rig.events
    );
    assert!(samples > 400, "{thread:?}: {samples}");
    assert!(worst <= ALLOWED, "{thread:?}: {:.2} µm", 1e3 * worst);
    assert_eq!(told(&rig).len(), 1);
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
    worst
}

// --- in step ---

pub(super) const RIPPLES: [(f64, u32); 4] = [(0.0, 1), (0.02, 1), (0.02, 2), (0.02, 3)];

#[test]
fn the_tool_is_in_step_with_an_uneven_spindle_and_a_coarse_encoder() {
    for speed in [100.0, 300.0, 1500.0] {
        for ripple in RIPPLES {
            let counts = 4096;
            let lead = 3.0;
            assert_in_step(&Thread {
                speed,
                lead,
                ripple,
                counts,
                ..EVEN
            });
        }
    }
}

/// The table of `docs/measured.md`.
#[test]
#[ignore = "a minute; prints"]
fn how_far_out_of_step_threads_are() {
    for counts in [4096, FINE] {
        for lead in [0.5, 1.5, 3.0] {
            for speed in [100.0, 300.0, 700.0, 1000.0, 1500.0] {
                let worst = RIPPLES.map(|ripple| {
                    1e3 * assert_in_step(&Thread {
                        speed,
                        lead,
                        ripple,
                        counts,
                        ..EVEN
                    })
                });
                println!("| {counts} | {lead} | {speed} | {worst:.1?} |");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// Either way round, straight and tapered.
    #[test]
    fn any_thread_is_in_step(
        speed in 100.0..1500.0f64, lead in 0.5..3.0f64, reverse in any::<bool>(),
        taper in select(vec![0.0, 0.0, 0.0625, 1.0, -1.0]), part in 0.0..0.02f64, periods in 1..4u32,
        counts in select(vec![4096, 65_536, FINE]),
    ) {
        let (speed, lead) = ((speed * 10.0).round() / 10.0, (lead * 100.0).round() / 100.0);
        assert_in_step(&Thread { speed, lead, reverse, taper, ripple: (part, periods), counts });
    }
}

#[test]
fn passes_of_other_speeds_and_from_whole_leads_on_meet_the_same_thread() {
    let program = "G21 G90 G61\nM3 S600\nG0 X5 Z40\nG33 Z0 K1.5\nG0 X6\nG0 Z43\nG0 X5\nS750\nG33 Z0 K1.5\nM5\nM2\n";
    let mut rig = drill(&[], program);
    let mut worst = [0.0_f64; 2];
    while rig.step() {
        let Some(row) = rig.rows.last() else { continue };
        let line = row.rests_for;
        let pass = match line {
            Some(4) => 0,
            Some(9) => 1,
            _ => continue,
        };
        if row.plan.off_path && (10.0..25.0).contains(&row.plan.position[2]) {
            worst[pass] = worst[pass].max(EVEN.off(&mut rig).abs());
        }
    }
    assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
    for worst in worst {
        assert!(worst > 0.0 && worst < ALLOWED, "{worst}");
    }
}

/// The passes of a cycle meet the same thread: at the spindle's same angle within 0.05°.
#[test]
fn the_passes_of_a_cycle_begin_at_the_same_angle() {
    let program = "G21 G90 G18\nM3 S600\nG0 X8 Z40\nG76 P1.5 Z10 I-1 J0.2 K0.6 H1\nM5\nM2\n";
    for counts in [4096, FINE] {
        let thread = Thread { counts, ..EVEN };
        let mut rig = thread.rig_for(program);
        let mut passes = [(0.0, 0.0); 4];
        while rig.step() {
            let pass = told(&rig).len();
            let plan = rig.rows.last().map(|row| row.plan);
            if plan.is_some_and(|it| it.off_path && (15.0..30.0).contains(&it.position[2])) {
                passes[pass].0 += thread.off(&mut rig);
                passes[pass].1 += 1.0;
            }
        }
        assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
        assert_eq!(told(&rig).len(), 4);
        let angles = passes.map(|(off, samples)| off / samples / thread.lead * 360.0);
        let (least, most) = (angles.into_iter()).fold((f64::MAX, f64::MIN), |(least, most), it| {
            (least.min(it), most.max(it))
        });
        assert!(most - least < 0.05, "{angles:?}");
        rig.trace().assert_within_limits();
    }
}

#[test]
fn a_second_run_sends_the_same_frames() {
    let thread = Thread {
        ripple: (0.02, 2),
        ..EVEN
    };
    let frames = || {
        let mut rig = thread.rig();
        assert_eq!(rig.finish(), End::Finished);
        rig.frames()
    };
    assert_eq!(frames(), frames());
}

// --- operators ---

/// What is commanded in mid-thread changes nothing before its end.
#[test]
fn hold_override_and_single_block_wait_for_the_end() {
    let positions = |rig: &Rig| -> Vec<f64> {
        let on_thread = rig.rows.iter().filter(|row| row.plan.off_path);
        on_thread.map(|row| row.plan.position[2]).collect()
    };
    let mut plain = EVEN.rig();
    assert_eq!(plain.finish(), End::Finished);
    for command in [
        Command::FeedHold,
        Command::FeedOverride(Override::To(0.0)),
        Command::SingleBlock(SwitchChange::To(true)),
    ] {
        let mut rig = EVEN.rig();
        rig.run_until(|rig| {
            rig.rows
                .last()
                .is_some_and(|row| row.plan.speed > 14.0 && row.plan.off_path)
        });
        rig.command(command.clone());
        rig.command(Command::Retrace);
        rig.run_until(|rig| told(rig).len() == 1);
        assert_eq!(rig.refused.len(), 1, "{:?}", rig.refused);
        assert_eq!(positions(&rig), positions(&plain), "{command:?}");
        // What comes next is a rapid, which no feed override holds.
        if !matches!(command, Command::FeedOverride(_)) {
            let until = rig.rows.len() + 300;
            rig.run_to_row(until);
            let at = rig.rows.last().unwrap().plan.position[2];
            let end = 40.0 - EVEN.length();
            assert!((at - end).abs() < 1e-5, "{command:?}: {at}");
            rig.command(Command::SingleBlock(SwitchChange::To(false)));
            rig.command(Command::Resume);
        }
        assert_eq!(rig.finish(), End::Finished, "{command:?}: {:?}", rig.events);
        rig.trace().assert_within_limits();
    }
}

/// Between two threads there is no path that could lead back: it holds before the second one.
#[test]
fn a_retrace_just_before_it_begins_holds_there() {
    let program = "G21 G90 G61\nM3 S600\nG0 X5 Z40\nG33 Z30 K1.5\nG33 Z20 K1.5\nM5\nM2\n";
    let (mut held, mut late) = (0, 0);
    for wake_ups in 0..8 {
        let mut rig = drill(&[], program);
        rig.run_until(|rig| told(rig).len() == 1);
        for _ in 0..wake_ups {
            rig.step();
        }
        rig.command(Command::Retrace);
        let until = rig.rows.len() + 100;
        rig.run_to_row(until);
        if rig.refused.is_empty() {
            let state = rig.session.status().state;
            assert_eq!(state, State::Held, "{wake_ups}");
            assert!(rig.events.contains(&Event::NoWayBack), "{wake_ups}");
            held += 1;
            rig.command(Command::Resume);
        } else {
            late += 1;
        }
        assert_eq!(rig.finish(), End::Finished, "{wake_ups}: {:?}", rig.events);
        assert_eq!(told(&rig).len(), 2, "{wake_ups}");
    }
    assert!(held > 1 && late > 2, "{held} {late}");
}

/// At 60 1/min it waits long enough for a hold before it sets off.
#[test]
fn a_hold_before_it_sets_off_holds_there() {
    let slow = Thread {
        speed: 60.0,
        lead: 1.0,
        ..EVEN
    };
    let mut rig = slow.rig();
    rig.run_until(|rig| rig.rows.last().is_some_and(|row| row.plan.off_path));
    rig.command(Command::FeedHold);
    let until = rig.rows.len() + 2000;
    rig.run_to_row(until);
    let row = rig.rows.last().unwrap();
    assert!((row.plan.position[2] - 40.0).abs() < 1e-3 && !row.plan.off_path);
    assert_eq!(rig.session.status().state, State::Held);
    rig.command(Command::Resume);
    let (worst, samples) = slow.cut(&mut rig);
    assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
    assert!(samples > 400 && worst < ALLOWED, "{worst}");
}

/// A stop brings the axes to rest on their line; the program is resumed, and cuts the thread anew.
#[test]
fn a_stop_in_mid_thread_leaves_no_line_and_the_program_cuts_it_anew() {
    let thread = Thread { taper: 1.0, ..EVEN };
    let mut rig = Rig::staying_on("drill", &[], |_, _| ());
    rig.goes_on = false;
    settle(&mut rig);
    let file = rig.folder.file("part.ngc", &thread.program());
    rig.command(Command::Load(file));
    rig.command(Command::Run { from_line: None });
    rig.run_until(|rig| {
        let row = rig.rows.last();
        row.is_some_and(|row| row.plan.off_path && row.plan.position[2] < 35.0)
    });
    rig.command(Command::Stop);
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert_on_line(&rig, &thread);
    assert_eq!(rig.session.status().interrupted, Some(4));
    go(&mut rig, Command::Resume);
    assert_eq!(state(&rig), State::Held, "{:?}", rig.refused);
    go(&mut rig, Command::CycleStart);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert_eq!(told(&rig).len(), 1);
    assert_eq!(rig.session.status().setpoint[2], 45.0);
    assert_moves_within_limits(&mut rig);
}

/// X and Z of all setpoints off the path lie on the thread's line.
fn assert_on_line(rig: &Rig, thread: &Thread) {
    let off = |row: &&Row<COORDINATES>| row.plan.off_path;
    for row in rig.rows.iter().filter(off) {
        let [x, z] = [row.plan.position[0] - 5.0, row.plan.position[2] - 40.0];
        let [along, across] = thread.direction();
        let beside = (x * across - z * along).abs();
        assert!(beside < 0.02, "{beside} mm beside its line at {x}, {z}");
    }
}

// --- what cannot be ---

fn failure(rig: &mut Rig) -> ThreadFailure {
    let fault = rig.finish_with_fault();
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
    match fault {
        Fault::Block(line, BlockCause::Thread(failure)) => {
            assert_eq!(line, 4);
            failure
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_spindle_faster_than_the_axis_is_a_stop_with_the_reason() {
    let thread = Thread {
        speed: 300.0,
        lead: 3.0,
        ..EVEN
    };
    // 15 mm/s are within the limit, and what ripples is beyond.
    let changes = [
        ("load = 0.004", "load = 0.004\nspeed_ripple = 0.06"),
        ("max_velocity = 250.0", "max_velocity = 15.4"),
        ("tolerance = 0.03", "tolerance = 0.2"),
    ];
    let mut rig = drill(&changes, &thread.program());
    let failure = failure(&mut rig);
    let ThreadFailure::LostStep(LostStep::TooFast { wanted, allowed }) = failure else {
        panic!("{failure:?}");
    };
    assert!(allowed == 15.4 && wanted > allowed, "{wanted}");
}

/// From the middle of the thread on the spindle is seen to turn by ever another part of its speed, up to one.
fn seen_to_change(rig: &mut Rig, each: f64, ends_at: f64) {
    rig.run_until(|rig| {
        let row = rig.rows.last();
        row.is_some_and(|row| row.plan.off_path && row.plan.position[2] < 35.0)
    });
    let (mut before, mut shown, mut speed) = (None, 0.0, 1.0_f64);
    tell_spindle(rig, move |count| {
        let by = before.map_or(0, |before: i32| count.wrapping_sub(before));
        if before.replace(count).is_none() {
            shown = f64::from(count);
        }
        speed += (ends_at - speed).clamp(-each, each);
        shown += speed * f64::from(by);
        shown as i32
    });
}

/// So gently that the axes could follow: to rest, or to the other side.
#[test]
fn a_spindle_that_slows_down_to_rest_stops_the_axes() {
    for ends_at in [0.0, -0.5] {
        let mut rig = EVEN.rig();
        seen_to_change(&mut rig, 0.01, ends_at);
        let failure = failure(&mut rig);
        assert_eq!(failure, ThreadFailure::NotTurning);
        assert_on_line(&rig, &EVEN);
    }
}

/// It is followed up to what the axes can, and the reason is that, not that it turns as nobody told it.
#[test]
fn a_spindle_that_runs_away_is_too_fast() {
    let changes = [("max_velocity = 250.0", "max_velocity = 27.0")];
    let mut rig = drill(&changes, &EVEN.program());
    seen_to_change(&mut rig, 0.002, 3.0);
    let failure = failure(&mut rig);
    let ThreadFailure::LostStep(LostStep::TooFast { wanted, allowed }) = failure else {
        panic!("{failure:?}");
    };
    assert!(allowed == 27.0 && wanted > allowed, "{wanted}");
    assert_on_line(&rig, &EVEN);
}

/// A hold waits for a thread's end; somebody at an open door does not.
#[test]
fn a_door_that_is_opened_in_a_thread_stops_the_machine() {
    let door = "[[input]]\nname = \"door\"\ndrive = \"X\"\nsignal = \"DI3\"\nfunction = \"door\"\n\n[machine]\n";
    let mut rig = drill(&[("[machine]\n", door)], &EVEN.program());
    rig.run_until(|rig| {
        let row = rig.rows.last();
        row.is_some_and(|row| row.plan.off_path && row.plan.position[2] < 35.0)
    });
    let from = rig.rows.last().unwrap().plan.position[2];
    rig.twin(0).disturb(Disturbance::Input(3, true));
    assert_eq!(rig.finish(), End::Interrupted, "{:?}", rig.events);
    assert!(rig.ends_at_rest());
    let rests = rig.rows.last().unwrap().plan.position[2];
    // From 15 mm/s, by the axis' limits, and the cycles until the input is seen.
    assert!((rests..rests + 1.0).contains(&from), "{from} {rests}");
    assert_on_line(&rig, &EVEN);
}

/// As long as it takes to come in step and to rest, and no longer.
#[test]
fn of_a_thread_that_is_too_short_nobody_says_how_well_it_is_in_step() {
    let program = "G21 G90 G61\nM3 S600\nG0 X5 Z40\nG33 Z38.9 K1.5\nG0 Z45\nM5\nM2\n";
    let mut rig = drill(&[], program);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert!(told(&rig).is_empty());
    let cut = |event: &Event| matches!(event, Event::Threaded { off: None, .. });
    assert!(rig.events.iter().any(cut), "{:?}", rig.events);
}

#[test]
fn a_spindle_that_is_blocked_stops_the_axes() {
    let mut rig = EVEN.rig();
    rig.run_until(|rig| {
        let row = rig.rows.last();
        row.is_some_and(|row| row.plan.off_path && row.plan.position[2] < 35.0)
    });
    rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    let failure = failure(&mut rig);
    let behind = matches!(failure, ThreadFailure::LostStep(LostStep::Behind { .. }));
    assert!(behind, "{failure:?}");
    assert_on_line(&rig, &EVEN);

    // Before it sets off.
    let program = "M3 S600\nG1 X5 F1000\nG4 P1\nG33 Z-20 K1.5\nM2\n";
    let mut rig = drill(&[], program);
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.plan.position[0] > 4.99)
    });
    rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    assert_eq!(self::failure(&mut rig), ThreadFailure::NotTurning);
}

/// One T_PDO that is lost is bridged by what is known of the spindle.
#[test]
fn a_lost_t_pdo_takes_nothing_out_of_step() {
    let thread = Thread {
        ripple: (0.02, 1),
        ..EVEN
    };
    let mut rig = thread.rig();
    rig.run_until(|rig| {
        let row = rig.rows.last();
        row.is_some_and(|row| row.plan.off_path && row.plan.position[2] < 35.0)
    });
    rig.twin(SPINDLE).disturb(Disturbance::LoseTPdos(1));
    let (worst, _) = thread.cut(&mut rig);
    assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
    assert!(worst < ALLOWED, "{worst}");
}

fn checked(file: &std::path::Path, text: &str) -> Result<(), ProgramError> {
    let machine = Machine::load(file).unwrap();
    let programs = Programs::new(&machine, file).unwrap();
    let program = programs.text("thread.ngc", text.as_bytes());
    program.check(machine.rest()).map(|_| ())
}

#[test]
fn what_the_axes_cannot_is_refused_when_the_program_is_checked() {
    let drill = machine_file("drill");
    let thread = |text: &str| checked(&drill, &format!("G21 G90\nM3 S3000\n{text}\nM2\n"));
    thread("G33 Z-60 K4.9").unwrap();
    let ProgramError::Thread { source, place } = thread("G33 Z-60 K5.1").unwrap_err() else {
        panic!("no thread");
    };
    assert_eq!(place, "thread.ngc:3:1");
    let fast = matches!(source, NoThread::TooFast { most, .. } if most == 2941.0);
    assert!(fast, "{source}");
    // In 26 mm it is in step at S, and not at what the spindle may be faster.
    thread("G33 Z-28 K4").unwrap();
    for short in ["G33 Z-3 K4", "G33 Z-26 K4"] {
        let ProgramError::Thread { source, .. } = thread(short).unwrap_err() else {
            panic!("no thread");
        };
        assert!(matches!(source, NoThread::TooShort { .. }), "{source}");
    }
}

/// Without a spindle whose angle is measured: by name.
#[test]
fn without_a_master_it_is_refused_by_name() {
    let text = "G21 G90\nM3 S300\nG33 Z-30 K1\nM2\n";
    let told = checked(&machine_file("portal"), text)
        .unwrap_err()
        .to_string();
    assert!(
        told.contains("G33 needs a spindle whose angle is measured"),
        "{told}"
    );
}

// --- whatever comes ---

#[derive(Clone, Copy, Debug)]
enum Interference {
    Command(usize),
    Lost(usize),
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// Whatever is commanded or lost at whatever instant: the axes keep their limits and come to rest.
    #[test]
    fn whatever_comes_the_axes_keep_their_limits(
        reverse in any::<bool>(), taper in select(vec![0.0, 0.5]), speed in 200.0..1500.0f64,
        row in 150..900usize,
        what in prop_oneof![(0..6usize).prop_map(Interference::Command), (0..4usize).prop_map(Interference::Lost)],
    ) {
        let thread = Thread { reverse, taper, speed: speed.round(), ..EVEN };
        let mut rig = thread.rig();
        rig.goes_on = true;
        rig.run_to_row(row);
        match what {
            Interference::Command(which) => {
                let commands = [
                    Command::FeedHold, Command::Stop, Command::FeedOverride(Override::To(30.0)),
                    Command::SingleBlock(SwitchChange::To(true)), Command::Retrace, Command::RapidOverride(Override::To(10.0)),
                ];
                rig.command(commands[which].clone());
            }
            Interference::Lost(which) => {
                let lost = [
                    Disturbance::Block(true), Disturbance::Mute(true), Disturbance::LoseTPdos(1),
                    Disturbance::Mains(false),
                ];
                rig.twin(SPINDLE).disturb(lost[which]);
            }
        }
        for _ in 0..6000 {
            if !rig.step() {
                break;
            }
            let held = rig.session.status().state == State::Held;
            if held {
                rig.command(Command::Resume);
            }
        }
        rig.trace().assert_within_limits();
        if rig.end().is_some() {
            prop_assert!(rig.ends_at_rest());
        }
    }
}
