//! An axis whose drive is sent velocities, while the controller closes the position loop: Y of the portal
//! on a TLC53x, beside LXM32M, which are sent positions.

use proptest::prelude::*;
use syncline_canopen::{CanId, CobId, NodeId};
use syncline_controller::control::fault::{AxisCause, DeviceCause};
use syncline_controller::control::{End, Fault, Row};
use syncline_controller::machine::COORDINATES;
use syncline_drives::bus::Transmission;
use syncline_drives::twin::{Config, Disturbance, ErrorClass};
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

/// The drive's place in the machine file, and its axis.
const DRIVE: usize = 2;
const Y: usize = 1;

const LXM32M: &str = "node = 3\nmodel = \"lxm32m\"\nzero = 402_131";
const TLC53X: &str = "node = 3\nmodel = \"tlc5xx\"\nzero = 50_266";

pub(super) const SUPERVISED: &str = "following_error_limit = 2.0\nstandstill_window = 0.05\n\
    drive_following_error = true\ndrive_soft_limits = true\n\n[[axis]]\nname = \"Z\"";
pub(super) const UNSUPERVISED: &str =
    "following_error_limit = 2.0\nstandstill_window = 0.05\n\n[[axis]]\nname = \"Z\"";

/// Y of the portal on the drive.
pub(super) const CHANGES: [(&str, &str); 2] = [(LXM32M, TLC53X), (SUPERVISED, UNSUPERVISED)];

/// Two circles of 20 mm at 100 mm/s.
const CIRCLES: &str = "G21 G90 G94 G61\nG0 X300 Y300\nG1 X320 Y300 F6000\n\
    G3 X320 Y300 I-20\nG3 X320 Y300 I-20\nM2\n";

/// What is assumed of the drive by default, s.
const LAG: f64 = 12.5e-3;
const CYCLE: f64 = 2e-3;

/// The smallest difference of two velocities: a quarter of 1 r/min, of 20 mm a revolution. mm/s
const QUANTUM: f64 = 0.25 / 60.0 * 20.0;

/// An increment, mm.
const INCREMENT: f64 = 20.0 / 16_384.0;

fn gain() -> f64 {
    0.25 / (LAG + 1.5 * CYCLE)
}

fn portal_with(
    more: &[(&str, &str)],
    program: &str,
    configure: impl Fn(usize, &mut Config),
) -> Rig {
    let mut replacements = CHANGES.to_vec();
    replacements.extend(more);
    Rig::new("portal", &replacements, program, configure)
}

fn portal(program: &str) -> Rig {
    portal_with(&[], program, |_, _| ())
}

fn peak(rows: &[Row<COORDINATES>], axis: usize) -> f64 {
    let errors = rows.iter().map(|row| row.axes[axis].following_error.abs());
    errors.fold(0.0, f64::max)
}

/// How far X, on LXM32M, is from its plan at the most, by up to twice as much for some phases of their clocks, mm.
const BESIDE: f64 = 0.045;

/// What is left of the drive's lag once it is led, for each mm/s²: its speed loop's own lag, of 1.5 ms at
/// most, times the lag of the position loop. mm
const OF_ACCELERATION: f64 = 1.5e-3 * LAG;

/// How far the axis may be from its plan at the most, where it is accelerated so much, mm.
fn bound(acceleration: f64) -> f64 {
    OF_ACCELERATION * acceleration + QUANTUM / gain() + INCREMENT
}

/// The greatest acceleration on the way to and from a velocity, within the limits of Y, mm/s².
fn acceleration(velocity: f64) -> f64 {
    (velocity * 100_000.0).sqrt().min(5000.0)
}

// --- it follows ---

#[test]
fn it_follows_a_program_beside_drives_that_are_sent_positions() {
    let mut rig = portal(PORTAL_PROGRAM);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let [x, y] = [0, Y].map(|axis| peak(&rig.rows, axis));
    println!("program: X {x:.4} mm, Y {y:.4} of {:.4} mm", bound(5000.0));
    assert!(
        x < BESIDE && y <= bound(5000.0) && y >= bound(5000.0) / 5.0,
        "{x}, {y}"
    );
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
}

