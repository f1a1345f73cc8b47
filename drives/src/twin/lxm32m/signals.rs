//! Signals: capture inputs, position registers, digital inputs and outputs.
//!
//! The touch probe objects 60B8h…60BDh are coded as CiA 402 has them. Of the vendor's own, the
//! manual at hand prints names only (lxm32m 2300-2371): their values are assumptions.

use super::drive::Drive;
use crate::twin::lxm32m::units::INCREMENTS_PER_REVOLUTION;
use crate::twin::node::Firmware;
use crate::twin::rounding::nearest;
use syncline_canopen::cia402::State;
use syncline_canopen::dictionary::Row;
use syncline_canopen::sdo::AbortCode;

/// Capture inputs.
pub(super) const CAPTURES: usize = 2;

/// Of one probe in 60B8h and 60B9h.
const PROBE_BITS: u32 = 8;
/// Bits of 60B8h: on; every event, not only the first; another source than the input; sample at
/// the rising, at the falling edge.
const ENABLE: i64 = 1 << 0;
const CONTINUOUS: i64 = 1 << 1;
const OTHER_SOURCE: i64 = 0b1100;
const RISING: i64 = 1 << 4;
const FALLING: i64 = 1 << 5;
/// Bits of 60B9h: on; a position of the rising, of the falling edge is stored.
const STORED_RISE: i64 = 1 << 1;
const STORED_FALL: i64 = 1 << 2;

/// `CapNConfig`: falling, rising edge; anything else is both.
const EDGE_FALLING: i64 = 0;
const EDGE_RISING: i64 = 1;
/// `CapNActivate`.
const CAPTURE_ONCE: i64 = 1;
const CAPTURE_CONTINUOUSLY: i64 = 2;

/// `IOfunc_DQn`: set by 3008h:11, off while there is an error, on while the power stage is.
const OUTPUT_FREE: i64 = 1;
const OUTPUT_NO_FAULT: i64 = 2;
const OUTPUT_ACTIVE: i64 = 3;

/// What was seen of the capture inputs at the last look.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Captures {
    /// Their levels; none before the first look.
    levels: [Option<bool>; CAPTURES],
    /// Where the load was, revolutions of the shaft.
    position: f64,
    /// Where the shaft was as something touched that is not along the axis.
    touched: [Option<f64>; CAPTURES],
}

impl Captures {
    /// The next edge of an input is where the shaft was then.
    pub(super) fn touch(&mut self, input: u8, place: f64) {
        if let Some(touched) = self.touched.get_mut(usize::from(input)) {
            *touched = Some(place);
        }
    }
}

impl Drive {
    /// Looks after the capture inputs. What is captured is where the shaft was at the edge, however far it
    /// has turned since; of an edge that does not come from the place of its load, where it is.
    pub(super) fn watch_captures(&mut self) {
        let position = self.carriage();
        let turned = self.captures.position.min(position)..=self.captures.position.max(position);
        self.captures.position = position;
        for input in 0..CAPTURES {
            let level = self.capture_level(input, position);
            let before = self.captures.levels[input].replace(level);
            if before.is_some_and(|before| before != level) {
                let edge = self
                    .switches
                    .edges(input)
                    .find(|edge| turned.contains(edge));
                let touched = self.captures.touched[input].take();
                let shaft = self.servo.loops.shaft.position();
                let edge = edge.map(|edge| edge + (shaft - position));
                let edge = edge.or(touched).unwrap_or(shaft);
                let edge = edge * self.servo.loops.direction();
                let increments = nearest(edge * INCREMENTS_PER_REVOLUTION);
                let captured = self.user_position(increments - self.zero);
                self.probe(input, level, captured);
                self.capture(input, level, captured);
            }
        }
    }

    /// Where what trips the switches along the axis is, revolutions: its load.
    pub(super) fn carriage(&self) -> f64 {
        self.servo.loops.shaft.load_position()
    }

