//! The CANopen node: NMT, monitoring, EMCY, PDO services, errors and their reset.

use crate::common::lxm32m::Bench;
use crate::common::{id, ms};
use syncline_canopen::cia402::{State, Statusword};
use syncline_canopen::dictionary::Refusals;
use syncline_canopen::nmt::{self, Command};
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, CanId, Frame};
use syncline_drives::twin::lxm32m::{DriveError, Identity, Policies, TwinConfig};
use syncline_drives::twin::{Disturbance, ErrorClass, SimulatedDevice};

fn enabled() -> Bench {
    let mut bench = Bench::one();
    for word in [0x0006, 0x000F] {
        bench.controlword(1, word);
    }
    assert_eq!(bench.twin().state(), State::OperationEnabled);
    bench
}

/// Runs at 300 rpm.
fn moving() -> Bench {
    let mut bench = enabled();
    bench.write(1, 0x6060, 0, &[3]).unwrap();
    bench.write(1, 0x60FF, 0, &300u32.to_le_bytes()).unwrap();
    bench.wait(ms(1000));
    assert!(bench.twin().observe().velocity > 4.0);
    bench
}

fn frames(bench: &Bench, from: usize, id: u16) -> Vec<Frame> {
    let of = |frame: &Frame| frame.id() == CanId::Standard(id);
    let log = bench.log[from..].iter().map(|received| received.frame);
    log.filter(of).collect()
}

#[test]
fn boots_into_pre_operational_and_says_who_it_is() {
    let mut bench = Bench::one();
    assert_eq!(
        frames(&bench, 0, 0x701),
        [Frame::new(CanId::Standard(0x701), &[0])]
    );
    assert_eq!(bench.twin().observe().nmt_state, nmt::State::PreOperational);
    assert_eq!(
        bench.read(1, 0x1000, 0).unwrap(),
        0x0042_0192u32.to_le_bytes()
    );
    assert_eq!(
        bench.read(1, 0x1018, 1).unwrap(),
        0x0800_005Au32.to_le_bytes()
    );
    let mut stranger = Bench::new([TwinConfig {
        identity: Identity {
            vendor_id: 0x1234,
            ..Identity::default()
        },
        ..TwinConfig::new(id(1))
    }]);
    stranger.nmt(Command::ResetCommunication, 1);
    stranger.wait(ms(50));
    assert_eq!(
        stranger.read(1, 0x1018, 1).unwrap(),
        0x1234u32.to_le_bytes()
    );
}

#[test]
fn stopping_or_resetting_the_node_with_power_on_is_an_error_of_class_2() {
    for (command, number) in [
        (Command::Stop, 0xB401),
        (Command::ResetCommunication, 0xB400),
        (Command::ResetNode, 0xB400),
    ] {
        let mut bench = moving();
        bench.nmt(command, 1);
        assert_eq!(
            bench.twin().state(),
            State::FaultReactionActive,
            "{command:?}"
        );
        bench.wait(ms(1000));
        assert_eq!(bench.twin().state(), State::Fault);
        assert!(bench.twin().observe().velocity.abs() < 1e-3);
        bench.nmt(Command::EnterPreOperational, 1);
        bench.wait(ms(10));
        if command == Command::Stop {
            assert_eq!(bench.read_u16(1, 0x603F, 0), number);
        }
    }
}

#[test]
fn resets_forget_the_communication_profile_and_a_node_reset_the_rest() {
    for (command, scaling) in [
        (Command::ResetCommunication, 131_072),
        (Command::ResetNode, 16_384),
    ] {
        let mut bench = Bench::one();
        bench.write(1, 0x1017, 0, &[100, 0]).unwrap();
        bench
            .write(1, 0x3006, 7, &131_072u32.to_le_bytes())
            .unwrap();
        let from = bench.log.len();
        bench.nmt(command, 1);
        bench.expect(from, 0x701, ms(100)).expect("boot-up");
        assert_eq!(bench.read(1, 0x1017, 0).unwrap(), [0, 0]);
        assert_eq!(bench.read_i32(1, 0x3006, 7), scaling);
    }
}

