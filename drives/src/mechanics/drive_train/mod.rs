//! A feed axis from rotor to load: elasticity, friction, play, gravity, brake and end stops.
//!
//! Everything is seen at the motor's shaft, in rad and N·m. The rotor (with what is stiffly fixed
//! to it) and the load are two inertias; a spring with a damper, the gear, screw, rack or belt,
//! ties them together. With the common motion `c` of both and their twist `q`,
//!
//! ```text
//! c = (J₁ φ₁ + J₂ φ₂) / J      J c̈ = τ₁ + τ₂                                     J = J₁ + J₂
//! q = φ₁ − φ₂                   q̈ + (d/Jᵣ) q̇ + (k/Jᵣ) q = τ₁/J₁ − τ₂/J₂           Jᵣ = J₁ J₂ / J
//! ```
//!
//! two [modes](mode) that know nothing of each other. Seen from the motor there is an antiresonance
//! at √(k/J₂), where the load takes up everything, and a resonance at √(k/Jᵣ).
//!
//! # A step
//!
//! Torques are constant in a step, so that both modes are stepped exactly, however stiff the spring.
//! Three things are not linear:
//!
//! - **Friction, brake, block, stops** are [`reactions`], constant in the step. What they hold is at
//!   rest exactly: neither chatter nor creep. Where a sliding part comes to rest within a step, the
//!   step is cut there, and whether it sticks or turns round is decided anew. A stop takes all speed
//!   in the step in which it would be passed: the load passes it by half a step's travel at most.
//! - **Viscous friction** acts with the mean of the speeds at both ends of the step, which the
//!   linear system of the reactions has in its matrix; **Stribeck friction** with the level at that
//!   mean, by a second pass.
//! - **Play**: while the twist is within it there is neither spring nor damper, another pair of modes.
//!   Where the twist crosses an end of the play, the step is cut too: the instant comes from the cubic
//!   through both ends of the step, and each part is stepped exactly.
//!
//! # What the step's length costs
//!
//! Without friction nothing: energy and motion are right to rounding. The viscous and Stribeck parts
//! and the instant of a reversal err with the square of the step, the instant of a contact with its
//! fourth power. A test halves the step of a motion with friction of every kind, play and gravity:
//! at the drives' 62.5 µs it errs by less than 10⁻⁶ of its travel.
//!
//! Reversals were not cut at first, as they are not in [`rigid`](super::rigid): friction then turns round
//! with the step, up to its length `h` late, which leaves the speed wrong by up to `2 F h / J` until the
//! next reversal. The same motion erred by 7·10⁻⁴, and by half of it with half the step.

mod expansion;
mod lead_error;

pub use expansion::Expansion;
pub use lead_error::LeadError;

use super::friction::Friction;
use super::mode::{Mode, Transition};
use super::reactions::reactions;
use super::{Load, Mechanics, Motion};
use core::f64::consts::TAU;
use nalgebra::{Matrix2, Vector2};

#[cfg(doc)]
use super::mode;

/// Parts of a step that an end of the play may cut it into.
const MOST_PARTS: usize = 8;

/// An end of the play that is reached sooner than this does not cut a step, s.
const SHORTEST_PART: f64 = 1e-9;

/// A feed axis by its figures, all of them at the motor's shaft.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveTrain {
    /// Inertia of the rotor and of what is stiffly fixed to it, kg·m²; above 0.
    pub rotor_inertia: f64,
    /// Inertia of what it moves, kg·m²; above 0 with an elasticity.
    pub load_inertia: f64,
    /// What ties both together; `None`: stiff, one inertia.
    pub elasticity: Option<Elasticity>,
    /// Friction at the rotor: bearings, seals.
    pub bearing: Friction,
    /// Friction at the load: guide, nut.
    pub guide: Friction,
    /// Constant torque on the load, N·m: gravity.
    pub load_torque: f64,
    /// Holding brake on the rotor.
    pub brake: Brake,
    /// Where the load hits its end stops, rad from the encoder's zero: the lower and the upper one.
    pub stops: Option<(f64, f64)>,
    /// How far the load is from where its transmission should have it.
    pub lead_error: LeadError,
    /// By how much that grows with warmth.
    pub expansion: Expansion,
}

/// A gear, screw, rack or belt that gives way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elasticity {
    /// N·m/rad, above 0.
    pub stiffness: f64,
    /// N·m·s/rad.
    pub damping: f64,
    /// Play from flank to flank, rad.
    pub play: f64,
}

