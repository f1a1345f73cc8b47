//! `syncline identify`: what an axis is, from how it moves.

use super::log_files::LogFiles;
use super::output::{Claims, Target};
use super::ports::PortChoice;
use super::real_time::{RealTimeArgs, lockstep, record_faults};
use super::state_keeper::StateKeeper;
use super::{Exit, bad_input, report};
use crate::budget::DoesNotFit;
use crate::control::{End, Event as MachineEvent, Layout};
use crate::identify::estimate::{NotEstimated, estimate};
use crate::identify::excitation::{self, Bounds};
use crate::identify::lag::NotSeen;
use crate::identify::log::{Beside, Log};
use crate::identify::velocity::Streamed;
use crate::identify::{AxisSample, Identified, Moved, Subject, TooLight};
use crate::machine::{Axis, Machine, MachineState};
use crate::observe::Observers;
use crate::observe::axis_log::AxisLog;
use crate::program::{Program, Programs};
use crate::run::real_time::RealTime;
use crate::run::virtual_time::VirtualMachine;
use crate::run::{Progress, Timeline};
use crate::session::{Command, Event, Session};
use crossbeam::channel::Receiver;
use serde::Serialize;
use std::error::Error;
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;
use std::time::Duration;
use syncline_gcode::Tables;

/// How often it is looked after a machine in real time.
const POLL: Duration = Duration::from_millis(1);

/// Find out the inertia, friction and gravity of an axis by moving it, or how it follows velocities.
///
/// The axis makes strokes at several speeds, and strokes whose speed swings ever faster, within its limits and the bounds
/// given here, through the same planner and controller as a program; Ctrl-C stops it as it stops a program. Its drive tells
/// its torque with its position in every cycle meanwhile. From both follows what the motor moves, each number with the
/// interval that holds the truth with 95 %. Of an axis whose drive is sent velocities it is the delay and the lag with which it
/// follows them, by which its position loop is set.
///
/// A machine whose buses are all simulated is identified in virtual time, unless --real-time says otherwise. With --log
/// nothing moves: the log of another run is looked at.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Machine file (TOML).
    machine: PathBuf,
    /// The axis, by its letter.
    #[arg(long, value_name = "AXIS")]
    axis: String,
    /// Look at the log of a run instead of moving anything.
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = ["write_log", "travel", "speed", "torque", "in_real_time", "bus"]
    )]
    log: Option<PathBuf>,
    /// Write what was seen of the axis, as CSV.
    #[arg(long, value_name = "FILE")]
    write_log: Option<PathBuf>,
    /// Go from here to there at most, mm or degrees; without it, about the middle of the soft limits, no further than strokes
    /// at the greatest speed need.
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], allow_negative_numbers = true)]
    travel: Option<Vec<f64>>,
    /// Go that fast at most, mm/s or °/s; without it, as fast as the axis goes and the travel has room for.
    #[arg(long, value_name = "SPEED")]
    speed: Option<f64>,
    /// Stop where the torque goes beyond so many % of the rated one.
    #[arg(long, value_name = "PERCENT", default_value_t = 300.0)]
    torque: f64,
    /// Rated torque of the motor, N·m, of which the drive tells its torque in thousandths; without it, that of the axis's
    /// `feed_forward` in the machine file, or of the motor that its [axis.simulation] names.
    #[arg(long, value_name = "NM", value_parser = positive)]
    rated_torque: Option<f64>,
    /// Write the result as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the result as an HTML file, with how the axis answers torque over frequency; not of one whose drive is sent velocities.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Change the machine file to what was found: the axis's [axis.simulation], or the [model.…] table of its drive.
    #[arg(long)]
    update: bool,
    /// Move simulated drives in real time too.
    #[arg(long = "real-time")]
    in_real_time: bool,
    #[command(flatten)]
    ports: PortChoice,
    #[command(flatten)]
    real_time: RealTimeArgs,
    #[command(flatten)]
    bus_logs: LogFiles,
    /// Tell what the controller does.
    #[arg(short, long)]
    verbose: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text
        .parse()
        .ok()
        .filter(|it: &f64| it.is_finite() && *it > 0.0);
    number.ok_or_else(|| "give a number above 0".to_owned())
}

