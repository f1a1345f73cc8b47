//! Every fault is told once, in time and with the right subject; where nothing is wrong, none is.

use super::super::interference::{Interference, ToBus, ToDrive, Traffic};
use super::super::machine::Wire;
use super::{Checker, Found, Scene};
use crate::control::fault::{AxisCause, DeviceCause};
use crate::control::{self, Fault, Phase, State};
use crate::session::{Command, Event};
use syncline_canopen::{CanId, Instant};
use syncline_drives::bus::{Sender, Transmission};

const NAME: &str = "alarms";

/// Cycles from where something is visible on a bus until it has to be told.
const IN_TIME: f64 = 3.0;

/// See the module.
#[derive(Default)]
pub(super) struct Alarms {
    /// Faults since the machine was reset: the first cause, and what came on top of it.
    told: Vec<Fault>,
    /// A drive told of an error, and when.
    emergency: Option<(usize, Instant)>,
}

/// A device may be to blame, and what it has a part in.
fn suspect(scene: &Scene<'_>, device: usize, suspects: &mut Vec<usize>) {
    let machine = scene.machine;
    suspects.push(device);
    // What moves one side of a gantry moves the other, and an encoder speaks for its axis.
    let axis = match machine.drives.get(device) {
        Some(drive) => Some(drive.axis),
        None => (machine.encoders.get(device - machine.drives.len())).and_then(|it| it.axis),
    };
    suspects.extend(axis.iter().flat_map(|axis| &machine.axes[*axis].drives));
    // Who has the output that closes the enable chain lets go of all drives.
    if machine.enable_chain().is_some_and(|it| it.node == device) {
        suspects.extend(0..machine.drives.len());
    }
}

/// Which devices may be to blame for what happened: `None`, anything may.
fn suspects(scene: &Scene<'_>) -> Option<Vec<usize>> {
    let mut suspects = Vec::new();
    for (_, what) in &scene.interferences {
        match *what {
            Interference::Drive(device, _)
            | Interference::Slip(device, _)
            | Interference::Part(device)
            | Interference::Join(device) => suspect(scene, device, &mut suspects),
            Interference::Align(axis) => {
                for device in &scene.machine.axes[axis].drives {
                    suspect(scene, *device, &mut suspects);
                }
            }
            Interference::Bus(bus, _) => {
                let nodes = scene.machine.nodes().enumerate();
                for (device, _) in nodes.filter(|(_, node)| node.bus == bus) {
                    suspect(scene, device, &mut suspects);
                }
            }
            Interference::StarvePlanner(_) | Interference::Mended => {}
            // All drives miss a SYNC that comes late.
            Interference::Late(_) => return None,
        }
    }
    Some(suspects)
}

/// Whether nothing has happened but what a machine bears: of each device fewer T_PDOs are lost than may be missing in a row, and
/// inputs of programs and operators are switched.
fn is_borne(scene: &Scene<'_>) -> bool {
    let machine = &scene.case.machine;
    let stops = |device: usize, place: u8| machine.has_wire(device, place, Wire::misleads);
    let mut lost = vec![0; machine.nodes().count()];
    let mut all = scene.interferences.iter();
    all.all(|(_, what)| match *what {
        Interference::StarvePlanner(_) | Interference::Mended => true,
        Interference::Drive(device, ToDrive::Input(place, _)) => !stops(device, place),
        Interference::Drive(device, ToDrive::LoseTPdos(count)) => {
            lost.get_mut(device).is_some_and(|lost| {
                *lost += count;
                *lost < machine.t_pdo_misses.min(scene.misses(device))
            })
        }
        _ => false,
    })
}