    /// The level of a capture input while the load is there.
    fn capture_level(&self, input: usize, position: f64) -> bool {
        let range = self.switches.captures[input].as_ref();
        range.is_some_and(|range| range.contains(&position))
            || self.switches.is_sensed(input, position)
    }

    /// An edge at a touch probe of CiA 402.
    fn probe(&mut self, input: usize, rising: bool, position: i64) {
        let rows = self.rows;
        let shift = PROBE_BITS * input as u32;
        let function = self.objects.get(rows.probe_function) >> shift;
        let status = self.objects.get(rows.probe_status);
        let (wanted, stored, shown, counter) = match (rising, input) {
            (true, 0) => (RISING, STORED_RISE, rows.probe_1_rise, rows.probe_1_rises),
            (true, _) => (RISING, STORED_RISE, rows.probe_2_rise, rows.probe_2_rises),
            (false, 0) => (FALLING, STORED_FALL, rows.probe_1_fall, rows.probe_1_falls),
            (false, _) => (FALLING, STORED_FALL, rows.probe_2_fall, rows.probe_2_falls),
        };
        let armed = function & (ENABLE | wanted) == ENABLE | wanted;
        let first = status & stored << shift == 0;
        if !armed || !(first || function & CONTINUOUS != 0) {
            return;
        }
        self.objects.set(shown, position);
        self.objects
            .set(rows.probe_status, status | stored << shift);
        self.count(counter);
        let counters = [
            rows.probe_1_rises,
            rows.probe_1_falls,
            rows.probe_2_rises,
            rows.probe_2_falls,
        ];
        let low = |(place, row): (u32, &Row)| (self.objects.get(*row) & 0xF) << (4 * place);
        let together = (0..).zip(&counters).map(low).sum();
        self.objects.set(rows.probe_counters, together);
    }

    /// An edge at one of the vendor's own captures.
    fn capture(&mut self, input: usize, rising: bool, position: i64) {
        let rows = self.rows;
        let (edge, start) = [
            (rows.capture_1_edge, rows.capture_1_start),
            (rows.capture_2_edge, rows.capture_2_start),
        ][input];
        let wanted = match self.objects.get(edge) {
            EDGE_FALLING => !rising,
            EDGE_RISING => rising,
            _ => true,
        };
        let status = self.objects.get(rows.capture_status);
        let (shown, counter) = match (self.objects.get(start), input) {
            (CAPTURE_ONCE, _) if status & 1 << input != 0 => return,
            (CAPTURE_ONCE, 0) => (rows.capture_1_position, rows.capture_1_count),
            (CAPTURE_ONCE, _) => (rows.capture_2_position, rows.capture_2_count),
            (CAPTURE_CONTINUOUSLY, 0) => (
                rows.capture_1_position_continuous,
                rows.capture_1_count_continuous,
            ),
            (CAPTURE_CONTINUOUSLY, _) => (
                rows.capture_2_position_continuous,
                rows.capture_2_count_continuous,
            ),
            _ => return,
        };
        if wanted {
            self.objects.set(shown, position);
            self.objects.set(rows.capture_status, status | 1 << input);
            self.count(counter);
        }
    }

    fn count(&mut self, counter: Row) {
        let count = self.objects.get(counter) as u16;
        self.objects.set(counter, count.wrapping_add(1).into());
    }

    /// Whether a value may be written to 60B8h: the inputs are the only source.
    pub(super) fn check_probe_function(value: i64) -> Result<(), AbortCode> {
        match value & (OTHER_SOURCE | OTHER_SOURCE << PROBE_BITS) {
            0 => Ok(()),
            _ => Err(AbortCode::InvalidValue),
        }
    }

