//! Buses, devices and mechanics on one clock.

use crate::common::id;
use std::sync::{Arc, Mutex};
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, Frame, Instant};
use syncline_drives::bus::{Band, BitRate, Node};
use syncline_drives::mechanics::{Load, Mechanics, Motion};
use syncline_drives::twin::{Disturbance, SimulatedDevice, lxm32m};
use syncline_drives::world::{GRID, Hosted, World};

fn twin(node: u8) -> Box<dyn SimulatedDevice> {
    Box::new(lxm32m::Twin::new(lxm32m::TwinConfig::new(id(node))))
}

fn at(micros: u64) -> Instant {
    Instant::from_nanos(micros * 1000)
}

/// Moves every shaft at a constant speed, one turn a second for the first, two for the second …,
/// and remembers what it was handed.
#[derive(Clone, Default)]
struct Conveyor(Arc<Mutex<Vec<Vec<Load>>>>);

impl Mechanics for Conveyor {
    fn step(&mut self, dt: f64, loads: &[Load], motions: &mut [Motion]) {
        self.0.lock().unwrap().push(loads.to_vec());
        for (index, motion) in motions.iter_mut().enumerate() {
            motion.velocity = index as f64 + 1.0;
            motion.position += motion.velocity * dt;
        }
    }
}

/// Both buses live by one clock: no frame ends after one that was seen before.
#[test]
fn no_bus_runs_ahead_of_another() {
    let seen = Arc::new(Mutex::new(Vec::new()));
    let mut world = World::new();
    let buses = [125, 1000].map(|kbit| {
        let seen = Arc::clone(&seen);
        let bit_rate = BitRate::from_kbit(kbit).unwrap();
        let bus = world.add_bus(bit_rate, move |sent| {
            seen.lock().unwrap().push((sent.end, kbit));
        });
        for node in 1..=3 {
            world.attach(bus, twin(node));
        }
        bus
    });
    world.advance_to(Instant::ZERO);
    for bus in buses {
        world.send(bus, Band::Acyclic, Frame::new(CobId::NMT, &[0x81, 0]));
    }
    world.advance_to(at(100_000));
    let seen = seen.lock().unwrap();
    let of = |kbit| seen.iter().filter(|(_, bus)| *bus == kbit).count();
    assert!(of(125) >= 7 && of(1000) >= 7, "{seen:?}");
    assert!(seen.is_sorted_by_key(|(end, _)| *end), "{seen:?}");
}

#[test]
fn mechanics_move_shafts_on_the_grid_whatever_their_bus() {
    let conveyor = Conveyor::default();
    let mut world = World::new();
    let devices = [1, 2].map(|node| {
        let bus = world.add_bus(BitRate::from_kbit(1000).unwrap(), |_| ());
        world.attach(bus, twin(node))
    });
    world.couple(conveyor.clone(), &devices, &[]);
    world
        .device_mut(devices[1])
        .disturb(Disturbance::Block(true));
    // In pieces that have nothing to do with the grid; switched on a second late.
    let start = Instant::from_nanos(1_000_000_000);
    for piece in 0..=1000 {
        world.advance_to(start + Duration::from_nanos(10_007) * piece);
    }
    let steps = (Duration::from_nanos(10_007) * 1000).as_nanos() / GRID.as_nanos();
    let handed = conveyor.0.lock().unwrap();
    assert_eq!(handed.len() as u128, steps);
    assert!(
        handed
            .iter()
            .all(|loads| !loads[0].blocked && loads[1].blocked)
    );
    let travelled = steps as f64 * GRID.as_secs_f64();
    for (device, speed) in devices.into_iter().zip([1.0, 2.0]) {
        let seen = world.device(device).observe();
        assert_eq!(seen.velocity, speed);
        let ahead = seen.position - speed * travelled;
        assert!(ahead.abs() <= speed * GRID.as_secs_f64(), "{ahead}");
    }
}

/// A world's motion does not depend on how often it is asked to go on.
#[test]
fn pieces_of_time_change_nothing() {
    let run = |pieces: u64| {
        let frames = Arc::new(Mutex::new(Vec::new()));
        let log = Arc::clone(&frames);
        let mut world = World::new();
        let bus = world.add_bus(BitRate::from_kbit(1000).unwrap(), move |sent| {
            log.lock().unwrap().push((sent.start, sent.frame));
        });
        let devices = [1, 2].map(|node| world.attach(bus, twin(node)));
        world.couple(Conveyor::default(), &devices, &[]);
        world.advance_to(Instant::ZERO);
        world.send(bus, Band::Acyclic, Frame::new(CobId::NMT, &[0x01, 0]));
        for piece in 1..=pieces {
            world.advance_to(at(60_000 * piece / pieces));
        }
        drop(world);
        Arc::into_inner(frames).unwrap().into_inner().unwrap()
    };
    let whole = run(1);
    assert!(whole.len() > 4, "{whole:?}");
    assert_eq!(run(7), whole);
    assert_eq!(run(60_000), whole);
}

#[test]
fn what_others_host_moves_on_the_same_grid() {
    let conveyor = Conveyor::default();
    let mut hosted = Hosted::new(vec![twin(1), twin(2)]);
    hosted.couple(conveyor.clone(), &[1], &[]);
    let mut sent: Vec<Frame> = Vec::new();
    assert_eq!(hosted.deadline(), Some(Instant::ZERO));
    hosted.live_until(at(10_000), &mut sent);
    assert_eq!(conveyor.0.lock().unwrap().len(), 160);
    assert!(hosted.deadline() > Some(at(10_000)));
    // Both have booted.
    let mut booted: Vec<String> = sent.iter().map(|frame| format!("{frame:?}")).collect();
    booted.sort();
    assert_eq!(booted, ["701#00", "702#00"]);
}
