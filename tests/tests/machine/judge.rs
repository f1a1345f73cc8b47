//! The verdict trusts nobody whom it judges: what is planted between plan and drives, it finds.

use proptest::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;
use syncline_canopen::{CobId, Frame, NodeId};
use syncline_controller::control::fault::AxisCause;
use syncline_controller::control::{Controller, Fault, Layout, Order, Phase, Quantity};
use syncline_controller::machine::{COORDINATES, Machine};
use syncline_controller::observe::Observers;
use syncline_controller::observe::summary::Summary;
use syncline_controller::program::Program;
use syncline_controller::run::virtual_time::VirtualMachine;
use syncline_controller::run::{CycleReport, Progress, RunError, Timeline, Work};
use syncline_controller::session::Session;
use syncline_tests::command::{Folder, machine_with};
use syncline_tests::rig::{Forger, PORTAL_PROGRAM, Rig};

/// Node ids of the portal's drives.
const X1: u8 = 1;
const X2: u8 = 2;
const Y: u8 = 3;
const Z: u8 = 4;

/// A row of [`PORTAL_PROGRAM`] in which all axes are on their way.
const IN_MOTION: usize = 100;

/// The setpoint in a frame of an LXM32M, which has the controlword before it.
fn position(frame: &Frame) -> i32 {
    let bytes = frame.data()[2..].try_into().expect("an R_PDO2");
    i32::from_le_bytes(bytes)
}

/// Another setpoint into the burst's frame for a node.
fn forge(frames: &mut [Frame], node: u8, other: impl FnOnce(i32) -> i32) {
    let id = CobId::r_pdo(2, NodeId::new(node).expect("a node"));
    let frame = frames.iter_mut().find(|frame| frame.id() == id.into());
    let frame = frame.expect("in every burst");
    let [c0, c1, ..] = *frame.data() else {
        panic!("an R_PDO2 of {} bytes", frame.data().len());
    };
    let [p0, p1, p2, p3] = other(position(frame)).to_le_bytes();
    *frame = Frame::new(id, &[c0, c1, p0, p1, p2, p3]);
}

/// Forges the next burst alone.
fn once(mut forger: impl FnMut(&mut Vec<Frame>) + Send + 'static) -> Forger {
    let mut next = true;
    Box::new(move |frames| {
        if std::mem::take(&mut next) {
            forger(frames);
        }
    })
}

/// The verdict where bursts behind a row of [`PORTAL_PROGRAM`] are forged.
fn forged(row: usize, forger: Forger) -> Summary {
    let mut rig = Rig::portal(PORTAL_PROGRAM);
    rig.run_to_row(row);
    rig.bus().forger = Some(forger);
    rig.judge()
}

/// The violations of an axis.
fn found<'a>(summary: &'a Summary, axis: &str) -> Vec<&'a str> {
    let of =
        |it: &&syncline_controller::observe::record::Violation| it.axis.as_deref() == Some(axis);
    let found = summary.violations.iter().filter(of);
    found.map(|it| it.what.as_str()).collect()
}

/// That a forgery is found, of this axis by each of these.
fn assert_found(summary: &Summary, axis: &str, what: &[&str]) {
    let found = found(summary, axis);
    assert_eq!(summary.verdict, "fail");
    for what in what {
        assert!(found.contains(what), "no {what}: {:#?}", summary.violations);
    }
}

#[test]
fn what_is_sent_as_planned_passes() {
    let summary = Rig::portal(PORTAL_PROGRAM).judge();
    assert_eq!(summary.verdict, "pass", "{:#?}", summary.violations);
}

#[test]
fn one_setpoint_repeated() {
    let mut last = None;
    let mut bursts = 0;
    let summary = forged(
        IN_MOTION,
        Box::new(move |frames| {
            bursts += 1;
            forge(frames, Y, |of| {
                let before = last.replace(of);
                if bursts == 2 {
                    before.expect("one before")
                } else {
                    of
                }
            });
        }),
    );
    let what = ["sent jerk", "sent acceleration", "sent off the plan"];
    assert_found(&summary, "Y", &what);
}