impl Elasticity {
    /// Without play, of a stiffness, N·m/rad, with this damping ratio of the free vibration of both inertias, kg·m².
    #[must_use]
    pub fn damped(stiffness: f64, ratio: f64, [rotor, load]: [f64; 2]) -> Self {
        let reduced = rotor * load / (rotor + load);
        Self {
            stiffness,
            damping: 2.0 * ratio * (stiffness * reduced).sqrt(),
            play: 0.0,
        }
    }
}

/// A holding brake that grips without current.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Brake {
    /// Torque that it holds, N·m; 0 without a brake.
    pub torque: f64,
    /// Time from the power stage's switching on until it is open, s.
    pub opening: f64,
    /// Time from the power stage's switching off until it grips, s.
    pub closing: f64,
}

impl Default for DriveTrain {
    /// The default [`Rigid`](super::rigid::Rigid) axis.
    fn default() -> Self {
        let rigid = super::rigid::Rigid::default();
        Self {
            rotor_inertia: rigid.motor_inertia,
            load_inertia: rigid.load_inertia,
            elasticity: None,
            bearing: Friction {
                viscous: rigid.viscous_friction,
                ..Friction::coulomb(rigid.coulomb_friction)
            },
            guide: Friction::default(),
            load_torque: rigid.load_torque,
            brake: Brake {
                torque: rigid.brake_torque,
                ..Brake::default()
            },
            stops: None,
            lead_error: LeadError::default(),
            expansion: Expansion::default(),
        }
    }
}

impl DriveTrain {
    /// Frequency seen from the motor at which the load takes up everything, Hz, and the one at
    /// which both swing against each other; `None` if nothing gives way.
    #[must_use]
    pub fn resonances(&self) -> Option<(f64, f64)> {
        let stiffness = self.elasticity?.stiffness;
        let (rotor, load) = (self.rotor_inertia, self.load_inertia);
        let reduced = rotor * load / (rotor + load);
        Some((
            (stiffness / load).sqrt() / TAU,
            (stiffness / reduced).sqrt() / TAU,
        ))
    }
}

/// A feed axis in motion; see the [module](self).
#[derive(Clone, Debug, PartialEq)]
pub struct FeedAxis {
    train: DriveTrain,
    /// Of rotor and load, rad/s.
    speeds: Vector2<f64>,
    /// Rotor ahead of load, rad.
    twist: f64,
    flank: Flank,
    brake_open: bool,
    /// How long the brake has been commanded to be what it is not, s.
    brake_waits: f64,
    /// On the load from outside in this step, N·m.
    outside: f64,
    /// Since it was switched on, s.
    age: f64,
    /// For the length of step that was taken last: with spring and damper, and within the play.
    tied: Step,
    loose: Step,
}

/// Which flanks touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Flank {
    /// The rotor pushes the load forward.
    Forward,
    /// It pushes it back.
    Backward,
    /// None: the twist is within the play.
    Loose,
}

/// What a step of one length does: all that is linear in it, worked out once. Torques are those of motor,
/// gravity and reactions, on rotor and load.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    dt: f64,
    /// Speeds at the end, from those at the beginning, from the twist of the spring and from torques.
    from_speeds: Matrix2<f64>,
    from_twist: Vector2<f64>,
    inverse: Matrix2<f64>,
    /// Torques that make speeds.
    mass: Matrix2<f64>,
    /// Angles by which both turn, likewise; here viscous friction is one of the torques.
    turned_by_speeds: Matrix2<f64>,
    turned_by_twist: Vector2<f64>,
    turned_by_torques: Matrix2<f64>,
}

/// What cuts a step.
struct Event {
    /// s from its beginning.
    after: f64,
    what: What,
}

enum What {
    /// Rotor (0) or load (1) comes to rest.
    Rests(usize),
    /// The twist comes to an end of the play.
    Touches(Flank, f64),
}

/// What becomes of a sliding part that would turn round within a step.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Turning {
    /// It slides on, and the step is cut where it rests.
    Cut,
    /// Friction stops it by the end of the step if it can.
    Stop,
}

/// Where a step leads.
struct Reached {
    speeds: Vector2<f64>,
    /// By which angle rotor and load have turned, rad.
    turned: Vector2<f64>,
    /// What friction, brake, block and stops did, N·m.
    reaction: Vector2<f64>,
}

