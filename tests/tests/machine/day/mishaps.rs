//! What goes wrong in the morning as an axis is homed, by each way of homing: it is told as what it is, everything rests, the
//! axis is moved back by a jog, and is homed in the end.

use super::scenes::{FAR, NEAR, Scene, Way};
use super::whole::Day;
use crate::homing::{failure, home, truth};
use syncline_controller::control::{Event, HomingFailure, State};
use syncline_controller::session::{Command, Override};
use syncline_drives::twin::{Disturbance, ErrorClass};

/// How the switches of an axis behave, which a test plays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Wiring {
    Sound,
    /// They never come on.
    Absent,
    /// They are on wherever the axis is.
    Stuck,
    /// Once they came on they stay so.
    Sticky {
        came_on: bool,
    },
    /// Once they went off they come on no more.
    Loose {
        came_on: bool,
        is_gone: bool,
    },
    /// That of the second side never comes on.
    OneSide,
    /// They sit elsewhere, mm.
    At(f64),
}

impl Wiring {
    /// Whether the switch of a side is on, which would be if it was sound.
    pub(super) fn is_on(&mut self, side: usize, beyond: impl Fn(Option<f64>) -> bool) -> bool {
        let sound = beyond(None);
        match self {
            Self::Sound => sound,
            Self::Absent => false,
            Self::Stuck => true,
            Self::Sticky { came_on } => {
                *came_on |= sound;
                *came_on
            }
            Self::Loose { came_on, is_gone } => {
                *is_gone |= *came_on && !sound;
                *came_on |= sound;
                sound && !*is_gone
            }
            Self::OneSide => sound && side == 0,
            Self::At(edge) => beyond(Some(*edge)),
        }
    }
}

/// What goes wrong.
#[derive(Clone, Copy, Debug)]
enum Mishap {
    /// Its switches are not as they should be.
    Wired(Wiring, HomingFailure),
    /// An index is so near to the edge, in parts of a turn, that it may be another one some day.
    IndexNear(f64),
    /// Something holds a side on its way; both of them where that is `None`.
    Blocked(Option<usize>, HomingFailure),
    /// What had stopped it gives way.
    GaveWay,
    /// It begins nearer to its stop than that may be, or further from its place than it may go.
    From(f64, HomingFailure),
    /// An operator's feed hold.
    Held,
    /// The rapid override is 0.
    NoSpeed,
    /// Its drive tells an error.
    DriveError,
}

fn mishaps(way: Way, is_gantry: bool) -> Vec<Mishap> {
    use HomingFailure::{
        BlockedBefore, Holds, Lost, NeverOff, NoStop, NotFound, NotHome, OneSide, SideJammed,
        StaysOn, TooEarly, TooFar,
    };
    use Mishap::{Blocked, DriveError, From, GaveWay, Held, IndexNear, NoSpeed, Wired};
    let loose = Wiring::Loose {
        came_on: false,
        is_gone: false,
    };
    let mut mishaps = match way {
        Way::Captured | Way::Sampled | Way::Index => vec![
            Wired(Wiring::Absent, NotFound),
            Wired(Wiring::Stuck, NeverOff),
            Wired(Wiring::Sticky { came_on: false }, StaysOn),
            Wired(loose, Lost),
            Blocked(None, BlockedBefore),
            Held,
            NoSpeed,
        ],
        Way::Drive | Way::DriveIndex => vec![
            From(FAR + 30.0, TooFar),
            Blocked(None, NotHome),
            DriveError,
            Held,
        ],
        Way::HardStop => vec![
            From(FAR + 30.0, NoStop),
            From(0.5 * NEAR, TooEarly),
            Blocked(None, Holds),
            GaveWay,
            Held,
            NoSpeed,
        ],
        Way::Encoder | Way::SetHere => Vec::new(),
    };
    if is_gantry && way.is_by_switch() {
        mishaps.extend([
            Wired(Wiring::OneSide, OneSide { side: 1 }),
            Blocked(Some(0), SideJammed { side: 0 }),
            Blocked(Some(1), SideJammed { side: 1 }),
        ]);
    }
    if way == Way::Index {
        mishaps.extend([IndexNear(0.01), IndexNear(0.985)]);
    }
    mishaps
}

impl Day {
    /// Everything that goes wrong with the axis that is tried, one after the other.
    pub(super) fn try_in_vain(&mut self, scene: &Scene) {
        let way = self.ways[self.tried];
        for mishap in mishaps(way, scene.axes[self.tried].is_gantry()) {
            // So far from its edge does it begin, but as another place is what goes wrong.
            let far = match mishap {
                Mishap::From(far, _) => far,
                _ => 50.0,
            };
            self.jog_back(scene, far);
            self.meet(scene, mishap);
            self.assert_rests();
            assert!(!self.status().referenced[self.tried], "{mishap:?}");
        }
        self.wiring = Wiring::Sound;
        if way != Way::Encoder {
            self.jog_back(scene, 50.0);
        }
    }

