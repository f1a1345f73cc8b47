//! The machines of a day, and by what their axes are homed on it.

use syncline_controller::machine::Machine;
use syncline_controller::session::Direction;
use syncline_drives::model::{Increments, Scaling};
use syncline_tests::rig::example;

/// An example machine whose axes are homed.
pub(super) struct Scene {
    pub(super) machine: &'static str,
    /// Of X, Y and Z.
    pub(super) axes: [Axis; 3],
    /// The name of Y's drive and its place among the drives.
    pub(super) y: (&'static str, usize),
    /// `[retraction]`: the way back to a path has legs.
    pub(super) retracts: bool,
}

/// An axis of a scene.
pub(super) struct Axis {
    /// Its drives, as the file of the machine names them.
    drives: &'static [&'static str],
    /// Where it stands when it is switched on.
    pub(super) start: f64,
    /// By how much its second drive stands further then.
    pub(super) skew: f64,
    /// Of the edge at which its switches come on, and to which side it is searched.
    pub(super) edge: f64,
    pub(super) direction: Direction,
    /// The drives' own methods by which it is found, without the index pulse and with it.
    methods: [u8; 2],
}

/// How an axis comes to know where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Way {
    /// By switches whose edges its drives capture.
    Captured,
    /// By switches, from samples.
    Sampled,
    /// By the index of its motor's encoder behind the edge of a switch.
    Index,
    /// Its drive searches a reference switch by itself.
    Drive,
    /// The same, and the index pulse behind it.
    DriveIndex,
    HardStop,
    /// Its encoders are absolute.
    Encoder,
    /// Where a person says that it stands.
    SetHere,
}

impl Way {
    /// The controller searches switches.
    pub(super) fn is_by_switch(self) -> bool {
        matches!(self, Self::Captured | Self::Sampled | Self::Index)
    }
}

pub(super) const PORTAL: Scene = Scene {
    machine: "portal",
    axes: [
        Axis {
            drives: &["X1", "X2"],
            start: 60.0,
            skew: 2.0,
            edge: -4.0,
            direction: Direction::Negative,
            methods: [0, 0],
        },
        Axis {
            drives: &["Y"],
            start: 30.0,
            skew: 0.0,
            edge: -4.0,
            direction: Direction::Negative,
            methods: [27, 11],
        },
        Axis {
            drives: &["Z"],
            start: -40.0,
            skew: 0.0,
            edge: 3.0,
            direction: Direction::Positive,
            methods: [23, 7],
        },
    ],
    y: ("node 3 (Y, LXM32M)", 2),
    retracts: false,
};

pub(super) const XYZ: Scene = Scene {
    machine: "xyz",
    axes: [
        Axis {
            drives: &["left-right"],
            start: -200.0,
            skew: 0.0,
            edge: -254.0,
            direction: Direction::Negative,
            // Its drive counts the other way, as that of Z.
            methods: [23, 7],
        },
        Axis {
            drives: &["front-back"],
            start: -190.0,
            skew: 0.0,
            edge: -204.0,
            direction: Direction::Negative,
            methods: [27, 11],
        },
        Axis {
            drives: &["up-down"],
            start: 5.0,
            skew: 0.0,
            edge: 24.0,
            direction: Direction::Positive,
            methods: [27, 11],
        },
    ],
    y: ("node 9 (front-back, LXM32M)", 1),
    retracts: true,
};

/// How far an axis goes from where it begins to be homed, at most, mm.
pub(super) const FAR: f64 = 120.0;
/// What stops an axis nearer than that is no hard stop, mm.
pub(super) const NEAR: f64 = 12.0;
/// A drive's reference point is behind the edge of its switch by so many increments (3028h:7).
const BEHIND: i64 = 200;

impl Axis {
    pub(super) fn sign(&self) -> f64 {
        self.direction.of(1.0)
    }

    pub(super) fn is_gantry(&self) -> bool {
        self.drives.len() > 1
    }

    /// How its first drive counts.
    fn scaling(&self, machine: &Machine) -> Scaling {
        let mut drives = machine.drives.iter();
        let drive = drives.find(|drive| drive.name.as_str() == self.drives[0]);
        drive.expect("it is in the file").scaling
    }

    /// The first index behind a place, as its first drive counts.
    pub(super) fn index_behind(&self, machine: &Machine, place: f64) -> f64 {
        let scaling = self.scaling(machine);
        let turn = scaling.revolution().get();
        let at = scaling.to_increments(place).expect("it is in range").get();
        let turns = [at.div_euclid(turn), at.div_euclid(turn) + 1];
        let places = turns.map(|turns| scaling.to_mm(Increments::new(turns * turn)));
        let behind = |it: &f64| self.sign() * (it - place) >= 0.0;
        places.into_iter().find(behind).expect("one of both is")
    }

