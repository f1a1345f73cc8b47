//! A whole working day through the session: cold start, homing of a gantry that stands askew, touching off, typed lines, a
//! program that is held and jogged away from, a fault, the way back into the program, an offset that is set in a pause,
//! another program, off. Each step is held against what a
//! person sees of it (status and events) and against what the plants behind the simulated drives did.

use super::{
    assert_moves_within_limits, at, console_on_a_terminal, go, offset_of, positions, settle, state,
    work,
};
use crate::homing::truth;
use crate::replayed;
use std::path::Path;
use std::thread;
use std::time::Duration;
use syncline_controller::control::{Event, HomingFailure, State};
use syncline_controller::session::{
    self, Accepted, Command, Direction, Jog, Override, Refusal, Status, Subscription,
};
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_gcode::{AxisLetter, Tables, Turning};
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::Rig;
use syncline_tests::terminal::Terminal;

/// An axis that is homed by switches, as keys of its table, and the switches.
struct Homed {
    /// Its drives, as the file of the machine names them.
    drives: &'static [&'static str],
    /// Where it stands when it is switched on.
    start: f64,
    /// By how much its second drive stands further then.
    skew: f64,
    /// Of the edge at which its switches come on, and to which side it is searched.
    edge: f64,
    direction: Direction,
}

/// An example machine whose axes are homed.
struct Scene {
    machine: &'static str,
    axes: [Homed; 3],
    /// Its name and its place among the drives.
    y: (&'static str, usize),
    /// `[retraction]`: the way back to a path has legs.
    retracts: bool,
}

const PORTAL: Scene = Scene {
    machine: "portal",
    axes: [
        Homed {
            drives: &["X1", "X2"],
            start: 60.0,
            skew: 2.0,
            edge: -4.0,
            direction: Direction::Negative,
        },
        Homed {
            drives: &["Y"],
            start: 30.0,
            skew: 0.0,
            edge: -4.0,
            direction: Direction::Negative,
        },
        Homed {
            drives: &["Z"],
            start: -40.0,
            skew: 0.0,
            edge: 3.0,
            direction: Direction::Positive,
        },
    ],
    y: ("node 3 (Y, LXM32M)", 2),
    retracts: false,
};

const XYZ: Scene = Scene {
    machine: "xyz",
    axes: [
        Homed {
            drives: &["left-right"],
            start: -200.0,
            skew: 0.0,
            edge: -254.0,
            direction: Direction::Negative,
        },
        Homed {
            drives: &["front-back"],
            start: -190.0,
            skew: 0.0,
            edge: -204.0,
            direction: Direction::Negative,
        },
        Homed {
            drives: &["up-down"],
            start: 5.0,
            skew: 0.0,
            edge: 24.0,
            direction: Direction::Positive,
        },
    ],
    y: ("node 9 (front-back, LXM32M)", 1),
    retracts: true,
};

impl Scene {
    /// What is replaced in the example's file, and by what. Nothing switches the inputs of an axis that has `no_switch`.
    fn replacements(&self, no_switch: Option<usize>) -> Vec<(String, String)> {
        let mut tables = String::new();
        let mut changes = Vec::new();
        for (place, (order, axis)) in [2, 2, 1].into_iter().zip(&self.axes).enumerate() {
            let quoted = |drive: &&str| format!("\"{drive}\"");
            let drives: Vec<_> = axis.drives.iter().map(quoted).collect();
            let switches: Vec<_> = (axis.drives.iter())
                .map(|drive| format!("\"home {drive}\""))
                .collect();
            let (on, side) = match axis.direction {
                Direction::Positive => (format!("{}, 60.0", axis.edge), "positive"),
                Direction::Negative => (format!("-300.0, {}", axis.edge), "negative"),
            };
            let simulated = match no_switch == Some(place) {
                true => String::new(),
                false => format!("simulated = [{on}]\n"),
            };
            for drive in axis.drives {
                tables += &format!(
                    "[[input]]\nname = \"home {drive}\"\ndrive = \"{drive}\"\nsignal = \"DI0\"\n\
                     function = \"home\"\n{simulated}\n"
                );
            }
            let drives = format!("drives = [{}]", drives.join(", "));
            let skew = match axis.skew {
                0.0 => String::new(),
                skew => format!(", start_skew = {skew:?}"),
            };
            let homing = format!(
                "{drives}\nhoming = {{ kind = \"switch\", order = {order}, switches = [{}], \
                 direction = \"{side}\", speed = 60.0, slow_speed = 2.0, back_off = 3.0, max_distance = 120.0, \
                 position = {}, final_position = 0.0 }}\nsimulation = {{ start = {}{skew} }}",
                switches.join(", "),
                axis.edge,
                axis.start
            );
            changes.push((drives, homing));
            if self.machine == "portal" {
                // Drives of an axis that is homed do not know its positions.
                changes.push((
                    "drive_soft_limits = true".to_owned(),
                    "# soft limits are the controller's".to_owned(),
                ));
            }
        }
        if self.retracts {
            tables += "[retraction]\naxis = \"Z\"\nclearance = 10.0\napproach_speed = 10.0\n\n";
        }
        changes.push(("[[axis]]\n".to_owned(), format!("{tables}[[axis]]\n")));
        changes
    }
}

/// A day at a machine.
struct Day {
    rig: Rig,
    /// The axis whose switches are absent as it is homed first, and then put in their places: its place in the scene, which
    /// is that of its letter.
    unplugged: usize,
    told: Subscription,
    drives: usize,
}

impl Day {
    /// With this seed the drives have their noise, and one axis or another has its switches absent.
    fn begin(scene: &Scene, seed: u64) -> Self {
        let unplugged = (seed % 3) as usize;
        let replacements = scene.replacements(Some(unplugged));
        let replacements: Vec<_> = (replacements.iter())
            .map(|(old, new)| (old.as_str(), new.as_str()))
            .collect();
        let mut rig = Rig::staying_on(scene.machine, &replacements, |drive, config| {
            config.seed = 100 * seed + drive as u64;
        });
        rig.goes_on = false;
        let told = rig.session.subscribe();
        let drives = rig.machine.drives.len();
        Self {
            rig,
            unplugged,
            told,
            drives,
        }
    }