    /// The axis that is tried, by a jog, so far in front of its edge.
    fn jog_back(&mut self, scene: &Scene, far: f64) {
        let axis = &scene.axes[self.tried];
        let there = axis.edge - axis.sign() * far;
        let drive = self.tried_drives()[0];
        let distance = there - truth(&mut self.rig, drive);
        if distance.abs() > 0.01 {
            self.jog(self.tried_letter(), distance, State::Ready);
        }
    }

    fn meet(&mut self, scene: &Scene, mishap: Mishap) {
        self.rig.events.clear();
        let homing = home(self.tried_letter());
        let drives = self.tried_drives();
        let expected = match mishap {
            Mishap::Wired(wiring, expected) => {
                self.wiring = wiring;
                self.rig.command(homing);
                self.rest();
                Some(expected)
            }
            Mishap::IndexNear(part) => {
                let axis = &scene.axes[self.tried];
                let scaling = self.rig.machine.drives[drives[0]].scaling;
                let turn = scaling.travel_per_revolution().abs();
                let index = axis.index_behind(&self.rig.machine, axis.edge);
                self.wiring = Wiring::At(index - axis.sign() * part * turn);
                self.rig.command(homing);
                self.rest();
                let why = failure(&self.rig);
                assert!(
                    matches!(why, Some(HomingFailure::IndexTooNear { .. })),
                    "{why:?}"
                );
                None
            }
            Mishap::From(_, expected) => {
                self.rig.command(homing);
                self.rest();
                Some(expected)
            }
            Mishap::Blocked(side, expected) => {
                self.wiring = Wiring::Sound;
                self.rig.command(homing);
                self.gone_by(20.0);
                let sides = (drives.iter().enumerate())
                    .filter(|(place, _)| side.is_none_or(|side| side == *place));
                let held: Vec<_> = sides.map(|(_, drive)| *drive).collect();
                self.disturb(&held, Disturbance::Block(true));
                self.rest();
                assert_eq!(self.status().state, State::Faulted, "{mishap:?}");
                self.disturb(&held, Disturbance::Block(false));
                self.go(Command::Reset, State::Ready);
                Some(expected)
            }
            Mishap::GaveWay => {
                self.rig.command(homing);
                self.gone_by(20.0);
                self.disturb(&drives, Disturbance::Block(true));
                let axis = self.tried;
                self.rig.run_until(|rig| {
                    let row = rig.session.timeline().row();
                    row.is_some_and(|row| row.plan.velocity[axis] == 0.0)
                });
                self.disturb(&drives, Disturbance::Block(false));
                self.rest();
                Some(HomingFailure::GaveWay)
            }
            Mishap::Held => {
                self.wiring = Wiring::Sound;
                self.rig.command(homing);
                self.gone_by(10.0);
                self.rig.command(Command::FeedHold);
                self.rest();
                Some(HomingFailure::Held)
            }
            Mishap::NoSpeed => {
                self.rig.command(Command::RapidOverride(Override::To(0.0)));
                self.rig.command(homing);
                self.rest();
                self.rig
                    .command(Command::RapidOverride(Override::To(100.0)));
                Some(HomingFailure::NoSpeed)
            }
            Mishap::DriveError => {
                self.rig.command(homing);
                self.gone_by(10.0);
                self.disturb(&drives, Disturbance::Fault(ErrorClass::QuickStop));
                self.rest();
                assert_eq!(self.status().state, State::Faulted);
                self.go(Command::Reset, State::Ready);
                Some(HomingFailure::NotHome)
            }
        };
        if expected.is_some() {
            let axis = self.tried_axis();
            let told = self.rig.events.iter().rev().find_map(|event| match event {
                Event::HomingFailed { axis, failure } => Some((*axis, *failure)),
                _ => None,
            });
            let expected = expected.map(|failure| (axis, failure));
            assert_eq!(told, expected, "{:?}", self.rig.events);
        }
        if self.status().state == State::Disabled {
            self.go(Command::Enable, State::Ready);
        }
        assert_eq!(self.status().state, State::Ready, "{mishap:?}");
        assert_eq!(self.rig.refused, [], "{mishap:?}");
    }

    fn disturb(&mut self, drives: &[usize], disturbance: Disturbance) {
        for &drive in drives {
            self.rig.twin(drive).disturb(disturbance);
        }
    }

    /// Goes on until the axis that is tried has moved that far.
    fn gone_by(&mut self, far: f64) {
        let drive = self.tried_drives()[0];
        let from = truth(&mut self.rig, drive);
        while (truth(&mut self.rig, drive) - from).abs() < far {
            assert!(self.step());
        }
    }
}
