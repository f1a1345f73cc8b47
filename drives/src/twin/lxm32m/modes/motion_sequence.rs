//! Motion Sequence (lxm32m 1702-1746): movements from a table of data sets.
//!
//! The manual at hand names the objects of the table, 302Dh:10…1D, but not their values. The
//! coding here is an assumption: types 1 absolute, 2 relative, 3 velocity; setting A acceleration,
//! B velocity, C target, D deceleration; transition 0 ends a sequence, any other goes on with the
//! subsequent data set when the condition holds: 0 at once, 1 after so many milliseconds, 2 at a
//! rising edge of controlword bit 4. A logical operator joins a second condition: 1 both, 2 either.

use crate::twin::lxm32m::drive::Drive;
use crate::twin::lxm32m::motion::Motion;
use crate::twin::servo::ramp::Limits;
use syncline_canopen::Instant;
use syncline_canopen::cia402::Controlword;
use syncline_canopen::dictionary::Row;
use syncline_canopen::time::Duration;

/// Data sets (301Bh:A, 0…127).
const DATA_SETS: usize = 128;

const ABSOLUTE: i64 = 1;
const RELATIVE: i64 = 2;
const VELOCITY: i64 = 3;

const AT_ONCE: i64 = 0;
const AFTER_TIME: i64 = 1;
const AT_EDGE: i64 = 2;

const BOTH: i64 = 1;
const EITHER: i64 = 2;

/// One row of the table: the values of 302Dh:11…1D.
type DataSet = [i64; 12];

const TYPE: usize = 0;
const ACCELERATION: usize = 1;
const SPEED: usize = 2;
const TARGET: usize = 3;
const DECELERATION: usize = 4;
const TRANSITION: usize = 5;
const NEXT: usize = 6;
const CONDITION: usize = 7;
const CONDITION_VALUE: usize = 8;
const OPERATOR: usize = 9;
const CONDITION_2: usize = 10;
const CONDITION_VALUE_2: usize = 11;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Idle,
    /// The data set's movement is under way.
    Move,
    /// It is done; the transition condition is waited for since then.
    Wait(Instant),
}

/// The table and where it is.
#[derive(Clone, Debug)]
pub(in crate::twin::lxm32m) struct Sequence {
    table: Box<[DataSet; DATA_SETS]>,
    phase: Phase,
    number: usize,
    single: bool,
    edge: bool,
}

impl Default for Sequence {
    fn default() -> Self {
        Self {
            table: Box::new([[0; 12]; DATA_SETS]),
            phase: Phase::Idle,
            number: 0,
            single: true,
            edge: false,
        }
    }
}

impl Sequence {
    pub(super) fn is_moving(&self) -> bool {
        self.phase == Phase::Move
    }

    /// Ends it before its time; returns the data set under way.
    pub(super) fn abort(&mut self) -> Option<i64> {
        match core::mem::replace(&mut self.phase, Phase::Idle) {
            Phase::Idle => None,
            _ => Some(self.number as i64),
        }
    }

    /// 302Dh:7: the data set after the present one, -1 if there is none.
    pub(in crate::twin::lxm32m) fn next_number(&self) -> i64 {
        let set = &self.table[self.number];
        match self.phase {
            Phase::Idle => -1,
            _ if self.single || set[TRANSITION] == 0 => -1,
            _ => set[NEXT],
        }
    }

    /// 302Dh:6: the data set being processed, -1 if none.
    pub(in crate::twin::lxm32m) fn active_number(&self) -> i64 {
        match self.phase {
            Phase::Idle => -1,
            _ => self.number as i64,
        }
    }
}

impl Drive {
    fn data_set_rows(&self) -> [Row; 12] {
        let rows = &self.rows;
        [
            rows.data_set_type,
            rows.data_set_a,
            rows.data_set_b,
            rows.data_set_c,
            rows.data_set_d,
            rows.data_set_transition,
            rows.data_set_next,
            rows.data_set_condition,
            rows.data_set_condition_value,
            rows.data_set_operator,
            rows.data_set_condition_2,
            rows.data_set_condition_value_2,
        ]
    }