    /// The place of that axis in the machine file.
    fn unplugged_axis(&self) -> usize {
        let mut axes = self.rig.machine.axes.iter();
        let axis = axes.position(|axis| axis.letter.index() == self.unplugged);
        axis.expect("it has one")
    }

    fn status(&self) -> &Status {
        self.rig.session.status()
    }

    /// Commands something that ends in a state.
    fn go(&mut self, command: Command, ends_in: State) {
        go(&mut self.rig, command);
        let rig = &self.rig;
        let (events, refused) = (&rig.events, &rig.refused);
        assert_eq!(state(rig), ends_in, "{refused:?} {events:?}");
    }

    fn mdi(&mut self, lines: &str) {
        self.go(Command::Mdi(lines.to_owned()), State::Ready);
    }

    fn jog(&mut self, axis: AxisLetter, distance: f64, ends_in: State) {
        let speed = None;
        let jog = Jog::By {
            axis,
            distance,
            speed,
        };
        self.rig.command(Command::Jog(jog));
        self.rig.run_until(|rig| moves(rig));
        self.rig.run_until(|rig| !moves(rig));
        settle(&mut self.rig);
        assert_eq!(state(&self.rig), ends_in);
    }

    /// What the plants have come to: where the session shows their axes, and at rest.
    fn assert_plants_are_there(&mut self) {
        // As long as the loops take to come to rest.
        for _ in 0..200 {
            self.rig.step();
        }
        for axis in self.rig.machine.axes.clone() {
            let shown = at(&self.rig, axis.letter);
            let actual = self.status().actual[axis.letter.index()];
            for drive in axis.drives {
                let truth = truth(&mut self.rig, drive);
                assert!((truth - shown).abs() < 0.006, "{drive}: {truth} {shown}");
                assert!((truth - actual).abs() < 0.006, "{drive}: {truth} {actual}");
                let velocity = self.rig.twin(drive).observe().velocity;
                assert!(velocity.abs() < 0.01, "{drive}: {velocity}");
            }
        }
    }

    /// Where the plants are, by drive, mm.
    fn plants(&mut self) -> Vec<f64> {
        (0..self.drives)
            .map(|drive| truth(&mut self.rig, drive))
            .collect()
    }

    fn powered(&mut self) -> Vec<bool> {
        (0..self.drives)
            .map(|drive| self.rig.twin(drive).observe().is_powered)
            .collect()
    }

    /// Goes on until X of the work is beyond.
    fn runs_beyond(&mut self, x: f64) {
        self.rig
            .run_until(|rig| state(rig) == State::Running && work(rig, AxisLetter::X) > x);
    }

    fn load(&mut self, name: &str, text: &str) {
        let file = self.rig.folder.file(name, text);
        self.go(Command::Load(file.clone()), State::Ready);
        assert_eq!(self.status().program, Some(file));
    }