    /// A row of this module has been written.
    pub(super) fn signal_written(&mut self, row: Row) {
        let rows = self.rows;
        let starts = [rows.capture_1_start, rows.capture_2_start];
        if row == rows.probe_function {
            let function = self.objects.get(row);
            let status = self.objects.get(rows.probe_status);
            let kept = |shift: u32| {
                let edges = function >> shift & (RISING | FALLING);
                match function >> shift & ENABLE {
                    0 => 0,
                    on => (on | status >> shift & edges >> 3) << shift,
                }
            };
            self.objects
                .set(rows.probe_status, kept(0) | kept(PROBE_BITS));
        } else if let Some(input) = starts.iter().position(|start| *start == row) {
            let status = self.objects.get(rows.capture_status);
            self.objects
                .set(rows.capture_status, status & !(1 << input));
        } else if row == rows.register_group_start {
            let together = self.objects.get(row);
            for (channel, [start, ..]) in (0..).zip(self.position_registers()) {
                self.objects.set(start, together >> channel & 1);
            }
        }
    }

    /// Start, mode, A and B of each channel.
    fn position_registers(&self) -> [[Row; 4]; 4] {
        let r = &self.rows;
        [
            [
                r.register_1_start,
                r.register_1_mode,
                r.register_1_a,
                r.register_1_b,
            ],
            [
                r.register_2_start,
                r.register_2_mode,
                r.register_2_a,
                r.register_2_b,
            ],
            [
                r.register_3_start,
                r.register_3_mode,
                r.register_3_a,
                r.register_3_b,
            ],
            [
                r.register_4_start,
                r.register_4_mode,
                r.register_4_a,
                r.register_4_b,
            ],
        ]
    }

    /// Whether the criterion of each channel of the position register is met at `position` in usr_p.
    pub(super) fn registers(&self, position: i64) -> [bool; 4] {
        let met = |[start, mode, a, b]: [Row; 4]| {
            let [start, mode, a, b] = [start, mode, a, b].map(|row| self.objects.get(row));
            let within = (a..=b).contains(&position);
            start != 0
                && match mode {
                    0 => position >= a,
                    1 => position <= a,
                    2 => within,
                    _ => !within,
                }
        };
        self.position_registers().map(met)
    }

    /// Brings what shows signals up to date; `position` in usr_p.
    pub(super) fn publish_signals(&mut self, position: i64) {
        let rows = self.rows;
        let bit = |(place, on): (i64, bool)| i64::from(on) << place;
        let registers = (0..).zip(self.registers(position)).map(bit).sum();
        let (inputs, outputs) = (self.inputs(), self.output_levels());
        let inputs = (0..).zip(inputs).map(bit).sum();
        let outputs = (0..).zip(outputs).map(bit).sum();
        self.objects.set(rows.register_status, registers);
        self.objects.set(rows.inputs, inputs);
        self.objects.set(rows.outputs, outputs);
        self.objects
            .set(rows.inputs_and_outputs, inputs | outputs << PROBE_BITS);
    }

    /// DI0…DI4: capture inputs 1 and 2, LIMP, LIMN and REF; on all six, DI5 among them, what else is wired there. Each 1 while active.
    fn inputs(&self) -> [bool; 6] {
        let position = self.carriage();
        let switches = [
            self.capture_level(0, position),
            self.capture_level(1, position),
            self.switches.positive_limit_active(position),
            self.switches.negative_limit_active(position),
            self.switches.reference_active(position),
            false,
        ];
        core::array::from_fn(|input| switches[input] || self.switches.is_sensed(input, position))
    }

    /// DQ0…DQ2.
    pub(super) fn output_levels(&self) -> [bool; 3] {
        let rows = &self.rows;
        let set = self.objects.get(rows.outputs_set);
        let functions = [
            rows.output_0_function,
            rows.output_1_function,
            rows.output_2_function,
        ];
        let mut place = 0..;
        functions.map(|function| {
            let place = place.next().unwrap_or(0);
            match self.objects.get(function) {
                OUTPUT_FREE => set >> place & 1 != 0,
                OUTPUT_NO_FAULT => {
                    self.servo.errors.active().is_none()
                        && self.servo.state != State::NotReadyToSwitchOn
                }
                OUTPUT_ACTIVE => self.is_powered(),
                function => self.tells_window(function),
            }
        })
    }
}