#[test]
fn stored_parameters_survive_power_and_unstored_ones_do_not() {
    let mut bench = Bench::one();
    let reboot = |bench: &mut Bench| {
        let from = bench.log.len();
        bench.twin().disturb(Disturbance::Reset);
        bench.expect(from, 0x701, ms(100)).expect("boot-up");
    };
    bench.write(1, 0x3029, 4, &111u32.to_le_bytes()).unwrap();
    bench.write(1, 0x3004, 1, &1u16.to_le_bytes()).unwrap();
    bench.write(1, 0x3029, 5, &222u32.to_le_bytes()).unwrap();
    reboot(&mut bench);
    assert_eq!(bench.read_i32(1, 0x3029, 4), 111);
    assert_eq!(bench.read_i32(1, 0x3029, 5), 180);
    bench.write(1, 0x3004, 8, &1u16.to_le_bytes()).unwrap();
    reboot(&mut bench);
    assert_eq!(bench.read_i32(1, 0x3029, 4), 60);
}

#[test]
fn heartbeats_come_in_time_and_carry_the_state() {
    let mut bench = Bench::one();
    bench.write(1, 0x1017, 0, &[50, 0]).unwrap();
    let from = bench.log.len();
    bench.wait(ms(1000));
    let beats: Vec<_> = bench.log[from..].to_vec();
    assert_eq!(beats.len(), 20);
    for pair in beats.windows(2) {
        let gap = (pair[1].at - pair[0].at).as_micros();
        assert!((49_900..50_100).contains(&gap), "{gap}");
    }
    assert_eq!(beats[0].frame.data(), [0x7F]);
    bench.nmt(Command::Start, 0);
    let from = bench.log.len();
    bench.wait(ms(100));
    assert_eq!(frames(&bench, from, 0x701)[0].data(), [0x05]);
}

#[test]
fn a_watched_heartbeat_that_stays_away_is_a_fault_and_leaves_operational() {
    let mut bench = enabled();
    bench
        .write(1, 0x1016, 1, &0x007F_0064u32.to_le_bytes())
        .unwrap();
    bench.nmt(Command::Start, 1);
    // Not watched before the first.
    bench.wait(ms(500));
    assert_eq!(bench.twin().state(), State::OperationEnabled);
    for _ in 0..5 {
        bench.send(0x77F, &[5]);
        bench.wait(ms(80));
    }
    assert_eq!(bench.twin().state(), State::OperationEnabled);
    let from = bench.log.len();
    bench.wait(ms(100));
    assert_eq!(bench.twin().state(), State::Fault);
    assert_eq!(bench.twin().observe().nmt_state, nmt::State::PreOperational);
    let emcy = frames(&bench, from, 0x081);
    assert_eq!(emcy[0].data()[..3], [0x30, 0x81, 0x11]);
}

/// Each of the three consumers counts for itself, and 1029h:1 says where the node goes.
#[test]
fn three_heartbeats_are_watched_and_1029_says_what_follows() {
    for (behaviour, state) in [
        (0, nmt::State::PreOperational),
        (1, nmt::State::Operational),
        (2, nmt::State::Stopped),
    ] {
        let mut bench = Bench::one();
        bench.write(1, 0x1029, 1, &[behaviour]).unwrap();
        for sub in 1..=3 {
            let watched = 0x0070_0032u32 + (u32::from(sub) << 16);
            bench.write(1, 0x1016, sub, &watched.to_le_bytes()).unwrap();
        }
        bench.nmt(Command::Start, 1);
        for silent in 0..10 {
            for node in [0x771, 0x772, 0x773] {
                if node != 0x772 || silent < 5 {
                    bench.send(node, &[5]);
                }
            }
            let before = bench.twin().observe().nmt_state;
            assert!(before == nmt::State::Operational || silent > 5, "{silent}");
            bench.wait(ms(40));
        }
        assert_eq!(bench.twin().observe().nmt_state, state);
        assert_eq!(bench.twin().state(), State::Fault);
    }
}

/// 1014h and 1005h: the function code can be changed (lxm32m 3079-3085, 3228-3236); 1015h keeps
/// two EMCYs apart.
#[test]
fn emcy_and_sync_can_be_moved() {
    let mut bench = mapped(1);
    bench
        .write(1, 0x1005, 0, &0x8000_0100u32.to_le_bytes())
        .unwrap();
    assert_eq!(syncs(&mut bench, 3), 0);
    let from = bench.log.len();
    bench.send(0x100, &[]);
    bench.wait(ms(2));
    assert_eq!(frames(&bench, from, 0x381).len(), 1);

    bench
        .write(1, 0x1014, 0, &0x4000_0501u32.to_le_bytes())
        .unwrap();
    bench.write(1, 0x1015, 0, &1000u16.to_le_bytes()).unwrap();
    let from = bench.log.len();
    bench.twin().raise(DriveError::SYNC_LOST);
    bench.wait(ms(20));
    bench.controlword(1, 0x0080);
    assert_eq!(frames(&bench, from, 0x501).len(), 1);
    bench.wait(ms(100));
    let told = frames(&bench, from, 0x501);
    assert_eq!(told.len(), 2, "100 ms after the first");
    assert_eq!(told[1].data()[..3], [0, 0, 0], "no error any more");
    assert_eq!(frames(&bench, from, 0x081), []);
}