#[test]
fn one_setpoint_two_increments_off() {
    for off in [1, 2, -2] {
        let summary = forged(
            IN_MOTION,
            once(move |frames| forge(frames, Z, |of| of + off)),
        );
        assert_found(&summary, "Z", &["sent off the plan"]);
    }
}

#[test]
fn one_setpoint_twenty_increments_off() {
    let summary = forged(IN_MOTION, once(|frames| forge(frames, Z, |of| of + 20)));
    assert_found(&summary, "Z", &["sent jerk", "sent off the plan"]);
}

#[test]
fn a_frame_that_one_axis_does_not_get() {
    let summary = forged(
        IN_MOTION,
        once(|frames| {
            let id = CobId::r_pdo(2, NodeId::new(Y).expect("a node"));
            frames.retain(|frame| frame.id() != id.into());
        }),
    );
    assert_found(&summary, "Y", &["sent jerk", "sent off the plan"]);
}

/// Has every setpoint of a node from now on made of the first and of the distance from it.
fn each(node: u8, other: impl Fn(i32) -> i32 + Send + 'static) -> Forger {
    let mut first = None;
    Box::new(move |frames| {
        forge(frames, node, |of| {
            let first = *first.get_or_insert(of);
            first + other(of - first)
        });
    })
}

#[test]
fn an_axis_that_goes_the_other_way() {
    let summary = forged(0, each(Y, |way| -way));
    assert_found(&summary, "Y", &["sent off the plan"]);
}

#[test]
fn a_scale_off_by_a_thousandth() {
    let summary = forged(0, each(Y, |way| (f64::from(way) * 1.001).round() as i32));
    assert_found(&summary, "Y", &["sent off the plan"]);
    // The drives follow it, and the plan is on its path: nobody else can tell.
    assert!(!found(&summary, "Y").contains(&"following_error"));
}

#[test]
fn two_axes_exchanged() {
    let mut first: Option<BTreeMap<u8, i32>> = None;
    let summary = forged(
        0,
        Box::new(move |frames| {
            let mut now = BTreeMap::new();
            for node in [Y, Z] {
                forge(frames, node, |of| {
                    now.insert(node, of);
                    of
                });
            }
            let first = first.get_or_insert_with(|| now.clone());
            for (node, from) in [(Y, Z), (Z, Y)] {
                forge(frames, node, |_| first[&node] + now[&from] - first[&from]);
            }
        }),
    );
    assert_found(&summary, "Y", &["sent off the plan"]);
    assert_found(&summary, "Z", &["sent off the plan"]);
}

#[test]
fn setpoints_a_cycle_late() {
    let mut before: BTreeMap<u8, i32> = BTreeMap::new();
    let mut rig = Rig::portal(PORTAL_PROGRAM);
    rig.run_to(Phase::ModeStart);
    rig.bus().forger = Some(Box::new(move |frames| {
        for node in [X1, X2, Y, Z] {
            forge(frames, node, |of| before.insert(node, of).unwrap_or(of));
        }
    }));
    let summary = rig.judge();
    for axis in ["X", "Y", "Z"] {
        assert_found(&summary, axis, &["sent off the plan"]);
        assert!(
            !found(&summary, axis).contains(&"sent jerk"),
            "it is inside its limits"
        );
    }
}

#[test]
fn rounding_towards_zero() {
    let mut good = Rig::portal(PORTAL_PROGRAM);
    good.finish();
    let increment = good.machine.drives[2].scaling.resolution();
    let planned: Vec<f64> = good
        .rows
        .iter()
        .map(|row| row.plan.position[1] / increment)
        .collect();
    // The burst for the row behind the one that is seen first has left.
    let mut row = 1;
    let summary = forged(
        0,
        Box::new(move |frames| {
            row += 1;
            if let Some(planned) = planned.get(row) {
                forge(frames, Y, |of| {
                    of + (planned.trunc() - planned.round()) as i32
                });
            }
        }),
    );
    assert_found(&summary, "Y", &["sent off the plan"]);
}