/// A drive that is late by a part of a cycle has the others wait for it, between two setpoints of the
/// plan, which keep the limits all the same.
#[test]
fn setpoints_between_two_of_the_plan_keep_the_limits() {
    let late = "[model.tlc5xx]\nvelocity_delay_us = 700\n[[bus]]";
    let mut rig = portal_with(&[("[[bus]]", late)], PORTAL_PROGRAM, |_, _| ());
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert!(peak(&rig.rows, 0) < BESIDE);
    let apart = rig
        .rows
        .iter()
        .map(|row| row.axes[0].set - row.plan.position[0]);
    assert!(apart.fold(0.0, |most: f64, apart| most.max(apart.abs())) > 0.1);
    rig.trace().assert_within_limits();
}

/// Where the controller knows nothing of the drive's lag, it is twelve times as far from its plan.
#[test]
fn a_lag_that_is_not_led_shows_on_a_circle() {
    let [led, unknown] = ["[[bus]]", "[model.tlc5xx]\nposition_lag_us = 0\n[[bus]]"].map(|table| {
        let mut rig = portal_with(&[("[[bus]]", table)], CIRCLES, |_, _| ());
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        peak(&rig.rows, Y)
    });
    let bound = bound(acceleration(100.0) + 500.0);
    println!("circles: {led:.4} of {bound:.4} mm, its lag unknown {unknown:.4} mm");
    assert!(led <= bound && led >= bound / 5.0, "{led} of {bound}");
    assert!(unknown >= 5.0 * led, "{led}, {unknown}");
}

/// The loop has no error at a constant velocity, but for what the velocity's quantum leaves.
#[test]
fn it_does_not_lag_at_a_constant_velocity() {
    let velocity = 200.0;
    let mut rig = portal("G21 G90 G94 G61\nG1 Y600 F12000\nM2\n");
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let middle = (rig.rows.iter()).filter(|row| (400.0..550.0).contains(&row.axes[Y].set));
    let errors: Vec<f64> = middle.map(|row| row.axes[Y].following_error).collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let bound = (0.001 * velocity + QUANTUM) / gain();
    println!("constant {velocity} mm/s: mean {mean:.5} of {bound:.4} mm");
    assert!(mean.abs() <= bound, "{mean}");
}

// --- an encoder closes the loop ---

/// Where the encoder reads 0 the axis is 41 mm below machine position 0.
const ENCODER: &str = "[[encoder]]\nname = \"beam\"\nbus = \"portal\"\nnode = 5\n\
    model = \"twk_crn\"\npitch = 20.0\nzero = 16_794\n\n[[axis]]\nname = \"X\"";

/// The encoder's place among the devices.
const BEAM: usize = 4;

/// An increment of it, mm.
const STEP: f64 = 20.0 / 8192.0;

const BY_ENCODER: &str = "following_error_limit = 2.0\nstandstill_window = 0.05\n\
    feedback = \"beam\"\ndifference_limit = 0.5\nposition_loop = \"encoder\"\n\n[[axis]]\nname = \"Z\"";

fn portal_by_encoder(program: &str, configure: impl Fn(usize, &mut Config)) -> Rig {
    let more = [
        ("[[axis]]\nname = \"X\"", ENCODER),
        (UNSUPERVISED, BY_ENCODER),
    ];
    portal_with(&more, program, configure)
}

#[test]
fn an_encoder_closes_the_loop_as_well_as_the_drive() {
    let mut rig = portal_by_encoder(PORTAL_PROGRAM, |_, _| ());
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let y = peak(&rig.rows, Y);
    assert!(y <= bound(5000.0) + STEP && y >= bound(5000.0) / 5.0, "{y}");
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
}

/// What the drive counts is nothing to an axis whose encoder says where it is: it may have counted anything
/// before, and goes where it is sent all the same.
#[test]
fn the_drive_learns_its_place_from_the_encoder() {
    let program = "G21 G90 G94 G61\nG1 Y60 F6000\nM2\n";
    for turns in [-7.3, 0.0, 0.21, 40.0] {
        let mut rig = portal_by_encoder(program, |device, config| {
            if device == DRIVE {
                config.position += turns;
            }
        });
        assert_eq!(rig.finish(), End::Finished, "{turns}: {:?}", rig.events);
        let at = rig.rows.last().unwrap().axes[Y].act;
        assert!((at - 60.0).abs() <= bound(0.0) + STEP, "{turns}: {at}");
    }
}