    /// By how much the second drive of X really stands further than the first.
    fn skew(&mut self) -> f64 {
        let x = &self.rig.machine.axes[0];
        let (first, last) = (x.drives[0], x.drives[x.drives.len() - 1]);
        truth(&mut self.rig, last) - truth(&mut self.rig, first)
    }

    /// Cold start: nothing but jogs before the axes know where they are; then they do, and a gantry that was askew is
    /// square.
    fn switch_on_and_home(&mut self, scene: &Scene) {
        assert_eq!(self.powered(), vec![false; self.drives]);
        settle(&mut self.rig);
        assert_eq!(self.status().state_in_words(), "ready (unreferenced)");
        assert_eq!(self.powered(), vec![true; self.drives]);
        let skew = self.skew();
        assert!((skew - scene.axes[0].skew).abs() < 0.006, "{skew}");
        let square = self.status().squareness;
        assert!(square.iter().flatten().all(|it| it.measured.is_none()));
        self.go(Command::Mdi("G0 X1".to_owned()), State::Ready);
        let refused = self.rig.refused.pop().expect("no axis is referenced");
        assert!(matches!(refused.reason, Refusal::Machine(_)), "{refused:?}");
        self.home_in_vain();
        let skew = self.skew();
        self.home_with_switches(scene);
        assert!(self.rig.states.contains(&State::Homing));
        assert_eq!(self.status().state_in_words(), "ready");
        let late = self.unplugged_axis();
        let homed =
            |event: &&Event| matches!(event, Event::Referenced { axis, .. } if *axis == late);
        assert_eq!(self.rig.events.iter().filter(homed).count(), 1);
        let square = self.status().squareness;
        let gantries = self.drives - 3;
        assert_eq!(square.iter().flatten().count(), gantries);
        if let Some(square) = square[0] {
            let measured = square.measured.expect("it is homed");
            assert!((measured - skew).abs() < 0.006, "{measured} {skew}");
            assert_eq!(square.stored, 0.0);
        }
        assert_eq!(self.status().setpoint[..3], [0.0; 3]);
        self.assert_plants_are_there();
    }

    /// A switch that is absent is told as that, with its axis; all rests, and no program or typed line moves anything.
    fn home_in_vain(&mut self) {
        self.go(Command::Home([false; 9]), State::Ready);
        let failed = |event: &Event| match event {
            Event::HomingFailed { axis, failure } => Some((*axis, *failure)),
            _ => None,
        };
        let failed: Vec<_> = self.rig.events.iter().filter_map(failed).collect();
        assert!(
            failed.contains(&(self.unplugged_axis(), HomingFailure::NotFound)),
            "{failed:?}"
        );
        assert_eq!(self.status().state_in_words(), "ready (unreferenced)");
        self.assert_rests();
        self.go(Command::Mdi("G0 X1 Y1 Z-1".to_owned()), State::Ready);
        let refused = self.rig.refused.pop().expect("an axis is not referenced");
        assert!(matches!(refused.reason, Refusal::Machine(_)), "{refused:?}");
    }

    /// Homes all axes, with every switch in its place: those that the machine file has none for are as if it had.
    fn home_with_switches(&mut self, scene: &Scene) {
        let Homed {
            edge, direction, ..
        } = scene.axes[self.unplugged];
        let drives = self.rig.machine.axes[self.unplugged_axis()].drives.clone();
        self.rig.command(Command::Home([false; 9]));
        // It takes effect at the next wake-up.
        let mut since = 0;
        while since < 6 {
            for &drive in &drives {
                let beyond = direction.of(truth(&mut self.rig, drive) - edge) >= 0.0;
                let input = Disturbance::Input(0, beyond);
                self.rig.twin(drive).disturb(input);
            }
            self.rig.step();
            let rests = state(&self.rig) == State::Ready;
            since = if rests { since + 1 } else { 0 };
        }
        assert_eq!(self.rig.refused, []);
    }

    fn assert_rests(&mut self) {
        for _ in 0..200 {
            self.rig.step();
        }
        for drive in 0..self.drives {
            let velocity = self.rig.twin(drive).observe().velocity;
            assert!(velocity.abs() < 0.05, "{drive}: {velocity}");
        }
    }