#[test]
fn a_step_over_a_soft_limit() {
    // X rests where it stands at first, on its limit.
    let program = "G0 Y100\nG4 P0.2\nM2\n";
    for (off, beyond) in [(0, false), (40, false), (-40, true)] {
        let mut rig = Rig::portal(program);
        rig.run_to_row(60);
        rig.bus().forger = Some(once(move |frames| forge(frames, X1, |of| of + off)));
        let found = found(&rig.judge(), "X").contains(&"sent beyond soft_limits");
        assert_eq!(found, beyond, "{off}");
    }
}

#[test]
fn a_gantry_whose_sides_part() {
    let mut cycles = 0;
    let summary = forged(
        IN_MOTION,
        Box::new(move |frames| {
            cycles += 1;
            forge(frames, X2, |of| of + (cycles / 10).min(30));
        }),
    );
    assert_found(&summary, "X", &["sent off the plan"]);
    assert!(
        !found(&summary, "X").contains(&"sent jerk"),
        "it is inside its limits"
    );
}

#[test]
fn a_setpoint_that_leaps_before_the_program_begins() {
    let mut good = Rig::portal(PORTAL_PROGRAM);
    let mut steps = 0;
    good.run_until(|rig| {
        steps += 1;
        rig.controller().phase() == Phase::Program
    });
    // Just before the burst that the first row latches.
    let mut rig = Rig::portal(PORTAL_PROGRAM);
    rig.run_until(|_| {
        steps -= 1;
        steps == 1
    });
    rig.bus().forger = Some(Box::new(|frames| forge(frames, Z, |of| of - 2000)));
    assert_found(&rig.judge(), "Z", &["sent off the frozen setpoint"]);
}

/// A machine whose rows are mended before anybody sees them: no jerk is told above a limit.
struct Mended {
    machine: VirtualMachine,
    most: f64,
}

impl Timeline for Mended {
    fn prepare(&mut self, work: Work) {
        self.machine.prepare(work);
    }

    fn order(&mut self, number: u64, order: Order) {
        self.machine.order(number, order);
    }

    fn advance(&mut self, report: &mut dyn FnMut(CycleReport)) -> Result<Progress, RunError> {
        let most = self.most;
        self.machine.advance(&mut |it| {
            report(match it {
                CycleReport::Row(mut row) => {
                    let jerk = &mut row.plan.jerk;
                    *jerk = jerk.map(|jerk| jerk.clamp(-most, most));
                    CycleReport::Row(row)
                }
                other => other,
            });
        })
    }
}

/// A machine, and the same one with half as much jerk again; the folder's file is of the second.
fn judge_and_planner(folder: &Folder) -> [Machine; 2] {
    ["max_jerk = 40_000.0", "max_jerk = 60_000.0"].map(|jerk| {
        let text = machine_with("xyz", &[("max_jerk = 40_000.0", jerk)]);
        Machine::load(&folder.file("machine.toml", &text)).expect("a machine")
    })
}

