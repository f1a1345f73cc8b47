//! A probe in the world: moved by shafts, and told to the inputs that it is wired to.
//!
//! At each point of the world's grid it is looked whether the tip touches. Where that has changed, it did so where the
//! way from the last point, which is taken to be straight, crosses the surface; what captures positions is told
//! where its shaft was then.

use super::DeviceId;
use super::ties::{Devices, shaft_of};
use crate::mechanics::touch_probe::{Place, TouchProbe};
use syncline_canopen::Instant;

/// A drive that moves a probe.
#[derive(Clone, Copy, Debug)]
pub struct ProbeDrive {
    /// Which one.
    pub device: DeviceId,
    /// Machine position of its axis where its shaft's is zero, mm.
    pub zero: f64,
    /// How far a revolution of its shaft moves the axis, mm with its sign.
    pub travel: f64,
}

/// A digital input that a probe is wired to.
#[derive(Clone, Copy, Debug)]
pub struct ProbeWire {
    /// Its device.
    pub device: DeviceId,
    /// Its number there.
    pub input: u8,
    /// It is off while the probe touches.
    pub inverted: bool,
}

/// A probe with what moves it and what hears of it.
#[derive(Clone, Debug, Default)]
pub struct FittedProbe {
    /// The probe, and what it may touch.
    pub probe: TouchProbe,
    /// What moves it along X, Y and Z: nothing, a drive, or the sides of a gantry, of which it is in the middle.
    pub axes: [Vec<ProbeDrive>; 3],
    /// The inputs that it is wired to.
    pub wires: Vec<ProbeWire>,
}

/// A fitted probe, and what it was at the last point of the grid.
pub(super) struct Probing {
    fitted: FittedProbe,
    /// Where it was and whether it touched; `None` before the first point.
    last: Option<(Place, bool)>,
    /// By wire, where the shaft of its device was.
    shafts: Vec<f64>,
}

impl Probing {
    pub(super) fn new(fitted: FittedProbe) -> Self {
        Self {
            last: None,
            shafts: vec![0.0; fitted.wires.len()],
            fitted,
        }
    }

    /// Lets it touch what it touches at a point of the grid.
    pub(super) fn step(&mut self, end: Instant, all: &mut (impl Devices + ?Sized)) {
        let FittedProbe { probe, axes, wires } = &self.fitted;
        let place = axes.each_ref().map(|drives| {
            let mut sum = 0.0;
            for drive in drives {
                all.device_mut(drive.device).run_until(end);
                let load = shaft_of(drive.device, all).load_motion_at(end);
                sum += drive.zero + drive.travel * load.position;
            }
            sum / drives.len().max(1) as f64
        });
        let touches = probe.touches(place);
        let before = self.last.replace((place, touches));
        let part = match before {
            Some((before, touched)) if touched != touches => probe.crossing(before, place),
            _ => 1.0,
        };
        for (wire, last) in wires.iter().zip(&mut self.shafts) {
            let device = all.device_mut(wire.device);
            let shaft = device.shaft_mut();
            let here = shaft.map_or(0.0, |shaft| shaft.motion_at(end).position);
            let there = *last + part * (here - *last);
            *last = here;
            if before.is_none_or(|(_, touched)| touched != touches) {
                device.touch(wire.input, touches != wire.inverted, there);
            }
        }
    }
}