    /// The zero of the work is where the tool stands, by a jog and a step of one; then a tool with its length.
    fn touch_off(&mut self) {
        let rig = &mut self.rig;
        rig.command(Command::Jog(Jog::To(positions([
            (AxisLetter::X, 100.0),
            (AxisLetter::Y, 50.0),
        ]))));
        rig.run_until(|rig| state(rig) == State::Jogging);
        settle(rig);
        let (axis, direction) = (AxisLetter::X, Direction::Positive);
        self.go(Command::Jog(Jog::Step { axis, direction }), State::Ready);
        assert_near(at(&self.rig, AxisLetter::X), 101.0);
        let there = positions([
            (AxisLetter::X, 0.0),
            (AxisLetter::Y, 5.0),
            (AxisLetter::Z, 0.0),
        ]);
        self.go(Command::SetWorkOffset(there), State::Ready);
        assert_near(work(&self.rig, AxisLetter::X), 0.0);
        assert_near(work(&self.rig, AxisLetter::Y), 5.0);
        let file = Tables::beside(&self.rig.folder.path("machine.toml"));
        let tables = Tables::load(&file).expect("they are written");
        assert_near(tables.work_offsets[0][AxisLetter::X], 101.0);
        self.rig.goes_on = true;
        self.mdi("T1 M6");
        self.rig.goes_on = false;
        assert_eq!(self.status().tool, 1);
        let length = positions([(AxisLetter::Z, 0.0)]);
        self.go(Command::SetToolLength(length), State::Ready);
        assert_near(work(&self.rig, AxisLetter::Z), 0.0);
        self.assert_plants_are_there();
    }

    /// Typed lines: modes live from one to the next.
    fn type_lines(&mut self) {
        self.mdi("G91 G1 X10 F6000 S500 M3");
        self.mdi("X5");
        assert_near(work(&self.rig, AxisLetter::X), 15.0);
        assert_eq!(self.status().spindle.speed, 500.0);
        assert!(self.rig.states.contains(&State::Mdi));
        let zero = positions([(AxisLetter::X, 0.0), (AxisLetter::Y, 0.0)]);
        self.go(Command::GoTo(zero), State::Ready);
        assert_near(at(&self.rig, AxisLetter::X), 101.0);
        assert_near(work(&self.rig, AxisLetter::Y), 0.0);
        self.assert_plants_are_there();
    }

    /// A program that is held, left by jogs and taken up again where it was left.
    fn run_hold_jog_and_resume(&mut self, scene: &Scene) {
        self.load("part.ngc", PART);
        self.rig.command(Command::CycleStart);
        self.runs_beyond(20.0);
        self.go(Command::FeedHold, State::Held);
        self.assert_plants_are_there();
        let left = self.status().setpoint;
        let line = self.status().line;
        assert!(left[0] > 121.0 && line == 4, "{left:?} {line}");
        self.jog(AxisLetter::Z, 2.0, State::Held);
        self.jog(AxisLetter::Y, 20.0, State::Held);
        assert!(self.status().off_path);
        self.assert_plants_are_there();
        self.rig.command(Command::FeedOverride(Override::To(150.0)));
        let held = self.rig.rows.len();
        if scene.retracts {
            // Up, over, down and on.
            for leg in ["takes Z to 10.000", "takes Y to", "where the path goes on"] {
                let layout = self.rig.layout.clone();
                let legs = |event: &&Event| matches!(event, Event::NextLeg(_));
                let told = self.rig.events.iter().rfind(legs).expect("a leg");
                let told = told.describe(&*layout).expect("it is told");
                assert!(told.contains(leg), "{told}");
                self.rig.command(Command::CycleStart);
                settle(&mut self.rig);
                self.rig
                    .run_until(|rig| !moves(rig) || state(rig) == State::Running);
                settle(&mut self.rig);
            }
        }
        if !scene.retracts {
            self.rig.command(Command::Resume);
        }
        settle(&mut self.rig);
        assert_eq!(state(&self.rig), State::Ready);
        let rows = &self.rig.rows[held..];
        let back = rows.iter().find(|row| !row.plan.off_path);
        let back = back.expect("it goes on").plan.position;
        let off = back
            .iter()
            .zip(&left)
            .map(|(back, left)| (back - left).abs());
        assert!(off.fold(0.0, f64::max) < 0.05, "{back:?} {left:?}");
        let furthest = rows.iter().map(|row| row.plan.position[0]);
        assert_near(furthest.fold(0.0, f64::max), 161.0);
        assert_near(work(&self.rig, AxisLetter::X), 0.0);
        assert_near(work(&self.rig, AxisLetter::Y), 0.0);
        assert_eq!(self.status().settings.feed_override, 150.0);
        let modes = &self.status().modes;
        assert!(modes.starts_with("G1 G17 G21 G40 G43 G54 G90 "), "{modes}");
        assert!(modes.contains(" M5 "), "{modes}");
        self.assert_plants_are_there();
    }