impl FeedAxis {
    /// An axis at rest, its spring wound by gravity.
    #[must_use]
    pub fn new(train: DriveTrain) -> Self {
        let mut axis = Self {
            speeds: Vector2::zeros(),
            twist: 0.0,
            flank: Flank::Forward,
            brake_open: false,
            brake_waits: 0.0,
            outside: 0.0,
            age: 0.0,
            tied: Step::none(),
            loose: Step::none(),
            train,
        };
        if let Some(elasticity) = axis.train.elasticity {
            let wound = -axis.train.load_torque / elasticity.stiffness;
            let slack = 0.5 * elasticity.play;
            axis.flank = match wound {
                _ if slack == 0.0 => Flank::Forward,
                0.0 => Flank::Loose,
                _ if wound > 0.0 => Flank::Forward,
                _ => Flank::Backward,
            };
            axis.twist = wound + axis.slack();
        }
        axis
    }

    /// Its figures.
    #[must_use]
    pub fn train(&self) -> &DriveTrain {
        &self.train
    }

    /// How far the load is behind the rotor, rad: twist and play.
    #[must_use]
    pub fn twist(&self) -> f64 {
        self.twist
    }

    /// Speed of the load, rad/s.
    #[must_use]
    pub fn load_speed(&self) -> f64 {
        self.speeds.y
    }

    /// Where the load is while the rotor is at `position`, both in revolutions, its lead error and expansion included.
    #[must_use]
    pub fn load_position(&self, position: f64) -> f64 {
        let nominal = position - self.twist / TAU;
        let DriveTrain {
            lead_error,
            expansion,
            ..
        } = &self.train;
        nominal + lead_error.at(nominal) + expansion.at(nominal, self.age)
    }

    /// Twist at which the flanks that touch do so without force.
    fn slack(&self) -> f64 {
        let play = self.train.elasticity.map_or(0.0, |it| it.play);
        match self.flank {
            Flank::Forward => 0.5 * play,
            Flank::Backward => -0.5 * play,
            Flank::Loose => 0.0,
        }
    }

    /// The flanks that touch once the twist has come there, if others than before, and the twist at
    /// which that changes.
    fn other_flank(&self, twist: f64) -> Option<(Flank, f64)> {
        let slack = 0.5 * self.train.elasticity?.play;
        match self.flank {
            _ if slack == 0.0 => None,
            Flank::Forward => (twist < slack).then_some((Flank::Loose, slack)),
            Flank::Backward => (twist > -slack).then_some((Flank::Loose, -slack)),
            Flank::Loose if twist > slack => Some((Flank::Forward, slack)),
            Flank::Loose if twist < -slack => Some((Flank::Backward, -slack)),
            Flank::Loose => None,
        }
    }

    /// Torque of the brake after `dt` seconds more of a command, N·m.
    fn brake(&mut self, dt: f64, open: bool) -> f64 {
        let Brake {
            torque,
            opening,
            closing,
        } = self.train.brake;
        if open == self.brake_open {
            self.brake_waits = 0.0;
        } else {
            self.brake_waits += dt;
            if self.brake_waits > if open { opening } else { closing } {
                self.brake_open = open;
                self.brake_waits = 0.0;
            }
        }
        if self.brake_open { 0.0 } else { torque }
    }

    /// One step of the axis, whose rotor begins it at `angle`. Returns by which angle it turns.
    fn advance(&mut self, dt: f64, torque: f64, hold: f64, angle: f64) -> f64 {
        let (mut left, mut turned) = (dt, 0.0);
        for _ in 1..MOST_PARTS {
            self.prepare(dt);
            let part;
            let step = if left == dt {
                self.prepared()
            } else {
                part = Step::new(&self.train, left, self.flank);
                &part
            };
            let reached = self.reach(step, torque, hold, angle + turned, Turning::Cut);
            let Some(event) = self.first_event(&reached, left) else {
                return turned + self.accept(&reached);
            };
            if event.after > SHORTEST_PART {
                let step = Step::new(&self.train, event.after, self.flank);
                let reached = self.reach(&step, torque, hold, angle + turned, Turning::Cut);
                turned += self.accept(&reached);
                left -= event.after;
            }
            match event.what {
                What::Rests(side) => self.speeds[side] = 0.0,
                What::Touches(flank, twist) => (self.flank, self.twist) = (flank, twist),
            }
        }
        let step = Step::new(&self.train, left, self.flank);
        let reached = self.reach(&step, torque, hold, angle + turned, Turning::Stop);
        turned + self.accept(&reached)
    }

