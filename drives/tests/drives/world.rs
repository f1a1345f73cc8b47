//! Buses, devices and mechanics on one clock.

use crate::common::id;
use std::sync::{Arc, Mutex};
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, Frame, Instant};
use syncline_drives::bus::{Band, BitRate, BusNode};
use syncline_drives::mechanics::rigid::Rigid;
use syncline_drives::mechanics::rigid_beam::{Beam, Racking, RigidBeam, Side};
use syncline_drives::mechanics::touch_probe::{Solid, TouchProbe};
use syncline_drives::mechanics::{Load, Mechanics, Motion};
use syncline_drives::twin::servo::encoder::EncoderErrors;
use syncline_drives::twin::{Disturbance, SimulatedDevice, cia402_csp, cia406, lxm32m};
use syncline_drives::world::{FittedProbe, GRID, Hosted, ProbeDrive, ProbeWire, World};

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
    world.ties().couple(conveyor.clone(), &devices, &[]);
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
        world.ties().couple(Conveyor::default(), &devices, &[]);
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
    hosted
        .ties()
        .couple(conveyor.clone(), &[Hosted::at(1)], &[]);
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

/// Turns a second of [`turned`]: 1 m/s on a pitch of 20 mm.
const SPEED: f64 = 50.0;

/// A drive whose encoder has no noise, of which each seed has another oscillator.
fn exact(seed: u64) -> cia402_csp::Twin {
    let mut config = cia402_csp::TwinConfig::new(id(1));
    config.processor.seed = seed;
    config.servo.encoder = EncoderErrors::default();
    cia402_csp::Twin::new(config)
}

/// Whatever its oscillator: what a T_PDO tells is where the shaft is at SYNC, up to an increment.
#[test]
fn a_t_pdo_of_a_coupled_shaft_is_exact_at_a_constant_speed() {
    for seed in 0..4 {
        let told = Arc::new(Mutex::new((Instant::ZERO, Vec::new())));
        let log = Arc::clone(&told);
        let mut world = World::new();
        let bus = world.add_bus(BitRate::from_kbit(1000).unwrap(), move |sent| {
            let (sync, told) = &mut *log.lock().unwrap();
            let id = sent.frame.id();
            if id == Frame::new(CobId::SYNC, &[]).id() {
                *sync = sent.end;
            } else if id == Frame::new(CobId::t_pdo(2, crate::common::id(1)), &[]).id() {
                let position = sent.frame.data()[2..].try_into().unwrap();
                told.push((*sync, i32::from_le_bytes(position)));
            }
        });
        let device = world.attach(bus, Box::new(exact(seed)));
        world.ties().turn(device, SPEED);
        world.advance_to(Instant::ZERO);
        world.send(bus, Band::Acyclic, Frame::new(CobId::NMT, &[0x01, 1]));
        // So that SYNC comes at every phase of the grid and of the drive's steps.
        for sync in 1..=500_u64 {
            world.advance_to(at(20_000) + Duration::from_nanos(1_003_517) * sync as u32);
            world.send(bus, Band::Sync, Frame::new(CobId::SYNC, &[]));
        }
        let told = told.lock().unwrap();
        assert!(told.1.len() > 490, "{}", told.1.len());
        for &(sync, position) in &told.1 {
            let expected = SPEED * 1_048_576.0 * (sync - Instant::ZERO).as_secs_f64();
            let error = f64::from(position) + 0.5 - expected;
            assert!(
                error.abs() < 1.5,
                "seed {seed}, SYNC at {sync:?}: {error} increments"
            );
        }
    }
}

/// How fast a [`falling`] shaft becomes faster, rev/s².
const FALL: f64 = 200.0;

/// Nothing holds it: ½ g t² from power-on on.
fn falling() -> Rigid {
    let rigid = Rigid::default();
    Rigid {
        viscous_friction: 0.0,
        coulomb_friction: 0.0,
        load_torque: FALL * core::f64::consts::TAU * (rigid.motor_inertia + rigid.load_inertia),
        brake_torque: 0.0,
        ..rigid
    }
}

fn falling_csp(seed: u64) -> Box<dyn SimulatedDevice> {
    let mut config = cia402_csp::TwinConfig::new(id(1));
    config.processor.seed = seed;
    config.servo.mechanics = falling().into();
    Box::new(cia402_csp::Twin::new(config))
}

/// Sees where what is watched is, at each point of the grid.
#[derive(Clone, Default)]
struct Watcher(Arc<Mutex<Vec<f64>>>);

impl Mechanics for Watcher {
    fn step(&mut self, _: f64, _: &[Load], motions: &mut [Motion]) {
        self.0.lock().unwrap().push(motions[1].position);
    }
}