    fn selected_data_set(&self) -> usize {
        let number = self.objects.get(self.rows.data_set_number);
        number.clamp(0, DATA_SETS as i64 - 1) as usize
    }

    /// The window of 302Dh onto the table: a number selects, a field changes.
    pub(super) fn data_set_written(&mut self, row: Row) {
        let rows = self.data_set_rows();
        let selected = self.selected_data_set();
        if row == self.rows.data_set_number {
            for (row, value) in rows.into_iter().zip(self.sequence.table[selected]) {
                self.objects.set(row, value);
            }
        } else if let Some(field) = rows.iter().position(|field| *field == row) {
            self.sequence.table[selected][field] = self.objects.get(row);
            let used = self.sequence.table.iter().filter(|set| set[TYPE] != 0);
            self.objects
                .set(self.rows.sequence_used, used.count() as i64);
        }
    }

    /// Bit 4 rose; bit 5 a sequence, bit 6 from the data set of 301Bh:A (lxm32m 1721-1724).
    pub(super) fn start_sequence(&mut self) {
        let word = self.servo.controlword;
        if let Phase::Wait(_) = self.sequence.phase {
            self.sequence.edge = true;
            return;
        }
        if self.sequence.phase == Phase::Move {
            return;
        }
        self.sequence.single = !word.has(Controlword::MODE_5);
        if self.sequence.single || word.has(Controlword::MODE_6) {
            let number = self.objects.get(self.rows.sequence_start);
            self.sequence.number = number.clamp(0, DATA_SETS as i64 - 1) as usize;
        }
        self.start_data_set();
    }

    fn start_data_set(&mut self) {
        let set = self.sequence.table[self.sequence.number];
        let capped = self.profile_limits(set[SPEED].saturating_abs());
        let limits = Limits {
            velocity: capped.velocity,
            acceleration: self.acceleration_of(set[ACCELERATION]),
            deceleration: self.acceleration_of(set[DECELERATION]),
        };
        self.sequence.phase = Phase::Move;
        self.sequence.edge = false;
        let motion = match set[TYPE] {
            ABSOLUTE => Motion::Position(self.target_of(set[TARGET]), limits),
            RELATIVE => {
                Motion::Position(self.ramp.position + self.increments_of(set[TARGET]), limits)
            }
            VELOCITY => Motion::Velocity(limits.velocity.copysign(set[SPEED] as f64), limits),
            _ => Motion::Hold,
        };
        self.begin(motion);
    }

    pub(super) fn step_sequence(&mut self) {
        let set = self.sequence.table[self.sequence.number];
        match self.sequence.phase {
            Phase::Move if self.data_set_done() => {
                let last = set[TRANSITION] == 0;
                if self.sequence.single || last {
                    self.sequence.phase = Phase::Idle;
                    self.target_reached = !self.sequence.single;
                } else {
                    self.sequence.phase = Phase::Wait(self.servo.now);
                }
            }
            Phase::Wait(since) => {
                let holds = |condition: usize, value: usize| match set[condition] {
                    AT_ONCE => true,
                    AFTER_TIME => {
                        let wait = Duration::from_millis(set[value].max(0) as u64);
                        self.servo.now.saturating_since(since) >= wait
                    }
                    AT_EDGE => self.sequence.edge,
                    _ => false,
                };
                let first = holds(CONDITION, CONDITION_VALUE);
                let second = || holds(CONDITION_2, CONDITION_VALUE_2);
                let go = match set[OPERATOR] {
                    BOTH => first && second(),
                    EITHER => first || second(),
                    _ => first,
                };
                if go {
                    self.sequence.number = set[NEXT].clamp(0, DATA_SETS as i64 - 1) as usize;
                    self.start_data_set();
                }
            }
            _ => {}
        }
    }

    fn data_set_done(&self) -> bool {
        match self.motion {
            Motion::Velocity(target, _) => self.ramp.velocity == target,
            _ => self.is_at_rest() && self.is_in_window(),
        }
    }
}