    /// What happens first in a step of length `dt` that leads there.
    fn first_event(&self, reached: &Reached, dt: f64) -> Option<Event> {
        let mut first: Option<Event> = None;
        let mut note = |after: f64, what: What| {
            if first.as_ref().is_none_or(|first| after < first.after) {
                first = Some(Event { after, what });
            }
        };
        for side in 0..2 {
            let (begin, end) = (self.speeds[side], reached.speeds[side]);
            if begin * end < 0.0 && reached.reaction[side] != 0.0 {
                note(dt * begin / (begin - end), What::Rests(side));
            }
        }
        let twist = self.twist + reached.turned.x - reached.turned.y;
        if let Some((flank, end)) = self.other_flank(twist) {
            let after = self.crossing(reached, twist, end, dt);
            note(after, What::Touches(flank, end));
        }
        first
    }

    /// Works out the step of a length, unless it is that of the step before.
    fn prepare(&mut self, dt: f64) {
        let kept = match self.flank {
            Flank::Loose => &mut self.loose,
            Flank::Forward | Flank::Backward => &mut self.tied,
        };
        if kept.dt != dt {
            *kept = Step::new(&self.train, dt, self.flank);
        }
    }

    /// The step that was worked out last.
    fn prepared(&self) -> &Step {
        match self.flank {
            Flank::Loose => &self.loose,
            Flank::Forward | Flank::Backward => &self.tied,
        }
    }

    /// When the twist crosses an end of the play, s from the beginning of a step of length `dt` that
    /// leads to `twist`: where the cubic with the same ends does.
    fn crossing(&self, reached: &Reached, twist: f64, end: f64, dt: f64) -> f64 {
        let rates = [self.speeds, reached.speeds].map(|speeds| (speeds.x - speeds.y) * dt);
        let ends = [self.twist - end, twist - end];
        let cubic = |s: f64| {
            let (back, square) = (1.0 - s, s * s);
            back * back * ((1.0 + 2.0 * s) * ends[0] + s * rates[0])
                + square * ((3.0 - 2.0 * s) * ends[1] - back * rates[1])
        };
        let (mut before, mut after) = (0.0, 1.0);
        for _ in 0..50 {
            let middle = 0.5 * (before + after);
            match cubic(middle) * ends[1] > 0.0 {
                true => after = middle,
                false => before = middle,
            }
        }
        before * dt
    }

    /// The reactions at these speeds: their bounds at rotor and load.
    fn bounds(
        &self,
        speeds: Vector2<f64>,
        dt: f64,
        hold: f64,
        angle: f64,
    ) -> (Vector2<f64>, Vector2<f64>) {
        let train = &self.train;
        let rotor = train.bearing.level(speeds.x) + hold;
        let load = train.guide.level(speeds.y);
        let (mut least, mut greatest) = (Vector2::new(-rotor, -load), Vector2::new(rotor, load));
        if let Some((lower, upper)) = train.stops {
            let load = angle - self.twist;
            let ahead = load + self.speeds.y * dt;
            if load.max(ahead) >= upper {
                least.y = f64::NEG_INFINITY;
            }
            if load.min(ahead) <= lower {
                greatest.y = f64::INFINITY;
            }
        }
        (least, greatest)
    }

    /// Where a step leads under a torque of the motor, with what holds the rotor besides friction.
    fn reach(&self, step: &Step, torque: f64, hold: f64, angle: f64, turning: Turning) -> Reached {
        let begin = self.speeds;
        let twist = self.twist - self.slack();
        let torques = Vector2::new(torque, self.train.load_torque + self.outside);
        let sliding = times(&step.from_speeds, begin)
            + step.from_twist * twist
            + times(&step.inverse, torques);
        let held = |speeds: Vector2<f64>| {
            let (least, greatest) = self.bounds(speeds, step.dt, hold, angle);
            self.hold_back(step, sliding, least, greatest, turning)
        };
        let (mut reaction, mut speeds) = held(begin);
        let falls = self.train.bearing.falls() || self.train.guide.falls();
        if falls && speeds + begin != Vector2::zeros() {
            (reaction, speeds) = held(0.5 * (begin + speeds));
        }
        let viscous = Vector2::new(self.train.bearing.viscous, self.train.guide.viscous);
        let total = torques + reaction - 0.5 * viscous.component_mul(&(begin + speeds));
        let mut turned = times(&step.turned_by_speeds, begin)
            + step.turned_by_twist * twist
            + times(&step.turned_by_torques, total);
        for side in 0..2 {
            if begin[side] == 0.0 && speeds[side] == 0.0 {
                turned[side] = 0.0;
            }
        }
        Reached {
            speeds,
            turned,
            reaction,
        }
    }