/// What cannot be had of an axis whose drive is sent velocities, and what to do.
#[derive(Debug, thiserror::Error)]
enum Unfit {
    /// It tells no torque.
    #[error(
        "--report: axis {0} is sent velocities and tells no torque that it could be shown to answer: leave --report out"
    )]
    NoResponse(String),
    /// It has no values for the machine file.
    #[error(
        "--update: axis {0} has no `motor` in its [axis.simulation], behind which the values of that table are found: name it there, \
         or leave --update out"
    )]
    NoMotor(String),
    /// The bus has no room for the torque besides.
    #[error("with what {drives} tell in every cycle to be identified: {source}")]
    NoRoom { drives: String, source: DoesNotFit },
    /// What would be updated is in another file.
    #[error(
        "--update: what is found belongs into the file that describes {0}: leave --update out, and write there what is told"
    )]
    Described(&'static str),
}

/// What a run of the excitation came to.
struct Seen {
    log: Log,
    end: Option<End>,
    /// The torque that it was stopped for, % of the rated one.
    excess: Option<f64>,
}

impl Args {
    pub(super) fn execute(self) -> Exit {
        match self.identify() {
            Ok(exit) => exit,
            Err(error) => bad_input(&*error),
        }
    }

    fn identify(&self) -> Result<Exit, Box<dyn Error>> {
        let mut machine = Machine::load(&self.machine)?;
        self.ports.apply(&mut machine)?;
        let subject = Subject::of(&mut machine, &self.axis, self.rated_torque)?;
        let beside = match subject {
            Subject::Moved(ref moved) => {
                if self.update && !moved.names_motor() {
                    return Err(Unfit::NoMotor(self.axis.clone()).into());
                }
                Beside::Torque
            }
            Subject::Streamed(streamed) => {
                if self.report.is_some() {
                    return Err(Unfit::NoResponse(self.axis.clone()).into());
                }
                if let Some(model) = streamed.described(&machine).filter(|_| self.update) {
                    return Err(Unfit::Described(model.name).into());
                }
                Beside::Velocity
            }
        };
        let axis = machine.axes[subject.axis()].clone();
        let mut claims = Claims::of_machine(&self.machine, &machine);
        if let Some(log) = &self.log {
            claims = claims.reads("--log", log);
        }
        let json = claims.open("--json", &self.json)?;
        let page = claims.open("--report", &self.report)?;
        let kept = claims.open("--write-log", &self.write_log)?;
        let log = match &self.log {
            Some(file) => Log::read(&axis, beside, file)?,
            None => {
                let seen = self.excite(&machine, &axis, &mut claims)?;
                if let Some(kept) = kept {
                    seen.log.write(&axis, beside, &mut kept.begin()?)?;
                }
                if let Some(exit) = self.cut_short(&seen, &machine)? {
                    return Ok(exit);
                }
                seen.log
            }
        };
        let told = match &subject {
            Subject::Moved(moved) => self.tell_moved(&machine, moved, &log, json, page),
            Subject::Streamed(axis) => self.tell_streamed(&machine, *axis, &log, json),
        };
        match told {
            Ok(told) => claims.tell(&told),
            // A log that was just made and shows too little is no bad input.
            Err(error)
                if self.log.is_none()
                    && (error.is::<NotEstimated>()
                        || error.is::<NotSeen>()
                        || error.is::<TooLight>()) =>
            {
                report(&*error);
                return Ok(Exit::Stopped);
            }
            Err(error) => return Err(error),
        }
        Ok(Exit::Finished)
    }