impl Alarms {
    fn fault(&mut self, scene: &Scene<'_>, fault: &Fault, found: &mut Found) {
        self.emergency = None;
        // On the way down a drive that does not answer is told at each step.
        let waits = matches!(fault, Fault::Device(_, DeviceCause::StateTimeout { .. }));
        if self.told.contains(fault) && !waits {
            found.violate(NAME, scene, "a fault is told twice", || {
                format!("{fault:?}, after {:?}", self.told)
            });
        }
        self.told.push(*fault);
        if scene.is_untroubled {
            found.violate(NAME, scene, "a fault where nothing is wrong", || {
                format!("{fault:?}")
            });
            return;
        }
        // Whatever else is wrong: it is the controller's own plan that is held back.
        if matches!(
            fault,
            Fault::Axis(_, AxisCause::SetpointGuard { sampled: false, .. })
        ) {
            let what = "a setpoint that only a defect makes";
            found.violate(NAME, scene, what, || format!("{fault:?}"));
        }
        let is_homing = matches!(
            fault,
            Fault::Axis(_, AxisCause::Unreferenced | AxisCause::Homing(_))
        );
        if is_borne(scene) && !is_homing {
            let what = "a fault although what happened is to be borne";
            found.violate(NAME, scene, what, || {
                format!("{fault:?}; what happened: {:?}", scene.interferences)
            });
        }
        let Some(suspects) = suspects(scene) else {
            return;
        };
        let drives_of_bus = |bus: usize| scene.drives_of(bus).to_vec();
        let concerned = match fault {
            Fault::Device(drive, _) => vec![*drive],
            Fault::Axis(_, AxisCause::Unreferenced | AxisCause::Homing(_)) => return,
            Fault::Axis(axis, _) => scene.machine.axes[*axis].drives.clone(),
            Fault::Bus(bus, _) => drives_of_bus(*bus),
            _ => return,
        };
        if !concerned.iter().any(|drive| suspects.contains(drive)) {
            found.violate(
                NAME,
                scene,
                "a fault of somebody whom nothing happened to",
                || format!("{fault:?}; what happened: {:?}", scene.interferences),
            );
        }
    }

    /// A drive told of an error while it was supervised, and nothing came of it.
    fn in_time(&mut self, scene: &Scene<'_>, found: &mut Found) {
        let Some((drive, since)) = self.emergency else {
            return;
        };
        if scene.since(since) > IN_TIME * scene.period() + 1e-9 {
            self.emergency = None;
            found.violate(
                NAME,
                scene,
                "an error of a drive is not told in time",
                || {
                    let name = &scene.machine.drives[drive].name;
                    format!("drive {name}, machine {}", scene.state)
                },
            );
        }
    }

    /// What is no fault and yet must not be while nothing is wrong.
    fn warned(scene: &Scene<'_>, event: &control::Event, found: &mut Found) {
        use control::Event;
        let warns = matches!(
            event,
            Event::Silent { .. }
                | Event::FoundEnabled { .. }
                | Event::Emergency { .. }
                | Event::Warning { .. }
                | Event::MissedTPdo { .. }
                | Event::LateSetpoint { .. }
                | Event::LostCycles { .. }
                | Event::BusWarning { .. }
        );
        if warns && scene.is_untroubled {
            found.violate(NAME, scene, "a warning where nothing is wrong", || {
                format!("{event:?}")
            });
        }
    }
}

/// Whether what comes in from a bus, or when, cannot be relied on.
fn is_deaf(scene: &Scene<'_>, bus: usize) -> bool {
    scene.interferences.iter().any(|(at, what)| match what {
        Interference::Bus(of, what) if *of == bus => match what {
            ToBus::Incoming(it) => it.traffic == Traffic::Emergency,
            ToBus::Unplug(_) | ToBus::Condition(_) => true,
            _ => false,
        },
        Interference::Late(_) => scene.since(*at) < 1.0,
        _ => false,
    })
}

impl Checker for Alarms {
    fn frame(&mut self, scene: &Scene<'_>, bus: usize, sent: &Transmission, _: &mut Found) {
        let CanId::Standard(id) = sent.frame.id() else {
            return;
        };
        let supervised = (Phase::Disabled..=Phase::Stop).contains(&scene.phase)
            && !matches!(
                scene.state,
                State::Faulted | State::Disabled | State::Stopping
            );
        if id >> 7 != 1 || sent.sender == Sender::Port || !supervised || scene.faulted {
            return;
        }
        let is_error = sent.frame.data().first_chunk() != Some(&[0; 2]);
        if let Some(drive) = scene.drive_with(bus, (id & 0x7F) as u8)
            && is_error
            && !is_deaf(scene, bus)
        {
            self.emergency.get_or_insert((drive, scene.now));
        }
    }

    fn interfered(&mut self, _: &Scene<'_>, what: &Interference, _: &mut Found) {
        if let Interference::Bus(..) | Interference::Late(_) = what {
            self.emergency = None;
        }
        if let Interference::Drive(drive, ToDrive::Mute(_)) = what {
            self.emergency.take_if(|(of, _)| of == drive);
        }
    }

    fn told(&mut self, scene: &Scene<'_>, event: &Event, found: &mut Found) {
        match event {
            Event::Machine(control::Event::Fault(fault)) => self.fault(scene, fault, found),
            Event::Machine(event) => Self::warned(scene, event, found),
            Event::Accepted(it) if it.command == Command::Reset => {
                self.told.clear();
                self.emergency = None;
            }
            Event::State(State::Stopping | State::Disabled | State::Off) => self.emergency = None,
            _ => {}
        }
    }

    fn woken(&mut self, scene: &Scene<'_>, found: &mut Found) {
        self.in_time(scene, found);
    }
}