    /// The reactions of a step that would end with the speeds `sliding`, and those it ends with.
    fn hold_back(
        &self,
        step: &Step,
        sliding: Vector2<f64>,
        mut least: Vector2<f64>,
        mut greatest: Vector2<f64>,
        turning: Turning,
    ) -> (Vector2<f64>, Vector2<f64>) {
        if turning == Turning::Cut {
            for side in 0..2 {
                // What slides has all the friction against it, unless something blocks it.
                if self.speeds[side] > 0.0 && least[side].is_finite() {
                    greatest[side] = least[side];
                } else if self.speeds[side] < 0.0 && greatest[side].is_finite() {
                    least[side] = greatest[side];
                }
            }
        }
        let reaction = match least == greatest {
            true => least,
            false => reactions(&step.mass, &step.inverse, &sliding, &least, &greatest),
        };
        let mut speeds = sliding + times(&step.inverse, reaction);
        for side in 0..2 {
            // What is held is at rest, not only nearly.
            if least[side] < reaction[side] && reaction[side] < greatest[side] {
                speeds[side] = 0.0;
            }
        }
        (reaction, speeds)
    }

    /// Takes a step; returns by which angle the rotor turns.
    fn accept(&mut self, reached: &Reached) -> f64 {
        self.speeds = reached.speeds;
        self.twist += reached.turned.x - reached.turned.y;
        reached.turned.x
    }

    /// The same where rotor and load are one.
    fn advance_stiff(&mut self, dt: f64, torque: f64, hold: f64, angle: f64) -> f64 {
        self.prepare(dt);
        let step = self.prepared();
        let (turned, end) = self.reach_stiff(step, torque, hold, angle, Turning::Cut);
        let begin = self.speeds.x;
        let until = dt * begin / (begin - end);
        if begin * end >= 0.0 || until < SHORTEST_PART {
            self.speeds = Vector2::new(end, end);
            return turned;
        }
        let step = Step::new(&self.train, until, self.flank);
        let (turned, _) = self.reach_stiff(&step, torque, hold, angle, Turning::Cut);
        self.speeds = Vector2::zeros();
        let step = Step::new(&self.train, dt - until, self.flank);
        let (on, end) = self.reach_stiff(&step, torque, hold, angle + turned, Turning::Stop);
        self.speeds = Vector2::new(end, end);
        turned + on
    }

    /// By which angle both turn in a step, and the speed that it leads to.
    fn reach_stiff(
        &self,
        step: &Step,
        torque: f64,
        hold: f64,
        angle: f64,
        turning: Turning,
    ) -> (f64, f64) {
        let train = &self.train;
        let begin = self.speeds.x;
        let torque = torque + train.load_torque + self.outside;
        let added = step.inverse.m11;
        let free = step.from_speeds.m11 * begin + added * torque;
        let reach = |mean: f64| {
            let at = Vector2::new(mean, mean);
            let (least, greatest) = self.bounds(at, step.dt, hold, angle);
            let (least, greatest) = (least.x + least.y, greatest.x + greatest.y);
            let reaction = match turning {
                Turning::Cut if begin > 0.0 && least.is_finite() => least,
                Turning::Cut if begin < 0.0 && greatest.is_finite() => greatest,
                _ => (-free / added).clamp(least, greatest),
            };
            let is_held = least < reaction && reaction < greatest;
            let end = free + added * reaction;
            (reaction, if is_held { 0.0 } else { end })
        };
        let (mut reaction, mut end) = reach(begin);
        if (train.bearing.falls() || train.guide.falls()) && begin + end != 0.0 {
            (reaction, end) = reach(0.5 * (begin + end));
        }
        let turned = match begin == 0.0 && end == 0.0 {
            true => 0.0,
            false => {
                let torque = torque + reaction;
                step.turned_by_speeds.m11 * begin + step.turned_by_torques.m11 * torque
            }
        };
        (turned, end)
    }
}

/// A product, written out: nalgebra's is a call for each column.
fn times(matrix: &Matrix2<f64>, vector: Vector2<f64>) -> Vector2<f64> {
    Vector2::new(
        matrix.m11 * vector.x + matrix.m12 * vector.y,
        matrix.m21 * vector.x + matrix.m22 * vector.y,
    )
}

