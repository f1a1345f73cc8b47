//! What may follow what: states of the session, controlwords, NMT commands.

use super::super::interference::{Interference, ToBus};
use super::scene::DriveScene;
use super::{Checker, Found, Scene};
use crate::control::State;
use crate::machine::Motion;
use crate::session::Event;
use syncline_canopen::cia402::{self, Statusword};
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, Instant, nmt};
use syncline_drives::bus::{Sender, Transmission};

const NAME: &str = "transitions";

/// See the module.
#[derive(Default)]
pub(super) struct Transitions {
    state: Option<State>,
    /// By drive: how far it is commanded.
    levels: Vec<Option<u8>>,
    /// By drive: when a controlword came to it last.
    came: Vec<Option<Instant>>,
    /// By drive: it said that it is not ready, since when; and when it was heard last.
    unready: Vec<(Option<Instant>, Instant)>,
}

/// A drive that has said for so many cycles that it is not ready, and is heard, is waited for.
const WAITED_FOR: f64 = 4.0;

/// Cycles in which bursts may come that left before others were lost.
const LOST_BESIDE: f64 = 2.0;

/// Whether a drive that says this is ready to be enabled, or is enabled.
fn is_ready(statusword: u16) -> bool {
    let ready = [
        cia402::State::ReadyToSwitchOn,
        cia402::State::SwitchedOn,
        cia402::State::OperationEnabled,
    ];
    let state = Statusword(statusword).state();
    state.is_some_and(|state| ready.contains(&state))
}

/// The states that may follow one, by the drawing in `docs/design.md`.
fn may_follow(before: State, after: State) -> bool {
    use State::{
        Disabled, Faulted, Held, Homing, Jogging, Mdi, Off, Ready, Running, Starting, Stopping,
    };
    match before {
        Off => false,
        Starting => matches!(after, Ready | Stopping),
        Ready => matches!(after, Homing | Jogging | Mdi | Running | Stopping),
        Homing | Jogging => matches!(after, Ready | Stopping),
        Mdi | Running => matches!(after, Ready | Held | Stopping),
        Held => matches!(after, Mdi | Running | Stopping),
        Stopping => matches!(after, Ready | Disabled | Faulted | Off),
        Faulted => matches!(after, Starting | Stopping),
        Disabled => matches!(after, Starting | Stopping | Faulted),
    }
}

/// How far a controlword leads a drive: off, ready, switched on, enabled, in its mode.
fn level(controlword: u16) -> u8 {
    match controlword & 0x0F {
        0x06 => 1,
        0x07 => 2,
        0x0F if controlword & 0x10 == 0 => 3,
        0x0F => 4,
        _ => 0,
    }
}

impl Transitions {
    /// The controlword of a drive, as it comes to it.
    fn controlword(&mut self, scene: &Scene<'_>, drive: usize, found: &mut Found) {
        self.levels.resize(scene.drives.len(), None);
        self.came.resize(scene.drives.len(), None);
        let came = self.came[drive];
        if scene
            .told_controlword
            .is_some_and(|(told, _)| told == drive)
        {
            self.came[drive] = Some(scene.now);
        }
        let now = scene.drives[drive].controlword.map(level);
        let before = std::mem::replace(&mut self.levels[drive], now);
        let (Some(now), before) = (now, before.unwrap_or(0)) else {
            return;
        };
        let spec = &scene.machine.drives[drive];
        let name = &spec.name;
        let leaps = now > before && before < 3 && now > if before == 1 { 3 } else { before + 1 };
        // A drive that another master has reset begins anew before the controller can know.
        let begun_anew = scene.interferences.iter().any(|(at, what)| {
            let Interference::Bus(bus, ToBus::Nmt(command, node)) = what else {
                return false;
            };
            let resets = [nmt::Command::ResetNode, nmt::Command::ResetCommunication];
            let to_it = *bus == spec.bus && (*node == 0 || *node == spec.node.get());
            to_it && resets.map(|it| it as u8).contains(command) && scene.since(*at) < 1.0
        });
        // What came between was lost with bursts, as none came since, of a drive that said meanwhile that it is ready, as some are
        // without being told.
        let lost = now == 3
            && scene.drives[drive].statusword.is_some_and(is_ready)
            && scene.interferences.iter().any(|(at, what)| {
                let Interference::Bus(bus, ToBus::DropBursts(_)) = what else {
                    return false;
                };
                let beside = Duration::from_secs_f64(LOST_BESIDE * scene.period());
                *bus == spec.bus && came.is_none_or(|came| came < *at + beside)
            });
        if leaps && !begun_anew && !lost {
            found.violate(NAME, scene, "a controlword leaps", || {
                format!("drive {name}: from level {before} to {now}")
            });
        }
        if now >= 3 && before < 3 {
            // All are ready before any is enabled.
            let says_so = |it: &DriveScene| it.statusword.is_some_and(|it| !is_ready(it));
            let unready = scene.drives.iter().position(says_so);
            let unready = unready.filter(|_| !scene.is_disturbed(1.0));
            // Whatever happened to drives: who says for a while that it is not ready, and is heard, is known to be so.
            let mut waited_for = self.unready.iter().map(|(unready, heard)| {
                let cycles = |at| scene.since(at) / scene.period();
                unready.is_some_and(|at| cycles(at) > WAITED_FOR) && cycles(*heard) < WAITED_FOR
            });
            let waited_for = waited_for
                .position(|it| it)
                .filter(|_| scene.buses_are_sound());
            if let Some(unready) = unready.or(waited_for) {
                found.violate(
                    NAME,
                    scene,
                    "enabled while another drive is not ready",
                    || {
                        let unready = &scene.machine.drives[unready].name;
                        format!("drive {name} is enabled, {unready} is not ready")
                    },
                );
            }
        }
    }