#[test]
fn guarding_answers_toggle_and_its_absence_is_a_fault() {
    let mut bench = Bench::one();
    bench.write(1, 0x100C, 0, &[50, 0]).unwrap();
    bench.write(1, 0x100D, 0, &[3]).unwrap();
    let request = Frame::remote(CanId::Standard(0x701), 1).unwrap();
    let mut answers = vec![];
    for _ in 0..3 {
        let from = bench.log.len();
        bench.bus.send(syncline_drives::bus::Band::Acyclic, request);
        bench.wait(ms(40));
        answers.extend(
            frames(&bench, from, 0x701)
                .iter()
                .map(|frame| frame.data()[0]),
        );
    }
    assert_eq!(answers, [0x7F, 0xFF, 0x7F]);
    assert_eq!(bench.twin().state(), State::ReadyToSwitchOn);
    bench.wait(ms(200));
    assert_eq!(bench.twin().state(), State::Fault);
}

#[test]
fn each_error_class_has_its_reaction() {
    let raise = |class| {
        let mut bench = moving();
        let from = bench.log.len();
        bench.twin().raise(DriveError {
            class,
            number: 0x1234,
            emcy_code: 0x1000,
            register: 0x80,
        });
        bench.wait(ms(2));
        let first = bench.twin().state();
        bench.wait(ms(1500));
        let emcys = frames(&bench, from, 0x081).len();
        (first, bench.twin().state(), emcys)
    };
    use State::{Fault, FaultReactionActive, OperationEnabled, QuickStopActive};
    assert_eq!(
        raise(ErrorClass::Warning),
        (OperationEnabled, OperationEnabled, 0)
    );
    assert_eq!(
        raise(ErrorClass::QuickStop),
        (QuickStopActive, QuickStopActive, 1)
    );
    assert_eq!(
        raise(ErrorClass::StopAndSwitchOff),
        (FaultReactionActive, Fault, 1)
    );
    assert_eq!(raise(ErrorClass::SwitchOff), (Fault, Fault, 1));
    assert_eq!(raise(ErrorClass::Fatal), (Fault, Fault, 1));
}

/// 1315: without DC bus voltage state 3 is not left and bit 4 is 0.
#[test]
fn without_mains_there_is_no_way_to_state_4() {
    let mut bench = Bench::one();
    let status = |bench: &mut Bench| bench.twin().statusword();
    assert!(status(&mut bench).has(Statusword::VOLTAGE_ENABLED));
    bench.twin().disturb(Disturbance::Mains(false));
    for word in [0x0000, 0x0006, 0x000F] {
        bench.controlword(1, word);
        assert_eq!(bench.twin().state(), State::SwitchOnDisabled);
    }
    assert!(!status(&mut bench).has(Statusword::VOLTAGE_ENABLED));
    bench.twin().disturb(Disturbance::Mains(true));
    bench.wait(ms(10));
    assert_eq!(bench.twin().state(), State::ReadyToSwitchOn);
    let mut bench = moving();
    bench.twin().disturb(Disturbance::Mains(false));
    bench.wait(ms(5));
    assert_eq!(bench.twin().state(), State::Fault);
}

/// 1327: bit 9 is 0, commands are not executed, parameters can be read and written (1991).
#[test]
fn another_access_channel_leaves_the_fieldbus_parameters_only() {
    let mut bench = enabled();
    bench.nmt(Command::Start, 1);
    bench.twin().disturb(Disturbance::Remote(false));
    assert!(!bench.twin().statusword().has(Statusword::REMOTE));
    let refused = bench.write(1, 0x6040, 0, &[0, 0]);
    assert_eq!(refused, Err(AbortCode::LocalControl.code()));
    bench.send(0x201, &[0, 0]);
    bench.wait(ms(5));
    assert_eq!(bench.twin().state(), State::OperationEnabled);
    assert_eq!(bench.write(1, 0x6081, 0, &77u32.to_le_bytes()), Ok(()));
    assert_eq!(bench.read_i32(1, 0x6081, 0), 77);
    bench.twin().disturb(Disturbance::Remote(true));
    bench.send(0x201, &[0, 0]);
    bench.wait(ms(5));
    assert_eq!(bench.twin().state(), State::ReadyToSwitchOn);
}