/// On the grid, although the drive's own steps end before its points: within what the acceleration makes of that.
#[test]
fn what_follows_or_watches_a_drive_sees_it_on_the_grid() {
    for seed in 0..4 {
        let watcher = Watcher::default();
        let mut world = World::new();
        let bus = world.add_bus(BitRate::from_kbit(1000).unwrap(), |_| ());
        let leader = world.attach(bus, falling_csp(seed));
        let encoder = cia406::Twin::new(cia406::TwinConfig::new(id(2)));
        let follower = world.attach(bus, Box::new(encoder));
        let other = world.attach(bus, twin(3));
        world.ties().follow(follower, leader, 0.5);
        world.ties().couple(watcher.clone(), &[other], &[leader]);
        world.advance_to(Instant::ZERO);
        for point in 1..=8_000_u32 {
            let now = Instant::ZERO + GRID * point;
            world.advance_to(now);
            let t = (now - Instant::ZERO).as_secs_f64();
            let expected = 0.5 * FALL * t * t;
            // A thousandth of an increment for each ns by which its clock is rounded.
            let error = 0.5 * FALL * 62.5e-6 * 62.5e-6 + 2e-9 * f64::from(point) / 16.0 * FALL * t;
            let followed = world.device(follower).observe().position / 0.5;
            assert!(
                (followed - expected).abs() <= error,
                "{followed} {expected} at {t} s"
            );
            let watched = *watcher.0.lock().unwrap().last().unwrap();
            assert!(
                (watched - expected).abs() <= error,
                "{watched} {expected} at {t} s"
            );
        }
    }
}

/// A shaft of its own, the sides of a beam, which is taken out of square, and an encoder that goes with what turns it.
#[test]
fn what_is_brought_elsewhere_by_hand_rests_there() {
    let mut world = World::new();
    let bus = world.add_bus(BitRate::from_kbit(1000).unwrap(), |_| ());
    let [alone, one, other] = [1, 2, 3].map(|node| world.attach(bus, twin(node)));
    let encoder = cia406::Twin::new(cia406::TwinConfig::new(id(4)));
    let encoder = world.attach(bus, Box::new(encoder));
    let side = Side {
        travel: 0.02,
        rigid: Rigid::default(),
    };
    let beam = Beam {
        mass: 20.0,
        inertia: 2.0,
        span: 1.0,
        racking: Racking {
            stiffness: 1e4,
            damping: 10.0,
        },
    };
    let beam = RigidBeam::new(beam, [side.clone(), side]).unwrap();
    world.ties().couple(beam, &[one, other], &[]);
    world.ties().follow(encoder, alone, 0.5);
    world.advance_to(Instant::ZERO);
    world.advance_to(at(10_000));
    world.displace(alone, 3.0);
    world.displace(other, -0.001);
    world.advance_to(at(200_000));
    let expected = [(alone, 3.0), (one, 0.0), (other, -0.001), (encoder, 1.5)];
    for (device, position) in expected {
        let is = world.device(device).observe();
        assert!(
            (is.position - position).abs() < 1e-9 && is.velocity == 0.0,
            "{is:?}, not {position}"
        );
    }
}

/// What touches where two shafts have come that fall together is captured where it touches.
#[test]
fn a_probe_sees_all_shafts_at_the_same_instant() {
    for seed in 0..4 {
        let told = Arc::new(Mutex::new(Vec::new()));
        let log = Arc::clone(&told);
        let mut world = World::new();
        let bus = world.add_bus(BitRate::from_kbit(1000).unwrap(), move |sent| {
            log.lock().unwrap().push(sent.frame.data().to_vec());
        });
        let moving = world.attach(bus, falling_csp(seed));
        let mut config = lxm32m::TwinConfig::new(id(2));
        config.servo.mechanics = falling().into();
        config.processor.seed = seed + 10;
        let capturing = world.attach(bus, Box::new(lxm32m::Twin::new(config)));
        let drive = ProbeDrive {
            device: moving,
            zero: 0.0,
            travel: 10.0,
        };
        world.ties().fit_probe(FittedProbe {
            probe: TouchProbe {
                radius: 0.0,
                solids: vec![Solid::Plane {
                    at: [123.0, 0.0, 0.0],
                    normal: [-1.0, 0.0, 0.0],
                }],
            },
            axes: [vec![drive], vec![], vec![]],
            wires: vec![ProbeWire {
                device: capturing,
                input: 0,
                inverted: false,
            }],
        });
        world.advance_to(Instant::ZERO);
        let ask = |world: &mut World, request: [u8; 8], until| {
            world.send(
                bus,
                Band::Acyclic,
                Frame::new(CobId::r_sdo(id(2)), &request),
            );
            world.advance_to(until);
            told.lock().unwrap().pop().unwrap()
        };
        // 60B8h: probe 1 on, its rising edge.
        world.advance_to(at(50_000));
        ask(&mut world, [0x2B, 0xB8, 0x60, 0, 0x11, 0, 0, 0], at(60_000));
        world.advance_to(at(400_000));
        let answer = ask(&mut world, [0x40, 0xBA, 0x60, 0, 0, 0, 0, 0], at(420_000));
        let captured = i32::from_le_bytes(answer[4..].try_into().unwrap());
        let expected = 12.3 * 16_384.0;
        assert!(
            (f64::from(captured) - expected).abs() < 3.0,
            "{captured} {expected}"
        );
    }
}