/// How a TWK CRN is lost, and what is said of it.
pub(super) const LOSSES_OF_ENCODERS: [(Disturbance, &str); 3] = [
    (Disturbance::Mute(true), "no T_PDO in 2 cycles in a row"),
    (Disturbance::Reset, "no T_PDO in 2 cycles in a row"),
    (
        Disturbance::Fault(ErrorClass::StopAndSwitchOff),
        "EMCY FFFFh",
    ),
];

#[test]
fn an_encoder_that_closes_the_loop_and_is_lost_stops_the_machine() {
    for (disturbance, text) in LOSSES_OF_ENCODERS {
        let mut rig = portal_by_encoder(CIRCLES, |_, _| ());
        rig.run_to_row(600);
        rig.twin(BEAM).disturb(disturbance);
        let fault = rig.finish_with_fault().describe(&*rig.layout);
        assert!(
            fault.starts_with("node 5 (beam, TWK CRN): ") && fault.contains(text),
            "{fault}"
        );
        // Without positions it follows no plan any more.
        let words = rig.sent(CobId::r_pdo(3, rig.machine.drives[DRIVE].node));
        let stops = |it: &&Transmission| it.frame.data()[..2] == [0x0B, 0];
        assert!(words.iter().filter(stops).count() > 2, "{disturbance:?}");
        assert!(rig.ends_at_rest());
    }
}

// --- it is lost ---

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// However fast it goes, a quick stop takes it the way that its greatest acceleration allows, and the cycles until it is
    /// noticed.
    #[test]
    fn a_quick_stop_is_as_short_as_the_axis_can(share in 0.05..0.99f64, row in 0..40usize) {
        let speed = 800.0 * share;
        let program = format!("G21 G90 G94 G61\nG1 Y900 F{}\nM2\n", speed * 60.0);
        let mut rig = portal(&program);
        rig.run_until(|rig| rig.rows.last().is_some_and(|row| row.plan.velocity[Y] > 0.999 * speed));
        let begin = rig.rows.len() + row;
        rig.run_to_row(begin);
        let place = |rig: &mut Rig| rig.twin(DRIVE).observe().position * 20.0;
        let from = place(&mut rig);
        rig.twin(DRIVE).disturb(Disturbance::LoseTPdos(10_000));
        while rig.step() {}
        let way = place(&mut rig) - from;
        // Two T_PDOs are missing, the word comes with the next cycle, and the loops follow.
        let most = speed * speed / (2.0 * 5000.0) + speed * (6.0 * CYCLE + 2.0 * LAG) + 1.0;
        prop_assert!(way <= most, "{} mm/s: {} of {} mm", speed, way, most);
        prop_assert!(rig.ends_at_rest());
    }

    /// The drive is fast enough for its axis, up to its own greatest speed.
    #[test]
    fn it_goes_as_fast_as_its_axis_may(velocity in 200.0..1900.0f64) {
        let limit = format!("max_velocity = {velocity}\nmax_acceleration = 20_000.0");
        let more = [("max_velocity = 800.0\nmax_acceleration = 5000.0", &*limit)];
        let program = "G21 G90 G94 G61\nG0 Y900\nM2\n";
        let mut rig = portal_with(&more, program, |_, _| ());
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    }
}

#[test]
fn a_position_that_is_missing_once_is_ridden_out() {
    let mut rig = portal(CIRCLES);
    rig.run_to_row(600);
    for _ in 0..10 {
        rig.twin(DRIVE).disturb(Disturbance::LoseTPdos(1));
        let row = rig.rows.len() + 20;
        rig.run_to_row(row);
    }
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
}

// --- its position is missing for a stated time ---

/// Of the axis Y, its position may be missing for so long.
fn patient(ms: u32) -> String {
    UNSUPERVISED.replace(
        "\n\n[[axis]]",
        &format!("\nposition_loss_ms = {ms}\n\n[[axis]]"),
    )
}

/// Cycles in a row that the position may be missing.
const fn cycles(ms: u32) -> u32 {
    ms / 2
}

/// By how much the axis may be off behind a loss that lasts so long, mm, as start-up tells, and how far the drive's
/// lag that is not known takes it meanwhile, where nothing corrects it.
fn open_loop(rig: &Rig, device: usize, acceleration: f64) -> f64 {
    let extrapolation = rig
        .layout
        .extrapolation(device)
        .expect("it is closed by it");
    extrapolation.off + OF_ACCELERATION * acceleration
}