    /// Tells what moves an axis whose drive tells its torque.
    fn tell_moved(
        &self,
        machine: &Machine,
        moved: &Moved,
        log: &Log,
        json: Option<Target>,
        page: Option<Target>,
    ) -> Result<String, Box<dyn Error>> {
        let estimate = estimate(&log.samples, &moved.shaft)?;
        let identified = Identified::new(machine, moved, &log.samples, estimate);
        if let Some(page) = page {
            let mut page = page.begin()?;
            page.write_all(identified.to_html(&machine.name).as_bytes())?;
            page.flush()?;
        }
        if let Some(too_light) = identified.too_light.as_ref().filter(|_| self.update) {
            return Err(too_light.clone().into());
        }
        self.put(&identified, identified.settings(), json)?;
        Ok(identified.to_string())
    }

    /// Tells how an axis follows whose drive is sent velocities.
    fn tell_streamed(
        &self,
        machine: &Machine,
        axis: Streamed,
        log: &Log,
        json: Option<Target>,
    ) -> Result<String, Box<dyn Error>> {
        let layout = Layout::new(machine)?;
        let drive = &layout.devices[machine.axes[axis.axis].drives[0]];
        let followed = axis.find(machine, layout.lag - drive.delay, &log.samples)?;
        self.put(&followed, followed.changes(), json)?;
        Ok(followed.to_string())
    }

    /// Writes what was found, and with `--update` the settings that say so.
    fn put(
        &self,
        found: &impl Serialize,
        settings: impl Iterator<Item = String>,
        json: Option<Target>,
    ) -> Result<(), Box<dyn Error>> {
        if let Some(json) = json {
            let mut json = json.begin()?;
            json.write_all((serde_json::to_string_pretty(found)? + "\n").as_bytes())?;
            json.flush()?;
        }
        if self.update {
            let mut text = syncline_strict_toml::read(&self.machine)?;
            for setting in settings {
                text = syncline_strict_toml::set(&text, &setting)?;
            }
            // What cannot be read again is not written.
            Machine::parse(&self.machine, &text)?;
            fs::write(&self.machine, text)?;
        }
        Ok(())
    }

    /// How the command ends if the excitation did not come to its end.
    fn cut_short(&self, seen: &Seen, machine: &Machine) -> Result<Option<Exit>, Box<dyn Error>> {
        if let Some(excess) = seen.excess {
            eprintln!(
                "axis {}: stopped at {excess:.0} % of the rated torque, beyond --torque {}: nothing is told; less speed, or \
                 more torque allowed, if what the axis meets is no obstacle",
                self.axis, self.torque
            );
            return Ok(Some(Exit::Stopped));
        }
        Ok(match seen.end {
            Some(End::Finished) => None,
            Some(End::Interrupted) => {
                eprintln!(
                    "axis {}: stopped by the operator: nothing is told",
                    self.axis
                );
                Some(Exit::Interrupted)
            }
            end => {
                let layout = Layout::new(machine)?;
                let told = end.map_or_else(String::new, |end| end.describe(&layout));
                eprintln!("axis {}: {told}: nothing is told", self.axis);
                Some(Exit::Stopped)
            }
        })
    }