    /// The drive of Y fails in the midst of the program; everything goes off, and what stopped it is listed.
    fn fail(&mut self, scene: &Scene) {
        self.rig.command(Command::Run { from_line: None });
        self.runs_beyond(20.0);
        let (name, drive) = scene.y;
        (self.rig.twin(drive)).disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
        settle(&mut self.rig);
        assert_eq!(state(&self.rig), State::Faulted);
        assert_eq!(self.rig.session.faults().len(), 1);
        let stopped = self.status().stopped.clone().expect("the list");
        let first = &stopped.faults[0];
        assert!(first.starts_with(&format!("{name}: EMCY")), "{stopped:?}");
        assert_eq!(stopped.line, Some(4));
        let last = *self.rig.rows.last().expect("it ran");
        for axis in 0..3 {
            assert_near(stopped.position[axis], last.axes[axis].act);
        }
        assert_eq!(self.powered(), vec![false; self.drives]);
        assert_eq!(self.status().spindle.turning, Turning::Off);
        assert!(!self.status().coolant.flood);
        self.go(Command::Mdi("G0 X0".to_owned()), State::Faulted);
        assert_eq!(self.rig.refused.len(), 1, "not while it is stopped");
        self.rig.refused.clear();
    }

    /// The drives are brought back without a motion, and the program is taken up at the line that was not
    /// completed, with spindle and coolant, by cycle start alone.
    fn reset_and_resume(&mut self, scene: &Scene) {
        let before = self.plants();
        self.go(Command::Reset, State::Ready);
        for (drive, before) in before.into_iter().enumerate() {
            let moved = (truth(&mut self.rig, drive) - before).abs();
            assert!(moved < 0.01, "{drive} has moved by {moved}");
        }
        assert_eq!(self.powered(), vec![true; self.drives]);
        assert!(self.rig.session.faults().is_empty());
        assert_eq!(self.status().stopped, None);
        assert_eq!(self.status().state_in_words(), "ready", "still referenced");
        let there = self.status().setpoint;
        assert_eq!(self.status().interrupted, Some(4));
        self.go(Command::Resume, State::Held);
        let (line, told) = self.rig.messages.last().expect("what it begins with");
        assert!(*line == 4 && told.contains("M3 M8"), "{line}: {told}");
        assert_eq!(self.status().setpoint, there);
        let begun = self.rig.rows.len();
        self.confirm(scene);
        let rows = &self.rig.rows[begun..];
        let cut = rows.iter().find(|row| row.plan.position[0] > 150.0);
        let functions = cut.expect("the line's way").functions;
        assert_eq!(functions.spindle.turning, Turning::Clockwise);
        assert!(functions.coolant.flood);
        assert_near(work(&self.rig, AxisLetter::X), 0.0);
        self.assert_plants_are_there();
    }

    /// Goes on with a program that is resumed: up, over and down, each told before.
    fn confirm(&mut self, scene: &Scene) {
        let legs = match scene.retracts {
            true => &["takes Z to 10.000", "takes X to", "where the path goes on"][..],
            false => &[],
        };
        for leg in legs {
            self.go(Command::CycleStart, State::Held);
            let (_, told) = self.rig.messages.last().expect("the leg");
            assert!(told.contains(leg), "{told}");
        }
        self.go(Command::CycleStart, State::Ready);
    }

    /// The work is set elsewhere while the program is held, by lines that move nothing: from there on it is cut there.
    fn set_an_offset_in_a_pause(&mut self, scene: &Scene) {
        self.rig.command(Command::Run { from_line: None });
        self.runs_beyond(20.0);
        self.go(Command::FeedHold, State::Held);
        let there = self.status().setpoint;
        self.go(Command::Mdi("G10 L2 P1 X106".to_owned()), State::Held);
        self.go(
            Command::Mdi("#1 = 49\nG10 L2 P1 Y#1".to_owned()),
            State::Held,
        );
        assert_eq!(self.status().setpoint, there);
        assert_eq!(self.status().spindle.turning, Turning::Clockwise);
        assert_eq!(self.status().interrupted, Some(4));
        self.go(Command::Resume, State::Held);
        assert_eq!(self.status().setpoint, there);
        let begun = self.rig.rows.len();
        self.confirm(scene);
        let rows = &self.rig.rows[begun..];
        for (axis, furthest) in [166.0, 89.0].into_iter().enumerate() {
            let places = rows.iter().map(|row| row.plan.position[axis]);
            let reached = places.fold(0.0, f64::max);
            // The corner there is rounded.
            assert!(
                (reached - furthest).abs() < 0.01,
                "{reached}, not {furthest}"
            );
        }
        assert_near(at(&self.rig, AxisLetter::X), 106.0);
        assert_near(at(&self.rig, AxisLetter::Y), 49.0);
        assert_near(work(&self.rig, AxisLetter::X), 0.0);
        self.assert_plants_are_there();
    }

