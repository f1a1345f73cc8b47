//! How long the program at work still takes. Its plan is walked once, in a thread of its own that has what time others
//! leave: nothing waits for it, and until it is there nothing is told.

use super::Settings;
use crate::machine::Position;
use crate::program::{Program, Timetable};
use crossbeam::channel::{self, Receiver};
use std::thread;
use syncline_trajectory::path::Overrides;

/// The lowest priority that a thread can have (`setpriority(2)`).
const LOWEST_PRIORITY: i32 = 19;

/// See the module.
#[derive(Default)]
pub(super) struct Remaining {
    /// The program that is being walked.
    walked: Option<(Program, Receiver<Timetable>)>,
    table: Option<Timetable>,
}

impl Remaining {
    /// A job begins with this program.
    pub(super) fn begin(&mut self, program: &Program, start: Position) {
        self.end();
        if program.streams() {
            return;
        }
        let (tell, walked) = channel::bounded(1);
        let program = program.apart();
        let own = program.clone();
        let thread = thread::Builder::new().name("timetable".into());
        let spawned = thread.spawn(move || {
            // With another one it is only sooner done.
            let _ = rustix::process::setpriority_process(None, LOWEST_PRIORITY);
            // What is wrong with the program is told by who runs it.
            if let Ok(table) = program.timetable(start) {
                let _ = tell.send(table);
            }
        });
        // Without a thread nobody is told anything.
        self.walked = spawned.is_ok().then_some((own, walked));
    }

    /// The job is over.
    pub(super) fn end(&mut self) {
        self.table = None;
        if let Some((program, _)) = self.walked.take() {
            program.abandon();
        }
    }

    /// How long the program takes from a place on its path, s, as far as that is known.
    pub(super) fn at(&mut self, distance: f64, settings: &Settings) -> Option<f64> {
        let walked = self.walked.as_ref();
        if let Some(table) = walked.and_then(|(_, walked)| walked.try_recv().ok()) {
            self.walked = None;
            self.table = Some(table).filter(Timetable::is_whole);
        }
        let overrides = Overrides {
            feed: settings.feed_override / 100.0,
            rapid: settings.rapid_override / 100.0,
        };
        self.table.as_ref()?.remaining(distance, overrides)
    }
}