#[test]
fn start_up_tells_for_how_long_a_position_may_be_missing_and_what_that_leaves_open() {
    let rig = portal_with(&[(UNSUPERVISED, &patient(50))], CIRCLES, |_, _| ());
    let told = rig.layout.supervision(DRIVE);
    // Half of a quarter of 1 r/min is 0.042 mm/s, and Y goes 800 mm/s at most.
    let expected = "while its position is missing, for up to 50 ms, axis Y is taken to go on as it is sent, at the most \
                    0.0021 mm off by the drive's unit of velocity, and goes up to 40.0 mm unseen";
    assert!(told.contains(expected), "{told}");
    let other = rig.layout.supervision(0);
    assert!(!other.contains("while its position"), "{other}");
}

#[test]
fn a_position_is_missing_as_long_as_is_stated_and_no_longer() {
    for ms in [2, 20, 80] {
        for more in [0, 1] {
            let mut rig = portal_with(&[(UNSUPERVISED, &patient(ms))], CIRCLES, |_, _| ());
            rig.run_to_row(600);
            let lost = cycles(ms) + more;
            rig.twin(DRIVE).disturb(Disturbance::LoseTPdos(lost));
            let end = rig.finish();
            if more == 0 {
                assert_eq!(end, End::Finished, "{ms}: {:?}", rig.events);
                continue;
            }
            let cause = DeviceCause::MissingTPdo { misses: lost };
            assert_eq!(end, End::Fault(Fault::Device(DRIVE, cause)), "{ms}");
            assert!(rig.ends_at_rest());
        }
    }
}