    /// What its drive calls its reference point.
    fn reference_point(&self, machine: &Machine, way: Way) -> f64 {
        let resolution = self.scaling(machine).resolution();
        let outside = self.edge - self.sign() * BEHIND as f64 * resolution;
        match way {
            // In front of the switch, as it goes off that.
            Way::DriveIndex => {
                let mirrored = Self {
                    direction: match self.direction {
                        Direction::Positive => Direction::Negative,
                        Direction::Negative => Direction::Positive,
                    },
                    ..*self
                };
                mirrored.index_behind(machine, outside)
            }
            _ => outside,
        }
    }

    /// Its `[[input]]`s, its `[axis.homing]` and its `[axis.simulation]`. Nothing switches its inputs where `is_played`.
    fn tables(
        &self,
        machine: &Machine,
        way: Way,
        order: u8,
        is_played: bool,
    ) -> (String, String, String) {
        let Self { start, edge, .. } = *self;
        let (side, on, beyond) = match self.direction {
            Direction::Positive => ("positive", [edge, 60.0], [-400.0, edge + 60.0]),
            Direction::Negative => ("negative", [-300.0, edge], [edge - 60.0, 1100.0]),
        };
        let mut inputs = String::new();
        let mut homing = match way {
            Way::Encoder => "kind = \"encoder\"".to_owned(),
            _ => format!("order = {order}, jog_distance = 500.0"),
        };
        let mut simulation = format!("start = {start:?}");
        if self.skew != 0.0 && way != Way::SetHere {
            simulation += &format!(", start_skew = {:?}", self.skew);
        }
        let final_position = "final_position = 0.0";
        let search = format!("direction = \"{side}\", max_distance = {FAR:?}, {final_position}");
        match way {
            Way::Captured | Way::Sampled | Way::Index => {
                let names: Vec<_> = (self.drives.iter())
                    .map(|drive| format!("\"home {drive}\""))
                    .collect();
                for (name, drive) in names.iter().zip(self.drives) {
                    inputs += &format!(
                        "[[input]]\nname = {name}\ndrive = \"{drive}\"\nsignal = \"DI0\"\nfunction = \"home\"\n"
                    );
                    if !is_played {
                        inputs += &format!("simulated = {on:?}\n");
                    }
                    inputs.push('\n');
                }
                let position = match way {
                    Way::Index => self.index_behind(machine, edge),
                    _ => edge,
                };
                homing += &format!(
                    ", kind = \"switch\", switches = [{}], speed = 60.0, slow_speed = 2.0, back_off = 3.0, \
                     position = {position:?}, latch = {}, index = {}, {search}",
                    names.join(", "),
                    way != Way::Sampled,
                    way == Way::Index,
                );
            }
            Way::Drive | Way::DriveIndex => {
                let method = self.methods[usize::from(way == Way::DriveIndex)];
                homing += &format!(
                    ", kind = \"drive\", method = {method}, speed = 60.0, slow_speed = 4.0, position = {:?}, \
                     max_distance = {FAR:?}, {final_position}",
                    self.reference_point(machine, way)
                );
                simulation += &format!(", reference_switch = {on:?}, limit_switches = {beyond:?}");
            }
            Way::HardStop => {
                homing += &format!(
                    ", kind = \"hard_stop\", weight = \"none\", torque = 30.0, speed = 8.0, back_off = 5.0, \
                     min_distance = {NEAR:?}, position = {edge:?}, {search}"
                );
                let other = edge - self.sign() * 3000.0;
                simulation += &format!(
                    ", end_stops = [{:?}, {:?}]",
                    edge.min(other),
                    edge.max(other)
                );
            }
            Way::Encoder => {}
            Way::SetHere => homing += ", kind = \"set_here\", position = 0.0",
        }
        if self.is_gantry() {
            homing += ", max_skew = 3.0";
        }
        (inputs, homing, simulation)
    }
}

impl Scene {
    /// What is replaced in the example's file, and by what. Nothing switches the inputs of an axis that is `played`.
    pub(super) fn replacements(
        &self,
        ways: [Way; 3],
        played: Option<usize>,
    ) -> Vec<(String, String)> {
        let machine = example(self.machine);
        let mut tables = String::new();
        let mut changes = Vec::new();
        for (place, (order, axis)) in [2, 2, 1].into_iter().zip(&self.axes).enumerate() {
            let quoted: Vec<_> = (axis.drives.iter())
                .map(|drive| format!("\"{drive}\""))
                .collect();
            let is_played = played == Some(place);
            let (inputs, homing, simulation) = axis.tables(&machine, ways[place], order, is_played);
            tables += &inputs;
            let drives = format!("drives = [{}]", quoted.join(", "));
            let homing =
                format!("{drives}\nhoming = {{ {homing} }}\nsimulation = {{ {simulation} }}");
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