    /// Another program; drives off for a while; then the end of the day.
    fn run_another_and_go_off(&mut self) {
        self.load("other.ngc", OTHER);
        self.go(Command::Run { from_line: None }, State::Ready);
        assert_near(work(&self.rig, AxisLetter::X), 20.0);
        assert_near(work(&self.rig, AxisLetter::Y), 10.0);
        self.assert_plants_are_there();
        self.go(Command::Disable, State::Disabled);
        assert_eq!(self.powered(), vec![false; self.drives]);
        self.go(Command::Enable, State::Ready);
        self.mdi("G53 G0 Z0");
        self.go(Command::SwitchOff, State::Off);
        while self.rig.step() {}
        assert_eq!(self.powered(), vec![false; self.drives]);
        assert_eq!(self.rig.refused, []);
        assert_eq!(self.rig.problems, [""; 0]);
    }

    /// What took effect all day.
    fn accepted(&self) -> Vec<Accepted> {
        let accepted = self.told.events().filter_map(|event| match event {
            session::Event::Accepted(it) => Some(it),
            _ => None,
        });
        let accepted = accepted.collect();
        assert_eq!(self.told.missed(), 0);
        accepted
    }
}

/// A cut in X and Y, with everything on.
const PART: &str = "G90 G1 Z-5 F6000\nM3 S500\nM8\nX60\nY40\nX0 Y0\nM2\n";

/// A line and an arc.
const OTHER: &str = "G90 G1 Y10 F6000\nG2 X20 Y10 I10 J0\nM30\n";

fn assert_near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-6, "{found}, not {expected}");
}

fn moves(rig: &Rig) -> bool {
    rig.rows
        .last()
        .is_some_and(|row| row.plan.velocity != [0.0; 9])
}

/// A whole day, and what the bus has carried, by its digest.
fn lived(scene: &Scene, seed: u64) -> (Day, String) {
    let mut day = Day::begin(scene, seed);
    day.switch_on_and_home(scene);
    // A homing makes other positions of those before.
    day.rig.rows.clear();
    day.touch_off();
    day.type_lines();
    day.run_hold_jog_and_resume(scene);
    day.fail(scene);
    day.reset_and_resume(scene);
    day.set_an_offset_in_a_pause(scene);
    day.run_another_and_go_off();
    assert_moves_within_limits(&mut day.rig);
    let frames = day.rig.session.timeline().frames().result().0;
    (day, frames)
}

/// Days with these seeds. The first makes the same frames twice, and its commands and the bus' frames make all of it once
/// more.
fn days_at(scene: &Scene, seeds: [u64; 2]) {
    let [first, other] = seeds;
    let (mut day, frames) = lived(scene, first);
    assert_eq!(lived(scene, first).1, frames);
    assert_ne!(lived(scene, other).1, frames);
    let accepted = day.accepted();
    assert_eq!(replayed::again(&mut day.rig, None, &accepted), accepted);
}

#[test]
fn at_a_portal() {
    days_at(&PORTAL, [3, 1]);
}

#[test]
fn at_a_machine_of_three_axes() {
    days_at(&XYZ, [1, 2]);
}

/// Where an axis is in work coordinates, as the screen has it.
fn shown(screen: &str, axis: &str) -> Option<f64> {
    let mut rows = screen.lines().map(str::split_whitespace);
    rows.find_map(|mut words| (words.next()? == axis).then(|| words.next()?.parse().ok())?)
}

/// The last that is told of a way back.
fn last_leg(screen: &str) -> &str {
    screen.rfind("way back:").map_or("", |at| &screen[at..])
}

/// Waits until the machine is in a state and an axis stands there, but for the encoder's noise.
fn await_rest(terminal: &mut Terminal, state: &str, axis: &str, place: f64) -> String {
    terminal.wait_until(|screen| {
        let near = shown(screen, axis).is_some_and(|it| (it - place).abs() < 0.02);
        screen.starts_with(&format!(" {state} ")) && near
    })
}