    /// Moves the axis, and sees what it does.
    fn excite(
        &self,
        machine: &Machine,
        axis: &Axis,
        claims: &mut Claims,
    ) -> Result<Seen, Box<dyn Error>> {
        let travel = self.travel.as_deref().map(|ends| (ends[0], ends[1]));
        let bounds = Bounds::of(axis, travel, self.speed)?;
        let text = excitation::program(axis, &bounds, machine.cycle.as_secs_f64());
        // Where the tables have work offsets, this has none.
        let programs = Programs::with_tables(machine, Tables::default());
        let program = programs.text("the excitation", text.as_bytes());
        program.check(machine.rest())?;
        let layout = Layout::new(machine).map_err(|source| Unfit::NoRoom {
            drives: (axis.drives.iter())
                .map(|&drive| &*machine.drives[drive].name)
                .collect::<Vec<_>>()
                .join(" and "),
            source,
        })?;
        eprintln!(
            "axis {} goes from {:.3} to {:.3} {}, at up to {:.3} {}",
            axis.name(),
            bounds.travel.0,
            bounds.travel.1,
            axis.units()[0],
            bounds.speed,
            axis.units()[1]
        );
        let (axis_log, samples) = AxisLog::new(axis.letter);
        let observers = Observers::new(machine, None, None, false).logging(axis_log);
        let logs = self.bus_logs.open(claims)?;
        if !lockstep(machine) || self.in_real_time {
            let buses = self.real_time.open(machine, logs)?;
            return self.excite_in_real_time(machine, layout, program, observers, &samples, buses);
        }
        let seed = self.real_time.seed;
        let state = MachineState::simulated(machine, seed);
        let layout = Arc::new(layout.recalling(machine, &state));
        let (timeline, moves) = VirtualMachine::new(machine, Arc::clone(&layout), program, seed)?;
        let mut session = Session::new(&layout, timeline, moves, observers);
        let (log, excess) = self.attend(&mut session, &layout, &samples)?;
        let (mut timeline, _) = session.end();
        let end = timeline.controller().end();
        Ok(Seen { log, end, excess })
    }

    fn excite_in_real_time(
        &self,
        machine: &Machine,
        layout: Layout,
        program: Program,
        observers: Observers,
        samples: &Receiver<AxisSample>,
        buses: super::real_time::Buses,
    ) -> Result<Seen, Box<dyn Error>> {
        let file = MachineState::beside(&self.machine);
        let state = MachineState::load(&file)?;
        let layout = Arc::new(layout.recalling(machine, &state));
        let verbose = self.verbose;
        let (timeline, moves) = RealTime::start(
            machine,
            &layout,
            buses.world,
            buses.ports,
            buses.timing,
            program,
            move |granted| {
                if verbose {
                    eprintln!("{granted}");
                }
            },
        )?;
        let mut session = Session::new(&layout, timeline, moves, observers);
        record_faults(&mut session, &self.machine, machine, &layout);
        let keeper = StateKeeper::start(&mut session, machine, state, file)?;
        let signals = session.operator("signal");
        ctrlc::set_handler(move || {
            // Where the session is over there is nothing to stop.
            let _ = signals.command(Command::Stop);
        })?;
        let (log, excess) = self.attend(&mut session, &layout, samples)?;
        let (timeline, _) = session.end();
        let end = timeline.end()?.controller.end();
        for problem in buses.written.finish() {
            report(&*problem);
        }
        keeper.finish()?;
        Ok(Seen { log, end, excess })
    }

    /// Sees what the axis does until the machine is off, and has it stopped where its torque is beyond the bound; the
    /// torque that it was stopped for, %.
    fn attend<T: Timeline>(
        &self,
        session: &mut Session<T>,
        layout: &Layout,
        samples: &Receiver<AxisSample>,
    ) -> Result<(Log, Option<f64>), Box<dyn Error>> {
        let (told, bounds) = (session.subscribe(), session.operator("identify"));
        let mut log = Log::default();
        let mut excess = None;
        let mut is_stopped = false;
        loop {
            let progress = session.advance();
            for event in told.events() {
                match event {
                    Event::Machine(event) => {
                        let is_fault = matches!(event, MachineEvent::Fault(_));
                        is_stopped |= is_fault;
                        let is_told = self.verbose || is_fault;
                        let text = is_told.then(|| event.describe(layout)).flatten();
                        text.iter().for_each(|text| eprintln!("{text}"));
                    }
                    Event::Problem(error) => report(&*error),
                    _ => {}
                }
            }
            for sample in samples.try_iter() {
                let percent = sample.torque.greatest / 10.0;
                // What a stop takes is no reason for it.
                if percent > self.torque && excess.is_none() && !is_stopped {
                    excess = Some(percent);
                    bounds.command(Command::Stop)?;
                }
                log.samples.push(sample);
            }
            match progress {
                Progress::More => {}
                Progress::Idle => thread::sleep(POLL),
                Progress::Ended => return Ok((log, excess)),
            }
        }
    }
}