    fn nmt(&self, scene: &Scene<'_>, bus: usize, data: &[u8], found: &mut Found) {
        let &[command, node, ..] = data else {
            return;
        };
        if node == 0 {
            found.violate(NAME, scene, "an NMT command to all nodes", || {
                format!("command {command:02X}h on bus {bus}")
            });
            return;
        }
        let resets = [
            nmt::Command::ResetNode as u8,
            nmt::Command::ResetCommunication as u8,
            nmt::Command::Stop as u8,
        ];
        let mut nodes = scene.machine.nodes();
        let Some(device) = nodes.position(|it| it.bus == bus && it.id.get() == node) else {
            found.violate(NAME, scene, "an NMT command to a stranger", || {
                format!("command {command:02X}h to node {node} on bus {bus}")
            });
            return;
        };
        let powered = scene
            .plants
            .get(device)
            .is_some_and(|plant| plant.is_powered);
        if resets.contains(&command) && powered && !scene.is_disturbed(f64::INFINITY) {
            found.violate(
                NAME,
                scene,
                "a drive is reset with its power stage on",
                || {
                    let name = &scene.machine.drives[device].name;
                    format!("drive {name}: command {command:02X}h")
                },
            );
        }
    }
}

impl Checker for Transitions {
    fn frame(&mut self, scene: &Scene<'_>, bus: usize, sent: &Transmission, found: &mut Found) {
        if let Some(drive) = scene.told_status
            && let Some(word) = scene.drives[drive].statusword
        {
            self.unready
                .resize(scene.drives.len(), (None, Instant::ZERO));
            let (unready, heard) = &mut self.unready[drive];
            *unready = (!is_ready(word)).then(|| unready.unwrap_or(scene.now));
            *heard = scene.now;
        }
        if sent.sender != Sender::Port {
            return;
        }
        match sent.frame.id() {
            CanId::Standard(0) => self.nmt(scene, bus, sent.frame.data(), found),
            CanId::Standard(_) => {
                for &drive in scene.drives_of(bus) {
                    self.controlword(scene, drive, found);
                }
            }
            CanId::Extended(_) => {}
        }
    }

    fn told(&mut self, scene: &Scene<'_>, event: &Event, found: &mut Found) {
        let Event::State(after) = *event else {
            return;
        };
        let before = self.state.replace(after).unwrap_or(State::Starting);
        // What is left of a target, or of a way home by itself, is gone once the drives were off.
        let mut axes = scene.machine.axes.iter().enumerate();
        let goes = axes.any(|(index, axis)| {
            axis.motion == Motion::PointToPoint || scene.is_homed_by_drive(index)
        });
        let begins_anew = goes && (before, after) == (State::Stopping, State::Starting);
        if !may_follow(before, after) && !begins_anew {
            found.violate(NAME, scene, "a state that may not follow", || {
                format!("{after} after {before}")
            });
        }
    }
}