/// As a person does: an Enter right behind another one may be its repetition.
fn take_time() {
    thread::sleep(Duration::from_secs(1));
}

/// The same in real time, by keys on a terminal, on the bus that is built in; and `replay` goes through it once
/// more. X meets a clamp, so that the work is moved away from it.
#[test]
fn by_keys_on_a_terminal() {
    let mut replacements = XYZ.replacements(None);
    let clamp = "{ start = -200, end_stops = [-300.0, 140.0] }";
    replacements.push(("{ start = -200 }".to_owned(), clamp.to_owned()));
    let replacements: Vec<_> = (replacements.iter())
        .map(|(old, new)| (old.as_str(), new.as_str()))
        .collect();
    let folder = Folder::new();
    let machine = folder.file("machine.toml", &machine_with("xyz", &replacements));
    // So slow that nobody who presses keys is too late on a busy host.
    let part = folder.file("part.ngc", &PART.replace("F6000", "F1200"));
    let other = folder.file("other.ngc", OTHER);
    let [log, commands] = ["day.log", "day.jsonl"].map(|name| folder.path(name));
    let options = format!(
        "--candump {} --commands {}",
        log.display(),
        commands.display()
    );
    let mut keys = console_on_a_terminal(&machine, &options);
    let starts = |state: &'static str| move |screen: &str| screen.starts_with(state);

    // Cold start, the keys, home.
    let screen = keys.wait_until(starts(" READY (UNREFERENCED)"));
    assert!(screen.contains(" X?"), "{screen}");
    keys.press(b"?");
    keys.wait_until(|screen| screen.contains("home all axes"));
    keys.press(b"?h");
    await_rest(&mut keys, "READY", "X", 0.0);
    // Touch off.
    keys.press(b":jog_to X100 Y50\r");
    await_rest(&mut keys, "READY", "X", 100.0);
    // By 10 mm, the next greater step.
    keys.press(b"]\x1B[6~");
    await_rest(&mut keys, "READY", "Z", -10.0);
    keys.press(b":set_offset X0 Y0 Z0\r");
    for axis in ["X", "Y", "Z"] {
        await_rest(&mut keys, "READY", axis, 0.0);
    }
    for (axis, offset) in [
        (AxisLetter::X, 100.0),
        (AxisLetter::Y, 50.0),
        (AxisLetter::Z, -10.0),
    ] {
        let written = offset_of(&machine, axis).expect("the tables are written");
        assert!((written - offset).abs() < 0.01, "{axis}: {written}");
    }
    keys.press(b":mdi G91 G1 X-10 F6000\r");
    await_rest(&mut keys, "READY", "X", -10.0);
    // Run, hold, jog, resume: up, over and down; then the clamp.
    keys.press(format!(":load {}\r", part.display()).as_bytes());
    keys.wait_until(|screen| screen.contains("part.ngc"));
    take_time();
    keys.press(b"\r");
    keys.wait_until(|screen| shown(screen, "X").is_some_and(|x| x > 5.0));
    keys.press(b" ");
    keys.wait_until(|screen| screen.contains("held on the path"));
    keys.press(b"\x1B[5~");
    await_rest(&mut keys, "HELD", "Z", 5.0);
    keys.press(b"\x1B[D");
    for (leg, z) in [
        ("takes Z to 10.000", 5.0),
        ("takes X to", 20.0),
        ("where the path goes on", 20.0),
    ] {
        keys.wait_until(|screen| last_leg(screen).contains(leg));
        await_rest(&mut keys, "HELD", "Z", z);
        // Sooner, it may be the repetition of the one before.
        thread::sleep(Duration::from_secs(1));
        keys.press(b" ");
    }
    let screen = keys.wait_until(starts(" STOPPED BY A FAULT"));
    assert!(screen.contains("axis X: following error"), "{screen}");
    keys.wait_until(|screen| screen.contains("line 4 is not completed"));
    // Reset, and resume with the work away from the clamp.
    keys.press(b"r");
    keys.wait_until(starts(" READY "));
    keys.press(b":mdi G10 L2 P1 X60\r");
    keys.wait_until(|screen| shown(screen, "X").is_some_and(|x| x > 70.0));
    keys.press(b":resume\r");
    keys.wait_until(|screen| screen.contains("line 4: begins with"));
    keys.wait_until(starts(" HELD"));
    for leg in ["takes Z to 10.000", "takes X to", "where the path goes on"] {
        take_time();
        keys.press(b"\r");
        // It is told by what plans the way, before the cycle rests for it.
        keys.wait_until(|screen| {
            let told = last_leg(screen);
            told.contains(leg) && told.contains("waits for cycle start")
        });
    }
    take_time();
    keys.press(b"\r");
    await_rest(&mut keys, "READY", "X", 0.0);
    // Another program, and off.
    keys.press(format!(":load {}\r", other.display()).as_bytes());
    keys.wait_until(|screen| screen.contains("other.ngc"));
    take_time();
    keys.press(b"\r");
    await_rest(&mut keys, "READY", "X", 20.0);
    keys.press(b":switch_off\r");
    let _ = keys.end();
    replays(&log, &commands, &machine);
}