#[test]
fn a_plan_with_half_as_much_jerk_again_that_denies_it() {
    let folder = Folder::new();
    let [judge, planner] = judge_and_planner(&folder);
    let file = folder.path("machine.toml");
    let program = folder.file("p.ngc", "G0 Z-40\nG0 Z0\nM2\n");
    for (plans, verdict) in [(&judge, "pass"), (&planner, "fail")] {
        let program = Program::new(&program, plans, &file).expect("no tables");
        // The controller's own guard knows no better than the planner.
        let layout = Arc::new(Layout::new(plans).expect("it fits"));
        let (timeline, moves) =
            VirtualMachine::new(&judge, Arc::clone(&layout), program, 0).expect("simulated");
        let sent = timeline.frames().listen(&judge);
        let observers = Observers::new(&judge, Some(sent), None, false);
        let timeline = Mended {
            machine: timeline,
            most: 40_000.0,
        };
        let mut session = Session::new(&layout, timeline, moves, observers);
        while session.advance() != Progress::Ended {}
        let (mut timeline, observers) = session.end();
        let controller: &Controller<COORDINATES> = timeline.machine.controller();
        let (summary, _) = observers
            .finish(&judge, &layout, controller, None)
            .expect("no trace");
        assert_eq!(summary.verdict, verdict, "{:#?}", summary.violations);
        if verdict == "fail" {
            assert_found(&summary, "Z", &["jerk", "sent jerk"]);
        }
    }
}

/// The controller, too, is asked last: what a planner of greater limits wants is not sent.
#[test]
fn a_setpoint_beyond_the_limits_is_not_sent() {
    let folder = Folder::new();
    let [judge, planner] = judge_and_planner(&folder);
    let file = folder.path("machine.toml");
    let program = folder.file("p.ngc", "G0 Z-40\nG0 Z0\nM2\n");
    let program = Program::new(&program, &planner, &file).expect("no tables");
    let layout = Arc::new(Layout::new(&judge).expect("it fits"));
    let (timeline, moves) =
        VirtualMachine::new(&judge, Arc::clone(&layout), program, 0).expect("simulated");
    let sent = timeline.frames().listen(&judge);
    let observers = Observers::new(&judge, Some(sent), None, false);
    let mut session = Session::new(&layout, timeline, moves, observers);
    while session.advance() != Progress::Ended {}
    let (mut timeline, observers) = session.end();
    let faults = timeline.controller().faults();
    let [Fault::Axis(_, AxisCause::SetpointGuard { quantity, .. })] = faults[..] else {
        panic!("{faults:?}");
    };
    assert_eq!(quantity, Quantity::Jerk);
    let (summary, _) = observers
        .finish(&judge, &layout, timeline.controller(), None)
        .expect("no trace");
    let what: Vec<_> = summary.violations.iter().map(|it| &*it.what).collect();
    assert!(
        !what.iter().any(|what| what.starts_with("sent")),
        "{what:?}"
    );
}

/// A move that is over within a few cycles has done what its differences say.
#[test]
fn the_maxima_of_a_tiny_move_are_true() {
    for way in ["0.003", "0.0004", "0.03"] {
        let program = format!("G1 X{way} F6000\nM2\n");
        let mut rig = Rig::new("xyz", &[], &program, |_, _| ());
        while rig.step() {}
        let trace = rig.trace();
        let loads = trace.loads();
        let summary = rig.judge();
        let x = &summary
            .axes
            .iter()
            .find(|axis| axis.name == "X")
            .expect("an axis");
        let told = [
            x.max_velocity / x.velocity_limit,
            x.max_acceleration / x.acceleration_limit,
            x.max_jerk / x.jerk_limit,
        ];
        for (told, load) in told.into_iter().zip(loads) {
            assert!(load > 0.0, "{way}: nothing moves");
            assert!(
                told >= load * (1.0 - 1e-3) && told <= 1.0 + 1e-9,
                "{way}: {told} {load}"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Whatever one setpoint of a drive in motion is changed by, it is found.
    #[test]
    fn any_change_of_any_setpoint_is_found(
        row in 1usize..900, drive in 0usize..4, off in prop_oneof![1i32..40, -40..-1i32],
    ) {
        let node = [X1, X2, Y, Z][drive];
        let summary = forged(row, once(move |frames| forge(frames, node, |of| of + off)));
        assert_found(&summary, ["X", "X", "Y", "Z"][drive], &["sent off the plan"]);
    }
}