#[test]
fn a_warning_shows_for_a_tenth_of_a_second() {
    let mut bench = enabled();
    bench.twin().raise(DriveError {
        class: ErrorClass::Warning,
        number: 0x0042,
        emcy_code: 0,
        register: 0,
    });
    let warns = |bench: &mut Bench| bench.twin().statusword().has(Statusword::WARNING);
    bench.wait(ms(95));
    assert!(warns(&mut bench));
    bench.wait(ms(10));
    assert!(!warns(&mut bench));
    assert_eq!(bench.read_u16(1, 0x301C, 9), 0x0042);
}

#[test]
fn a_fault_is_told_kept_and_reset_by_the_edge_once_its_cause_is_gone() {
    let mut bench = enabled();
    let from = bench.log.len();
    bench.twin().disturb(Disturbance::FaultPersists(true));
    bench.twin().raise(DriveError {
        class: ErrorClass::SwitchOff,
        number: 0x1A2B,
        emcy_code: 0x1000,
        register: 0x80,
    });
    bench.wait(ms(5));
    let emcy = frames(&bench, from, 0x081)[0];
    assert_eq!(emcy.data(), [0x00, 0x10, 0x81, 0, 0, 0, 0x2B, 0x1A]);
    assert_eq!(bench.read(1, 0x1001, 0).unwrap(), [0x81]);
    assert_eq!(bench.read(1, 0x1003, 0).unwrap(), [1]);
    assert_eq!(
        bench.read(1, 0x1003, 1).unwrap(),
        0x1A2B_1000u32.to_le_bytes()
    );
    assert_eq!(bench.read_u16(1, 0x603F, 0), 0x1A2B);
    assert_eq!(bench.read_u16(1, 0x303C, 1), 0x1A2B);
    assert_eq!(bench.read_u16(1, 0x303C, 2), 3);
    bench.write(1, 0x303B, 4, &[1, 0]).unwrap();
    assert_eq!(bench.read_u16(1, 0x303C, 1), 0);
    bench.controlword(1, 0x0080);
    assert_eq!(
        bench.twin().state(),
        State::Fault,
        "the cause is still there"
    );
    bench.twin().disturb(Disturbance::FaultPersists(false));
    bench.controlword(1, 0x0080);
    assert_eq!(bench.twin().state(), State::Fault, "no edge");
    bench.controlword(1, 0x0000);
    bench.controlword(1, 0x0080);
    assert_eq!(bench.twin().state(), State::ReadyToSwitchOn);
    assert_eq!(bench.read(1, 0x1001, 0).unwrap(), [0]);
    assert_eq!(frames(&bench, from, 0x081)[1].data(), [0; 8]);
    assert_eq!(
        bench.write(1, 0x1003, 0, &[1]),
        Err(AbortCode::InvalidValue.code())
    );
    bench.write(1, 0x1003, 0, &[0]).unwrap();
    assert_eq!(bench.read(1, 0x1003, 1).unwrap(), [0; 4]);
}

#[test]
fn with_ds402_compatible_3_to_4_takes_a_shutdown() {
    let mut bench = Bench::one();
    bench.write(1, 0x301B, 0x13, &[1, 0]).unwrap();
    bench.controlword(1, 0x0000);
    assert_eq!(bench.twin().state(), State::SwitchOnDisabled);
    bench.controlword(1, 0x0006);
    assert_eq!(bench.twin().state(), State::ReadyToSwitchOn);
    bench.controlword(1, 0x0007);
    assert_eq!(bench.twin().state(), State::SwitchedOn);
    bench.controlword(1, 0x000F);
    assert_eq!(bench.twin().state(), State::OperationEnabled);
    bench.controlword(1, 0x0007);
    assert_eq!(bench.twin().state(), State::SwitchedOn);
}