/// `replay` goes through a day on a terminal once more.
fn replays(log: &Path, commands: &Path, machine: &Path) {
    let mut replay = syncline();
    replay.arg("replay").args([log, machine]);
    let output = replay.arg("--commands").arg(commands).output().unwrap();
    let (code, told, errors) = ended(&output);
    assert_eq!(code, 0, "{told}{errors}");
    assert!(told.contains("switched off"), "{told}");
}

/// A shorter one at the portal, whose gantry is askew: what it was out by, why a program rests, and that the feed override
/// is 0 are on the screen.
#[test]
fn by_keys_at_a_portal() {
    let replacements = PORTAL.replacements(None);
    let replacements: Vec<_> = (replacements.iter())
        .map(|(old, new)| (old.as_str(), new.as_str()))
        .collect();
    let folder = Folder::new();
    let machine = folder.file("machine.toml", &machine_with("portal", &replacements));
    let part = folder.file(
        "part.ngc",
        "G90 G1 X30 F300\nG4 P2\nM64 P9\nX0 Y5 F600\nM2\n",
    );
    let [log, commands] = ["day.log", "day.jsonl"].map(|name| folder.path(name));
    let options = format!(
        "--candump {} --commands {}",
        log.display(),
        commands.display()
    );
    let mut keys = console_on_a_terminal(&machine, &options);
    // Cold start; home, which takes the gantry square.
    let screen = keys.wait_until(|screen| screen.starts_with(" READY (UNREFERENCED)"));
    assert!(screen.contains("square   X not measured"), "{screen}");
    keys.press(b"h");
    let screen = await_rest(&mut keys, "READY", "X", 0.0);
    let out = screen.split("square   X was ").nth(1).expect(&screen);
    let out: f64 = out
        .split(' ')
        .next()
        .and_then(|it| it.parse().ok())
        .expect(&screen);
    assert!((out - 2.0).abs() < 0.02, "{screen}");
    // Touch off.
    keys.press(b":jog_to X40 Y20\r");
    await_rest(&mut keys, "READY", "X", 40.0);
    keys.press(b":set_offset X0 Y0 Z0\r");
    await_rest(&mut keys, "READY", "X", 0.0);
    await_rest(&mut keys, "READY", "Y", 0.0);
    // Run; nothing is left of the speed, and cycle start says so; raised, it goes on.
    keys.press(format!(":load {}\r", part.display()).as_bytes());
    keys.wait_until(|screen| screen.contains("part.ngc"));
    take_time();
    keys.press(b"\r");
    keys.wait_until(|screen| shown(screen, "X").is_some_and(|x| x > 3.0));
    keys.press(b":feed_override 0\r");
    let screen = keys.wait_until(|screen| screen.starts_with(" HELD "));
    assert!(!screen.contains("feed hold: held"), "{screen}");
    keys.wait_until(|screen| screen.matches("the feed override is 0").count() >= 2);
    take_time();
    keys.press(b"\r");
    keys.wait_until(|screen| screen.matches("the feed override is 0").count() >= 3);
    keys.press(b":feed_override 100\r");
    keys.wait_until(|screen| screen.starts_with(" RUNNING ") && screen.contains("dwells, 1."));
    // Hold, jog, resume.
    keys.wait_until(|screen| shown(screen, "X").is_some_and(|x| x < 25.0));
    keys.press(b" ");
    keys.wait_until(|screen| screen.contains("feed hold: held"));
    keys.press(b"]\x1B[6~");
    keys.wait_until(|screen| shown(screen, "Z").is_some_and(|z| (z + 10.0).abs() < 0.02));
    keys.press(b" ");
    await_rest(&mut keys, "READY", "Y", 5.0);
    keys.press(b":mdi G0 X5\r");
    await_rest(&mut keys, "READY", "X", 5.0);
    keys.press(b":switch_off\r");
    let _ = keys.end();
    replays(&log, &commands, &machine);
}