/// The time holds for what tells the position, here the encoder; the drive's own T_PDOs may be missing as any others.
#[test]
fn it_holds_for_the_encoder_that_closes_the_loop() {
    let stated = BY_ENCODER.replace("\n\n[[axis]]", "\nposition_loss_ms = 30\n\n[[axis]]");
    for (device, lost) in [(BEAM, 16), (DRIVE, 2)] {
        let more = [
            ("[[axis]]\nname = \"X\"", ENCODER),
            (UNSUPERVISED, &*stated),
        ];
        let mut rig = portal_with(&more, CIRCLES, |_, _| ());
        rig.run_to_row(600);
        rig.twin(device).disturb(Disturbance::LoseTPdos(lost - 1));
        rig.run_to_row(700);
        rig.twin(device).disturb(Disturbance::LoseTPdos(lost));
        let cause = DeviceCause::MissingTPdo { misses: lost };
        assert_eq!(rig.finish(), End::Fault(Fault::Device(device, cause)));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// A difference that was seen once is made up for once, at rest and in motion, however long nothing is seen of it: also
    /// behind 80 ms, which are more than the loop takes, what is left has its sign.
    #[test]
    fn a_difference_is_made_up_for_once_while_nothing_is_seen(
        slip in 0.2..=0.4f64,
        backwards: bool,
        moves: bool,
        row in 20..200usize,
        lost in prop_oneof![Just(0), 36..=40u32, 0..=40u32],
    ) {
        let slip = if backwards { -slip } else { slip };
        let stated = BY_ENCODER.replace("\n\n[[axis]]", "\nposition_loss_ms = 80\n\n[[axis]]");
        let changes = [("[[axis]]\nname = \"X\"", ENCODER), (UNSUPERVISED, &*stated)];
        let (program, acceleration) = match moves {
            true => (CIRCLES, acceleration(100.0) + 500.0),
            false => ("G21 G90\nG4 P2\nM2\n", 0.0),
        };
        let mut rig = portal_with(&changes, program, |_, _| ());
        rig.run_to_row(row);
        rig.slip(0, slip / 20.0);
        rig.run_to_row(row + 1);
        rig.twin(BEAM).disturb(Disturbance::LoseTPdos(lost));
        rig.run_to_row(row + 300);
        // The encoder went on, so the axis is behind by what it slipped.
        let errors: Vec<f64> = rig.rows[row..]
            .iter()
            .map(|row| -row.axes[Y].following_error * slip.signum())
            .collect();
        let most = bound(acceleration) + 2.0 * STEP;
        let (least, greatest) = errors.iter().fold((0.0_f64, 0.0_f64), |(least, greatest), it| {
            (least.min(*it), greatest.max(*it))
        });
        prop_assert!((greatest - slip.abs()).abs() <= most, "{greatest} of {slip}");
        prop_assert!(least >= -most, "{least} of {slip}, {most} at the most");
        let left = errors.last().unwrap();
        prop_assert!(left.abs() <= most, "{left} of {slip}, {most} at the most");
    }

    /// Whenever and as often as positions are missing for no longer than is stated, those of the drive or those of the
    /// encoder that closes the loop, the axis stays within what is told.
    #[test]
    fn an_axis_goes_on_as_it_is_sent(
        ms in prop::sample::select(vec![4, 10, 20, 40, 80]),
        losses in prop::collection::vec((20..150usize, 0.0..=1.0f64), 1..5),
        by_encoder: bool,
    ) {
        let stated = format!("\nposition_loss_ms = {ms}\n\n[[axis]]");
        let by_drive = patient(ms);
        let by_beam = BY_ENCODER.replace("\n\n[[axis]]", &stated);
        let (device, step, changes) = match by_encoder {
            true => {
                let beam = ("[[axis]]\nname = \"X\"", ENCODER);
                (BEAM, STEP, vec![beam, (UNSUPERVISED, &*by_beam)])
            }
            false => (DRIVE, 0.0, vec![(UNSUPERVISED, &*by_drive)]),
        };
        let mut rig = portal_with(&changes, CIRCLES, |_, _| ());
        let mut row = 1;
        for (later, share) in losses {
            row += later;
            rig.run_to_row(row);
            let lost = (f64::from(cycles(ms)) * share) as u32;
            rig.twin(device).disturb(Disturbance::LoseTPdos(lost));
            row += lost as usize;
        }
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let acceleration = acceleration(100.0) + 500.0;
        let most = bound(acceleration) + step + open_loop(&rig, device, acceleration);
        prop_assert!(peak(&rig.rows, Y) <= most, "{} of {most}", peak(&rig.rows, Y));
        rig.trace().assert_within_limits();
    }
}

#[test]
fn each_loss_has_its_own_message() {
    let cases: [(Disturbance, &str); 4] = [
        (Disturbance::LoseTPdos(9), "no T_PDO in 2 cycles in a row"),
        (Disturbance::Mute(true), "no T_PDO in 2 cycles in a row"),
        (Disturbance::Reset, "no T_PDO in 2 cycles in a row"),
        (Disturbance::Fault(ErrorClass::StopAndSwitchOff), "EMCY"),
    ];
    for (disturbance, text) in cases {
        let mut rig = portal(CIRCLES);
        rig.run_to_row(600);
        rig.twin(DRIVE).disturb(disturbance);
        let fault = rig.finish_with_fault().describe(&*rig.layout);
        assert!(
            fault.starts_with("node 3 (Y, Twin Line TLC53x): ") && fault.contains(text),
            "{fault}"
        );
        assert!(rig.ends_at_rest());
    }
}

/// What 2060h of a node was written with, one after the other.
pub(super) fn only_by_fieldbus(rig: &Rig, node: u8) -> Vec<u8> {
    let requests = CanId::from(CobId::r_sdo(NodeId::new(node).unwrap()));
    let writes = rig.frames().into_iter();
    let writes = writes.filter_map(|it| match *it.frame.data() {
        [0x2B, 0x60, 0x20, 0, only, ..] if it.frame.id() == requests => Some(only),
        _ => None,
    });
    writes.collect()
}

/// No panel takes control of a drive that is sent velocities, which would go on with the last one, unless the machine file
/// lets it: then that is a fault by its name. Behind the run a panel may.
#[test]
fn no_panel_takes_it_in_motion() {
    for row in [1, 300, 600] {
        let mut rig = portal(CIRCLES);
        rig.run_to_row(row);
        rig.twin(DRIVE).disturb(Disturbance::Remote(false));
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        assert_eq!(only_by_fieldbus(&rig, 3), [1, 0]);
    }
    let lets = format!("{TLC53X}\nsdo = [[\"2060:0\", 0]]");
    let mut rig = portal_with(&[(TLC53X, &lets)], CIRCLES, |_, _| ());
    rig.run_to_row(600);
    rig.twin(DRIVE).disturb(Disturbance::Remote(false));
    let fault = rig.finish_with_fault().describe(&*rig.layout);
    assert!(fault.contains("not under fieldbus control"), "{fault}");
}

/// A drive that counts, and tells, otherwise than the manual prints, where the machine file says so: the simulated one as well.
#[test]
fn a_drive_that_is_as_its_machine_file_says_follows() {
    for table in [
        "remote_bit = 1",
        "remote_bit = 2",
        "units_per_rpm = 2",
        "units_per_rpm = 4",
    ] {
        let table = format!("[model.tlc5xx]\n{table}\n[[bus]]");
        let mut rig = portal_with(&[("[[bus]]", &table)], CIRCLES, |_, _| ());
        assert_eq!(rig.finish(), End::Finished, "{table}: {:?}", rig.events);
        let y = peak(&rig.rows, Y);
        assert!(y <= bound(acceleration(100.0) + 500.0), "{table}: {y}");
    }
}

/// A unit that is another one than the machine file says.
#[test]
fn another_unit_of_the_velocity_stops_the_axis_by_its_following_error() {
    for units in ["2", "4"] {
        let table = format!("[model.tlc5xx]\nunits_per_rpm = {units}\n[[bus]]");
        let mut rig = portal_with(&[("[[bus]]", &table)], CIRCLES, |_, config| {
            config.assumed.retain(|(name, _)| *name != "units_per_rpm");
        });
        let fault = rig.finish_with_fault();
        assert!(
            matches!(fault, Fault::Axis(Y, AxisCause::FollowingError { .. })),
            "{fault:?}"
        );
    }
}

/// The drive is sent no velocity before the program and none behind it.
#[test]
fn no_velocity_is_sent_to_a_drive_that_is_not_to_move() {
    let mut rig = portal("G21 G90\nG0 X20\nM2\n");
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let id = CobId::r_pdo(3, NodeId::new(3).unwrap());
    let sent: Vec<(u8, i32)> = (rig.sent(id).iter())
        .map(|it| match *it.frame.data() {
            [word, _, a, b, c, d] => (word, i32::from_le_bytes([a, b, c, d])),
            ref data => panic!("{data:?}"),
        })
        .collect();
    assert!(
        sent.iter()
            .all(|(word, velocity)| *word == 0x0F || *velocity == 0)
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// There and back, at every feed: within the bound, which is no more than five times too wide.
    #[test]
    fn it_stays_within_its_bound(to in 20.0..800.0f64, feed in 500.0..30_000.0f64, share in 0.0..0.5f64) {
        let program = format!(
            "G21 G90 G94 G61\nG1 Y{to:.3} F{feed:.0}\nG1 Y{:.3}\nM2\n",
            share * to
        );
        let mut rig = portal(&program);
        prop_assert_eq!(rig.finish(), End::Finished);
        let (error, bound) = (peak(&rig.rows, Y), bound(acceleration(feed / 60.0)));
        println!("there and back at {:.0} mm/s: {error:.4} of {bound:.4} mm", feed / 60.0);
        prop_assert!((bound / 5.0..=bound).contains(&error), "{} mm, bound {}", error, bound);
    }

    /// A coupling that slips by less than the limit, at any time: by the encoder the axis is where it was sent,
    /// and the drive has made up for the slip. What is beyond the limit is found.
    #[test]
    fn a_slip_is_made_up_for(row in 5..400usize, size in 0.0..0.045f64, backward: bool) {
        let turns = if backward { -size } else { size };
        let slipped = turns * 20.0;
        let mut rig = portal_by_encoder("G21 G90 G94 G61\nG1 Y60 F6000\nG1 Y20\nG4 P0.5\nM2\n", |_, _| ());
        rig.run_to_row(1);
        let began = rig.twin(DRIVE).observe().position;
        rig.run_to_row(row);
        rig.slip(0, turns);
        let end = rig.finish();
        if slipped.abs() < 0.45 {
            prop_assert_eq!(end, End::Finished, "{:?}", rig.events);
            let by_encoder = rig.rows.last().unwrap().axes[Y].act;
            prop_assert!((by_encoder - 20.0).abs() <= bound(0.0) + STEP, "{}", by_encoder);
            let by_drive = (rig.twin(DRIVE).observe().position - began) * 20.0;
            prop_assert!((by_drive - 20.0 + slipped).abs() <= bound(0.0) + STEP, "{}", by_drive);
        } else if slipped.abs() > 0.55 {
            prop_assert!(matches!(end, End::Fault(Fault::Axis(Y, AxisCause::FeedbackDifference { .. }))), "{:?}", end);
        }
    }
}