impl Step {
    /// Of no length: for none that is asked for.
    fn none() -> Self {
        Self {
            dt: 0.0,
            from_speeds: Matrix2::identity(),
            from_twist: Vector2::zeros(),
            inverse: Matrix2::zeros(),
            mass: Matrix2::zeros(),
            turned_by_speeds: Matrix2::zeros(),
            turned_by_twist: Vector2::zeros(),
            turned_by_torques: Matrix2::zeros(),
        }
    }

    fn new(train: &DriveTrain, dt: f64, flank: Flank) -> Self {
        match train.elasticity {
            None => Self::stiff(train, dt),
            Some(_) if flank == Flank::Loose => Self::elastic(train, dt, Mode::FREE),
            Some(elasticity) => {
                let (rotor, load) = (train.rotor_inertia, train.load_inertia);
                let reduced = rotor * load / (rotor + load);
                let mode = Mode {
                    stiffness: elasticity.stiffness / reduced,
                    decay: 0.5 * elasticity.damping / reduced,
                };
                Self::elastic(train, dt, mode)
            }
        }
    }

    /// Rotor and load as one, in the first place of everything.
    fn stiff(train: &DriveTrain, dt: f64) -> Self {
        let inertia = train.rotor_inertia + train.load_inertia;
        let mode = Mode {
            stiffness: 0.0,
            decay: 0.5 * (train.bearing.viscous + train.guide.viscous) / inertia,
        };
        let Transition { state, input } = mode.after(dt);
        let first = |value: f64| Matrix2::new(value, 0.0, 0.0, 0.0);
        Self {
            dt,
            from_speeds: first(state.m22),
            inverse: first(input.y / inertia),
            turned_by_speeds: first(state.m12),
            turned_by_torques: first(input.x / inertia),
            ..Self::none()
        }
    }

    fn elastic(train: &DriveTrain, dt: f64, mode: Mode) -> Self {
        let (rotor, load) = (train.rotor_inertia, train.load_inertia);
        let sum = rotor + load;
        let Transition { state, input } = mode.after(dt);
        // Of common motion and twist, from rotor and load, and back.
        let modes = Matrix2::new(rotor / sum, load / sum, 1.0, -1.0);
        let parts = Matrix2::new(1.0, load / sum, 1.0, -rotor / sum);
        let accelerations = Matrix2::new(1.0 / sum, 1.0 / sum, 1.0 / rotor, -1.0 / load);
        let both = |common: f64, twist: f64| Matrix2::new(common, 0.0, 0.0, twist);
        // Without viscous friction; what torques add to the speeds is symmetric.
        let speeds = parts * both(1.0, state.m22) * modes;
        let shared = (dt - input.y) / sum;
        let added = Matrix2::new(
            dt / sum + load / (sum * rotor) * input.y,
            shared,
            shared,
            dt / sum + rotor / (sum * load) * input.y,
        );
        let twist = parts.column(1);
        let unmoved = added.try_inverse().unwrap_or_else(Matrix2::identity);
        // With it: mass v₁ = unmoved (v without it) − b/2 v₀, where mass = unmoved + b/2.
        let viscous = Vector2::new(train.bearing.viscous, train.guide.viscous);
        let viscous = Matrix2::from_diagonal(&(0.5 * viscous));
        let mass = unmoved + viscous;
        let inverse = mass.try_inverse().unwrap_or_else(Matrix2::identity);
        Self {
            dt,
            from_speeds: inverse * (unmoved * speeds - viscous),
            from_twist: inverse * (unmoved * (twist * state.m21)),
            inverse,
            mass,
            turned_by_speeds: parts * both(dt, state.m12) * modes,
            turned_by_twist: twist * (state.m11 - 1.0),
            turned_by_torques: parts * both(0.5 * dt * dt, input.x) * accelerations,
        }
    }
}

impl Mechanics for FeedAxis {
    /// `loads` and `motions` are those of one shaft.
    fn step(&mut self, dt: f64, loads: &[Load], motions: &mut [Motion]) {
        let ([load], [shaft]) = (loads, motions) else {
            return;
        };
        self.age += dt;
        self.outside = load.outside;
        let brake = self.brake(dt, load.brake_open);
        let hold = if load.blocked { f64::INFINITY } else { brake };
        let angle = shaft.position * TAU;
        let turned = match self.train.elasticity {
            None => self.advance_stiff(dt, load.torque, hold, angle),
            Some(_) => self.advance(dt, load.torque, hold, angle),
        };
        shaft.acceleration = 0.0;
        shaft.position += turned * (1.0 / TAU);
        shaft.velocity = self.speeds.x * (1.0 / TAU);
    }
}

#[cfg(test)]
mod tests;