#[test]
fn a_second_sdo_server_can_be_opened() {
    let mut bench = Bench::one();
    bench
        .write(1, 0x1201, 1, &0x0000_06A0u32.to_le_bytes())
        .unwrap();
    bench
        .write(1, 0x1201, 2, &0x0000_0690u32.to_le_bytes())
        .unwrap();
    let from = bench.log.len();
    bench.send(0x6A0, &[0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
    let answer = bench.expect(from, 0x690, ms(10)).expect("an answer");
    assert_eq!(answer.data(), [0x43, 0x00, 0x10, 0, 0x92, 0x01, 0x42, 0x00]);
}

#[test]
fn block_requests_are_refused() {
    let mut bench = Bench::one();
    for command in [0xA4, 0xC6] {
        let answer = bench.request(1, [command, 0x08, 0x10, 0, 0, 0, 0, 0]);
        assert_eq!(answer, [0x80, 0x08, 0x10, 0, 0x01, 0x00, 0x04, 0x05]);
    }
}

#[test]
fn writes_that_are_wrong_get_the_manuals_abort_codes() {
    let mut bench = enabled();
    let aborts = [
        (0x6060, 0, vec![11], AbortCode::InvalidValue),
        (0x6060, 0, vec![2], AbortCode::InvalidValue),
        (0x6060, 0, vec![7, 0], AbortCode::TooLong),
        (0x6041, 0, vec![0, 0], AbortCode::ReadOnly),
        (0x6040, 5, vec![0], AbortCode::UnknownSubindex),
        (0x1006, 0, vec![0; 4], AbortCode::UnknownObject),
        (0x1401, 2, vec![245], AbortCode::InvalidValue),
        (0x60C2, 1, vec![0], AbortCode::InvalidValue),
        (0x3006, 7, vec![0; 4], AbortCode::InvalidValue),
        (0x3006, 7, vec![1, 0, 0, 0], AbortCode::DeviceState),
        (
            0x1601,
            1,
            0x6041_0010u32.to_le_bytes().to_vec(),
            AbortCode::UnsupportedAccess,
        ),
    ];
    for (index, sub, bytes, code) in aborts {
        assert_eq!(
            bench.write(1, index, sub, &bytes),
            Err(code.code()),
            "{index:04X}:{sub}"
        );
    }
    bench.twin().disturb(Disturbance::RefuseWrite(
        Address::new(0x6065, 0),
        AbortCode::General,
    ));
    assert_eq!(
        bench.write(1, 0x6065, 0, &[0; 4]),
        Err(AbortCode::General.code())
    );
}

// ---- PDO ----

/// T_PDO4 with actual position and velocity, R_PDO4 with a target velocity.
fn mapped(kind: u8) -> Bench {
    let mut bench = Bench::one();
    for (index, entries) in [
        (0x1A03u16, vec![0x6041_0010u32, 0x6064_0020]),
        (0x1603, vec![0x60FF_0020]),
    ] {
        bench.write(1, index, 0, &[0]).unwrap();
        for (place, entry) in entries.iter().enumerate() {
            bench
                .write(1, index, place as u8 + 1, &entry.to_le_bytes())
                .unwrap();
        }
        bench.write(1, index, 0, &[entries.len() as u8]).unwrap();
    }
    // T_PDO4's and R_PDO4's types cannot be written: map into the third pair instead.
    assert_eq!(
        bench.write(1, 0x1803, 2, &[1]),
        Err(AbortCode::ReadOnly.code())
    );
    for (index, entry) in [(0x1A02u16, 0x6064_0020u32), (0x1602, 0x60FF_0020)] {
        bench.write(1, index, 0, &[0]).unwrap();
        bench.write(1, index, 1, &entry.to_le_bytes()).unwrap();
        bench.write(1, index, 0, &[1]).unwrap();
    }
    bench.write(1, 0x1802, 2, &[kind]).unwrap();
    bench.write(1, 0x1802, 5, &[0, 0]).unwrap();
    bench.write(1, 0x1402, 2, &[kind]).unwrap();
    bench
        .write(1, 0x1802, 1, &0x0000_0381u32.to_le_bytes())
        .unwrap();
    bench
        .write(1, 0x1402, 1, &0x0000_0401u32.to_le_bytes())
        .unwrap();
    bench.nmt(Command::Start, 1);
    bench.wait(ms(20));
    bench
}

fn syncs(bench: &mut Bench, count: u32) -> usize {
    let from = bench.log.len();
    for _ in 0..count {
        bench.sync();
        bench.wait(ms(2));
    }
    frames(bench, from, 0x381).len()
}

#[test]
fn cyclic_synchronous_t_pdos_come_every_nth_sync() {
    assert_eq!(syncs(&mut mapped(1), 12), 12);
    assert_eq!(syncs(&mut mapped(4), 12), 3);
}

/// D-12, D-09 and D-44: reserved types, the count of an R_PDO's cycle, masks of cyclic T_PDOs.
#[test]
fn transmission_types_that_the_manual_leaves_open() {
    let mut bench = mapped(1);
    for kind in [241, 246, 251] {
        for index in [0x1402, 0x1802] {
            let refused = bench.write(1, index, 2, &[kind]);
            assert_eq!(refused, Err(AbortCode::InvalidValue.code()), "{kind}");
        }
    }
    bench.write(1, 0x3041, 0x0D, &[0, 0]).unwrap();
    assert_eq!(syncs(&mut bench, 5), 5, "a mask counts for events only");

    let mut bench = mapped(240);
    bench.send(0x401, &55u32.to_le_bytes());
    bench.wait(ms(2));
    syncs(&mut bench, 1);
    assert_eq!(bench.read_i32(1, 0x60FF, 0), 55);
}

/// Each bit of 3041h:E is an object of T_PDO4.
#[test]
fn an_event_mask_picks_mapped_objects() {
    let mut bench = mapped(255);
    bench
        .write(1, 0x1803, 1, &0x0000_0481u32.to_le_bytes())
        .unwrap();
    let sent = |bench: &mut Bench, mask: u8| {
        bench.write(1, 0x3041, 0x0E, &[mask, 0]).unwrap();
        bench.wait(ms(20));
        let from = bench.log.len();
        // The statusword changes, the second object by noise.
        bench.controlword(1, 0x0002);
        bench.wait(ms(50));
        frames(bench, from, 0x481).len()
    };
    assert_eq!(sent(&mut bench, 0), 0);
    assert!((1..=3).contains(&sent(&mut bench, 1)));
    bench
        .write(1, 0x3006, 7, &131_072u32.to_le_bytes())
        .unwrap();
    assert!(sent(&mut bench, 2) > 5);
    assert_eq!(
        bench.write(1, 0x3041, 0x0E, &[16, 0]),
        Err(AbortCode::InvalidValue.code())
    );
}

#[test]
fn an_acyclic_synchronous_t_pdo_waits_for_an_event() {
    let mut bench = mapped(0);
    syncs(&mut bench, 3);
    // The mask of 3041h:D says that the first object's changes count; none: nothing is sent.
    bench.write(1, 0x3041, 0x0D, &[0, 0]).unwrap();
    syncs(&mut bench, 3);
    assert_eq!(syncs(&mut bench, 10), 0);
}

#[test]
fn t_pdos_on_request() {
    for kind in [252, 253] {
        let mut bench = mapped(kind);
        // Bit 30 of the default forbids remote requests, and is read-only.
        assert_eq!(syncs(&mut bench, 3), 0);
        let from = bench.log.len();
        let request = Frame::remote(CanId::Standard(0x381), 4).unwrap();
        bench.bus.send(syncline_drives::bus::Band::Acyclic, request);
        bench.wait(ms(5));
        assert_eq!(frames(&bench, from, 0x381), []);
    }
}

#[test]
fn event_timer_and_inhibit_time_pace_an_event_driven_t_pdo() {
    let mut bench = mapped(255);
    bench.write(1, 0x3041, 0x0D, &[0, 0]).unwrap();
    bench.write(1, 0x1802, 5, &[20, 0]).unwrap();
    bench.wait(ms(20));
    let from = bench.log.len();
    bench.wait(ms(400));
    assert_eq!(frames(&bench, from, 0x381).len(), 20);
    // Every change of the noisy position counts now, but no more than one in 10 ms is sent.
    bench.write(1, 0x1802, 5, &[0, 0]).unwrap();
    bench.write(1, 0x1802, 3, &100u16.to_le_bytes()).unwrap();
    bench.write(1, 0x3041, 0x0D, &[1, 0]).unwrap();
    bench
        .write(1, 0x3006, 7, &131_072u32.to_le_bytes())
        .unwrap();
    let from = bench.log.len();
    bench.wait(ms(400));
    let count = frames(&bench, from, 0x381).len();
    assert!((30..=41).contains(&count), "{count}");
}

#[test]
fn r_pdos_act_at_once_or_with_the_next_sync() {
    for (kind, at_once) in [(255, true), (0, false), (1, false)] {
        let mut bench = mapped(kind);
        bench.send(0x401, &123u32.to_le_bytes());
        bench.wait(ms(2));
        assert_eq!(bench.read_i32(1, 0x60FF, 0) == 123, at_once, "type {kind}");
        syncs(&mut bench, 1);
        assert_eq!(bench.read_i32(1, 0x60FF, 0), 123);
        bench.nmt(Command::EnterPreOperational, 1);
        bench.send(0x401, &7u32.to_le_bytes());
        syncs(&mut bench, 1);
        assert_eq!(
            bench.read_i32(1, 0x60FF, 0),
            123,
            "PDOs live in Operational only"
        );
    }
}

#[test]
fn a_longer_r_pdo_is_taken_and_a_shorter_one_is_an_emcy() {
    let mut bench = mapped(255);
    bench.send(0x401, &[1, 0, 0, 0, 9, 9]);
    bench.wait(ms(2));
    assert_eq!(bench.read_i32(1, 0x60FF, 0), 1);
    let from = bench.log.len();
    bench.send(0x401, &[2, 0, 0]);
    bench.wait(ms(2));
    assert_eq!(bench.read_i32(1, 0x60FF, 0), 1);
    let emcy = frames(&bench, from, 0x081);
    assert_eq!(
        (emcy[0].data()[..2].to_vec(), emcy[0].data()[5]),
        (vec![0x10, 0x82], 3)
    );
}

#[test]
fn a_mapping_beyond_eight_bytes_is_refused() {
    let mut bench = Bench::one();
    bench.write(1, 0x1A03, 0, &[0]).unwrap();
    for (place, entry) in [0x6064_0020u32, 0x606C_0020, 0x6041_0010]
        .iter()
        .enumerate()
    {
        bench
            .write(1, 0x1A03, place as u8 + 1, &entry.to_le_bytes())
            .unwrap();
    }
    assert_eq!(
        bench.write(1, 0x1A03, 0, &[3]),
        Err(AbortCode::PdoLength.code())
    );
    assert_eq!(bench.write(1, 0x1A03, 0, &[2]), Ok(()));
    assert_eq!(
        bench.write(1, 0x1A03, 0, &[5]),
        Err(AbortCode::PdoLength.code())
    );
}

#[test]
fn a_mute_node_says_nothing_and_comes_back() {
    let mut bench = Bench::one();
    bench.write(1, 0x1017, 0, &[10, 0]).unwrap();
    bench.twin().disturb(Disturbance::Mute(true));
    let from = bench.log.len();
    bench.wait(ms(200));
    assert_eq!(bench.log.len(), from);
    bench.twin().disturb(Disturbance::Mute(false));
    bench.wait(ms(100));
    assert!(bench.log.len() > from);
}

#[test]
fn dropped_t_pdos_are_lost_and_no_more() {
    let mut bench = mapped(1);
    bench.twin().disturb(Disturbance::LoseTPdos(2));
    assert_eq!(syncs(&mut bench, 10), 8);
}

#[test]
fn policies_change_what_the_manual_leaves_open() {
    let mut bench = Bench::new([TwinConfig {
        policies: Policies {
            emcy_on_reset: false,
            refusals: Refusals {
                long_and_short: false,
                high_and_low: true,
            },
            enable_time: Duration::from_millis(100),
            ..Policies::default()
        },
        ..TwinConfig::new(id(1))
    }]);
    let too_high = AbortCode::ValueTooHigh.code();
    assert_eq!(bench.write(1, 0x6060, 0, &[100]), Err(too_high));
    let mismatch = AbortCode::LengthMismatch.code();
    assert_eq!(bench.write(1, 0x6060, 0, &[1, 0]), Err(mismatch));
    bench.controlword(1, 0x0006);
    bench.controlword(1, 0x000F);
    assert_eq!(bench.twin().state(), State::SwitchedOn);
    bench.wait(ms(100));
    assert_eq!(bench.twin().state(), State::OperationEnabled);
    let from = bench.log.len();
    bench.twin().raise(DriveError::FOLLOWING_ERROR);
    bench.controlword(1, 0x0080);
    assert_eq!(frames(&bench, from, 0x081).len(), 1);
}
