//! Every fault's text: whom it concerns, what came, what was expected, what to do.

use std::path::Path;
use syncline_canopen::emcy::Emergency;
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::{Address, NodeId, nmt};
use syncline_controller::control::fault::{
    AwaitedState, AxisCause, BlockCause, BusCause, DeviceCause, SpindleCause,
};
use syncline_controller::control::{
    Fault, HomingFailure, Layout, ProbeFailure, Quantity, ThreadFailure,
};
use syncline_controller::machine::Machine;
use syncline_drives::model::{Data, NotFollowing, StatusWord};
use syncline_trajectory::path::JogError;
use syncline_trajectory::synchronous::LostStep;

const OBJECT: Address = Address::new(0x60C2, 1);
const SWITCHED_ON: StatusWord = StatusWord {
    name: "statusword",
    value: Data::u16(0x0233),
    meaning: "Switched On",
};

/// Faults, each with its pattern and its text. A fault without a row does not compile.
macro_rules! texts {
    ($($pattern:pat, $fault:expr, $text:literal;)*) => {
        const TEXTS: &[(Fault, &str)] = &[$(($fault, $text)),*];

        #[test]
        fn every_fault_has_its_text() {
            let layout = portal();
            for (fault, text) in TEXTS {
                assert_eq!(fault.describe(&layout), *text, "{fault:?}");
            }
            let mut rows = TEXTS.iter().map(|(fault, _)| *fault);
            $(assert!(matches!(rows.next(), Some($pattern)), "{}", stringify!($pattern));)*
        }

        #[allow(dead_code, reason = "compiled only")]
        fn is_complete(fault: Fault) {
            match fault {
                $($pattern => (),)*
            }
        }
    };
}

fn portal() -> Layout {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/portal/machine.toml");
    let enable =
        "[[input]]\nname = \"enable\"\ndrive = \"Y\"\nsignal = \"DI0\"\nfunction = \"enable\"\n";
    let encoder = "[[encoder]]\nname = \"screw\"\nbus = \"portal\"\nnode = 5\nmodel = \"twk_crn\"\n\
                   pitch = 10.0\n";
    let z = "name = \"Z\"\ndrives";
    let feedback = format!("feedback = \"screw\"\ndifference_limit = 0.2\n{z}");
    let text = std::fs::read_to_string(&file).unwrap();
    let text = format!("{enable}{encoder}{}", text.replace(z, &feedback));
    Layout::new(&Machine::parse(&file, &text).unwrap()).unwrap()
}

texts! {
    Fault::Device(_, DeviceCause::NoAnswer), Fault::Device(4, DeviceCause::NoAnswer),
    "node 5 (screw, TWK CRN): no answer after the reset: check power, cabling, node id and bit rate";

    Fault::Device(_, DeviceCause::NoBootUp), Fault::Device(2, DeviceCause::NoBootUp),
    "node 3 (Y, LXM32M): no boot-up message after the reset: check power, cabling, node id and bit \
     rate";

    Fault::Device(_, DeviceCause::WrongIdentity { .. }),
    Fault::Device(2, DeviceCause::WrongIdentity {
        object: OBJECT, name: "vendor id", expected: 0x5A, found: 0xB7,
    }),
    "node 3 (Y, LXM32M): object 60C2h:1 (vendor id) reads 000000B7h, expected 0000005Ah: another \
     device has this node id, or it is not what the machine file says";

    Fault::Device(_, DeviceCause::WriteAborted { .. }),
    Fault::Device(2, DeviceCause::WriteAborted {
        object: OBJECT, value: 25, code: AbortCode::InvalidValue,
    }),
    "node 3 (Y, LXM32M): SDO write 60C2h:1 = 25 aborted 0609 0030h \"invalid value for \
     parameter\": check the value, and `sdo` in the machine file";

    Fault::Device(_, DeviceCause::ReadAborted { .. }),
    Fault::Device(2, DeviceCause::ReadAborted {
        object: OBJECT, code: AbortCode::InvalidValue, remedy: "leave what needs it out",
    }),
    "node 3 (Y, LXM32M): SDO read 60C2h:1 aborted 0609 0030h \"invalid value for parameter\": \
     leave what needs it out";

    Fault::Device(_, DeviceCause::WrongAnswer { .. }),
    Fault::Device(2, DeviceCause::WrongAnswer { object: OBJECT, code: AbortCode::ToggleBit }),
    "node 3 (Y, LXM32M): SDO 60C2h:1 answered wrongly, 0503 0000h \"toggle bit not alternated\": \
     check for another master or tool that talks to it, and the device's firmware";

    Fault::Device(_, DeviceCause::SdoTimeout { .. }),
    Fault::Device(2, DeviceCause::SdoTimeout { object: OBJECT }),
    "node 3 (Y, LXM32M): no answer to SDO 60C2h:1: check that the device is on the bus";

    Fault::Device(_, DeviceCause::ReadBack { .. }),
    Fault::Device(2, DeviceCause::ReadBack { object: OBJECT, expected: 10, found: 20 }),
    "node 3 (Y, LXM32M): object 60C2h:1 reads back 20 (14h), expected 10 (Ah): check for another \
     master or tool, and the device's firmware";

    Fault::Device(_, DeviceCause::StaysEnabled { .. }),
    Fault::Device(2, DeviceCause::StaysEnabled { word: SWITCHED_ON }),
    "node 3 (Y, LXM32M): found enabled and does not switch off, statusword \
     0233h (Switched On): switch it off by hand";

    Fault::Device(_, DeviceCause::NoSyncLock { .. }),
    Fault::Device(2, DeviceCause::NoSyncLock { status: 1, assumption: "sync_locked" }),
    "node 3 (Y, LXM32M): not synchronised to SYNC, status 1: check the cycle time and the model's \
     `sync_locked`";

    Fault::Device(_, DeviceCause::StateTimeout { .. }),
    Fault::Device(2, DeviceCause::StateTimeout {
        awaited: AwaitedState::Enabled, word: SWITCHED_ON,
    }),
    "node 3 (Y, LXM32M): expected power stage on, stays at statusword 0233h (Switched On): check \
     supply, enable inputs and the drive's error memory";

    Fault::Device(_, DeviceCause::NotAtRest), Fault::Device(2, DeviceCause::NotAtRest),
    "node 3 (Y, LXM32M): does not come to rest once enabled: check its loop and what moves its \
     axis, or `standstill_window`";

    Fault::Device(_, DeviceCause::WrongMode { .. }),
    Fault::Device(2, DeviceCause::WrongMode { object: OBJECT, expected: 7, found: 1 }),
    "node 3 (Y, LXM32M): operating mode 60C2h:1 reads 1, expected 7: check for another master or \
     tool that selects one";

    Fault::Device(_, DeviceCause::PositionRange), Fault::Device(2, DeviceCause::PositionRange),
    "node 3 (Y, LXM32M): setpoint outside the drive's position range: check `zero` and the travel";

    Fault::Device(_, DeviceCause::Emergency { .. }),
    Fault::Device(2, DeviceCause::Emergency {
        emergency: Emergency { code: 0x3130, register: 5, vendor: [0, 0, 0, 0x05, 0xA3] },
    }),
    "node 3 (Y, LXM32M): EMCY 3130h, error register 05h, mains voltage, vendor error A305h: clear its cause";

    Fault::Device(_, DeviceCause::Reported { .. }),
    Fault::Device(2, DeviceCause::Reported { word: SWITCHED_ON }),
    "node 3 (Y, LXM32M): drive fault, statusword 0233h (Switched On): read its error memory, and \
     clear its cause";

    Fault::Device(_, DeviceCause::NotFollowing { .. }),
    Fault::Device(2, DeviceCause::NotFollowing {
        word: SWITCHED_ON, why: NotFollowing::PowerStageOff,
    }),
    "node 3 (Y, LXM32M): power stage off, statusword 0233h (Switched On): check the drive's inputs \
     and its error memory";

    Fault::Device(_, DeviceCause::SecondTPdo), Fault::Device(2, DeviceCause::SecondTPdo),
    "node 3 (Y, LXM32M): a second T_PDO to one SYNC, with other data than the first: another device has this node id, \
     give it one of its own; or something else on the bus has changed when it sends: let only one controller set it up; \
     or it was late by a whole cycle for longer: check the load of the bus";

    Fault::Device(_, DeviceCause::TwoNodes), Fault::Device(2, DeviceCause::TwoNodes),
    "node 3 (Y, LXM32M): two T_PDOs to one SYNC: another device has this node id, give it one of \
     its own";

    Fault::Device(_, DeviceCause::HeartbeatLost), Fault::Device(2, DeviceCause::HeartbeatLost),
    "node 3 (Y, LXM32M): heartbeat lost: check cabling and supply";

    Fault::Device(_, DeviceCause::GuardingUnanswered), Fault::Device(2, DeviceCause::GuardingUnanswered),
    "node 3 (Y, LXM32M): no answer to guarding: check cabling and supply, and that the bus carries remote frames, which a \
     socketcand does not";

    Fault::Device(_, DeviceCause::NoNmtState), Fault::Device(2, DeviceCause::NoNmtState),
    "node 3 (Y, LXM32M): no heartbeat that tells its NMT state, expected Operational: check \
     cabling and bus load";

    Fault::Device(_, DeviceCause::UnknownNmtState { .. }),
    Fault::Device(2, DeviceCause::UnknownNmtState { byte: 0x85 }),
    "node 3 (Y, LXM32M): heartbeat says 85h, which is no NMT state, expected 05h, Operational: check \
     for a master that guards it, which sets the highest bit, and the device's firmware";

    Fault::Device(_, DeviceCause::PollUnanswered { .. }),
    Fault::Device(2, DeviceCause::PollUnanswered { object: Address::new(0x6064, 0) }),
    "node 3 (Y, LXM32M): no answer to the polls of 6064h:0 any more: check cabling and supply";

    Fault::Device(_, DeviceCause::NmtState { .. }),
    Fault::Device(2, DeviceCause::NmtState { state: nmt::State::PreOperational }),
    "node 3 (Y, LXM32M): NMT state is PreOperational, expected Operational: check for another NMT \
     master and for communication errors";

    Fault::Device(_, DeviceCause::Rebooted), Fault::Device(2, DeviceCause::Rebooted),
    "node 3 (Y, LXM32M): booted in the middle of the run: check its supply and for another NMT \
     master";

    Fault::Device(_, DeviceCause::MissingTPdo { .. }),
    Fault::Device(2, DeviceCause::MissingTPdo { misses: 2 }),
    "node 3 (Y, LXM32M): no T_PDO in 2 cycles in a row: check the bus load and the device";

    Fault::Axis(_, AxisCause::OutsideSoftLimits { .. }),
    Fault::Axis(1, AxisCause::OutsideSoftLimits { position: -1.0 }),
    "axis Y stands at -1.000 mm, outside its soft limits 0…1000 mm: move it inside, or check the \
     drive's `zero`";

    Fault::Axis(_, AxisCause::Skew { .. }), Fault::Axis(0, AxisCause::Skew { difference: 0.75 }),
    "axis X: its two sides are 0.750 mm apart, allowed 0.5 mm: align the gantry, or check the \
     drives' `zero`";

    Fault::Axis(_, AxisCause::Standstill { .. }),
    Fault::Axis(1, AxisCause::Standstill { distance: 1.0 }),
    "axis Y left its frozen position by 1.0000 mm, allowed 0.05 mm: check its brake, its loop and \
     `standstill_window`";

    Fault::Axis(_, AxisCause::Jump { .. }),
    Fault::Axis(1, AxisCause::Jump { distance: 3.5, possible: 1.25 }),
    "axis Y: an actual position jumped by 3.5000 mm, 1.2500 mm were possible: check the encoder and \
     its coupling, then the position of the axis";

    Fault::Axis(_, AxisCause::LimitSwitch { moving_away: false, .. }),
    Fault::Axis(1, AxisCause::LimitSwitch { input: 0, positive: false, moving_away: false }),
    "input \"enable\", axis Y is on its negative limit switch: reset, then jog it off in positive direction";

    Fault::Axis(_, AxisCause::LimitSwitch { moving_away: true, .. }),
    Fault::Axis(1, AxisCause::LimitSwitch { input: 0, positive: true, moving_away: true }),
    "input \"enable\", axis Y moved in negative direction as its positive limit switch came on: check whether its two \
     limit switches are wired the wrong way round, then reset";

    Fault::Axis(_, AxisCause::SetpointGuard { sampled: true, .. }),
    Fault::Axis(1, AxisCause::SetpointGuard {
        drive: 2, quantity: Quantity::Velocity, value: 912.5, sampled: true,
    }),
    "node 3 (Y, LXM32M), axis Y: a setpoint whose velocity is 912.5000 mm/s, allowed 800 mm/s, was \
     not sent: the trajectory asks for more than the axis may do";

    Fault::Axis(_, AxisCause::SetpointGuard { sampled: false, .. }),
    Fault::Axis(1, AxisCause::SetpointGuard {
        drive: 2, quantity: Quantity::Acceleration, value: 12_345.6, sampled: false,
    }),
    "node 3 (Y, LXM32M), axis Y: a setpoint whose acceleration is 12345.6000 mm/s², allowed 5000 \
     mm/s², was not sent: this is a defect of syncline, please report it with the machine, the \
     program and what was done";

    Fault::Axis(_, AxisCause::FollowingError { .. }),
    Fault::Axis(1, AxisCause::FollowingError { error: 2.5, allowed: 2.0 }),
    "axis Y: following error 2.5000 mm, allowed 2 mm: look for a blocked axis, a weak loop or too \
     high limits";

    Fault::Axis(_, AxisCause::TestMove { .. }),
    Fault::Axis(1, AxisCause::TestMove { factor: -10.02 }),
    "axis Y: in its test move it went -10.020 times as far as its drive was sent: check the unit of its velocity in \
     [model.…] or in its description, its increments a turn, `pitch`, `gear` and `direction`";

    Fault::Axis(_, AxisCause::NotThere { .. }),
    Fault::Axis(1, AxisCause::NotThere { distance: 12.25, told: true }),
    "axis Y: its drive did not get to where it was sent and is 12.2500 mm away, allowed 0.05 mm: look \
     for what blocks it, and check the drive's units and its current";

    Fault::Axis(_, AxisCause::NotAcknowledged { .. }),
    Fault::Axis(1, AxisCause::NotAcknowledged { time: 2.004 }),
    "axis Y: its drive has not acknowledged where it was sent for 2.00 s: check its operating \
     mode, and that its R_PDOs reach it";

    Fault::Axis(_, AxisCause::NotHalted { .. }),
    Fault::Axis(1, AxisCause::NotHalted { time: 2.25 }),
    "axis Y: its drive was told to halt and has not come to rest for 2.25 s: check its ramps, \
     and that its R_PDOs reach it";

    Fault::Axis(_, AxisCause::FeedbackDifference { .. }),
    Fault::Axis(2, AxisCause::FeedbackDifference { difference: -0.35 }),
    "axis Z: its encoder is -0.3500 mm from where its drive says that it is, allowed 0.2 mm: look \
     for a coupling or belt that slips or is broken and for lost steps, then check the `zero` of both";

    Fault::Axis(_, AxisCause::ReferenceMoved { .. }),
    Fault::Axis(2, AxisCause::ReferenceMoved { difference: 0.2 }),
    "axis Z: homed again, it was 0.2000 mm beside where it believed to be, allowed 0 mm: look for lost steps and for a \
     coupling or belt that has slipped, check what was made since, and home it again";

    Fault::Bus(_, BusCause::LateSetpoints { .. }),
    Fault::Bus(0, BusCause::LateSetpoints { count: 2 }),
    "bus portal: setpoints missed their SYNC 2 times: this host or bus does not hold the cycle; look \
     at `syncline doctor` and `syncline bench cycle`, or take a longer `cycle_us`";

    Fault::Bus(_, BusCause::TornBurst), Fault::Bus(0, BusCause::TornBurst),
    "bus portal: only a part of one cycle's setpoints could be queued: see `syncline doctor` for the \
     transmit queue";

    Fault::Bus(_, BusCause::ErrorPassive), Fault::Bus(0, BusCause::ErrorPassive),
    "bus portal: error passive, more than 127 errors: check cable, termination and bit rate";

    Fault::Bus(_, BusCause::SecondSync), Fault::Bus(0, BusCause::SecondSync),
    "bus portal: SYNC comes from another node, too: drives take their setpoints at its instants; stop \
     that node from producing SYNC (bit 30 of its 1005h), or the other master";

    Fault::Bus(_, BusCause::SecondNmtMaster { .. }),
    Fault::Bus(0, BusCause::SecondNmtMaster {
        request: nmt::Request { command: nmt::Command::Stop, node: NodeId::new(5) },
    }),
    "bus portal: another master commands devices, too (Stop to node 5): only one may start and stop them; end the other \
     tool or master, then reset";

    Fault::Bus(_, BusCause::SecondController { .. }),
    Fault::Bus(0, BusCause::SecondController { node: NodeId::new(127).unwrap() }),
    "bus portal: another node sends with the controller's node id 127, and drives take its life for the \
     controller's: give it another one, or the controller by `node` in the machine file";

    Fault::Bus(_, BusCause::Failed), Fault::Bus(0, BusCause::Failed),
    "bus portal: the interface failed, drives out of reach stop by lost heartbeat: mend what its \
     message says";

    Fault::LateWakeUp { .. }, Fault::LateWakeUp { late_ns: 2_500_000 },
    "the cycle woke up 2.500 ms late, and --strict allows none: look at `syncline doctor`";

    Fault::Program, Fault::Program,
    "the program could not go on: see its message, and mend it";

    Fault::NotEnabled { .. }, Fault::NotEnabled { input: 0 },
    "the enabling input \"enable\" is off: switch it on";

    Fault::Axis(_, AxisCause::Unreferenced), Fault::Axis(1, AxisCause::Unreferenced),
    "axis Y is not referenced: let it be homed by `at_start` in [homing], or home it in `syncline \
     console`";

    Fault::Axis(_, AxisCause::Homing(_)), Fault::Axis(1, AxisCause::Homing(HomingFailure::NoSignal)),
    "axis Y is not homed";

    Fault::Block(_, BlockCause::Probing(ProbeFailure::Closed)), Fault::Block(7, BlockCause::Probing(ProbeFailure::Closed)),
    "line 7: there is contact before the probing: move away first, and check `active_low`";

    Fault::Block(_, BlockCause::Probing(ProbeFailure::Open)), Fault::Block(7, BlockCause::Probing(ProbeFailure::Open)),
    "line 7: there is no contact that could be lost: check the probe's wiring and `active_low`";

    Fault::Block(_, BlockCause::Probing(ProbeFailure::NoContact)), Fault::Block(7, BlockCause::Probing(ProbeFailure::NoContact)),
    "line 7: no contact came on the whole way: check where the work is, and the probe's wiring; G38.3 goes on without one";

    Fault::Block(_, BlockCause::Probing(ProbeFailure::Stuck)), Fault::Block(7, BlockCause::Probing(ProbeFailure::Stuck)),
    "line 7: the contact stayed on the whole way: check whether the probe sticks; G38.5 goes on with it";

    Fault::Block(_, BlockCause::Probing(ProbeFailure::NoSignal)), Fault::Block(7, BlockCause::Probing(ProbeFailure::NoSignal)),
    "line 7: the probe's level is not known: check the device that it is wired to";

    Fault::Block(_, BlockCause::Probing(ProbeFailure::TooFast { .. })), Fault::Block(7, BlockCause::Probing(ProbeFailure::TooFast { overtravel: 3.25, allowed: 2.0 })),
    "line 7: the axes would go on for 3.250 mm behind the contact, 2 mm are allowed: lower F, or raise `overtravel` in [probing] if the probe bears it";

    Fault::Block(_, BlockCause::Probing(ProbeFailure::OtherEdge { .. })), Fault::Block(7, BlockCause::Probing(ProbeFailure::OtherEdge { axis: 1 })),
    "line 7: a drive of axis Y captured another place than the one where the contact came: check whether the probe bounces, and which input it is wired to, or set `latch = false` in [probing]";

    Fault::Block(_, BlockCause::Probing(ProbeFailure::NotSettled { .. })), Fault::Block(7, BlockCause::Probing(ProbeFailure::NotSettled { axis: 1 })),
    "line 7: axis Y does not settle within its `standstill_window` behind the motion: check what holds it back, and whether the window is wide enough for it";

    Fault::Block(_, BlockCause::Probing(ProbeFailure::Refused(_))), Fault::Block(7, BlockCause::Probing(ProbeFailure::Refused(JogError::NoSpeed))),
    "line 7: the speed or the rapid override is 0: raise it, or correct where the probing leads";

    Fault::Block(_, BlockCause::Thread(ThreadFailure::NotTurning)), Fault::Block(7, BlockCause::Thread(ThreadFailure::NotTurning)),
    "line 7: the spindle does not turn as it is told to, or not evenly: look at its drive, and for what holds it back";

    Fault::Block(_, BlockCause::Thread(ThreadFailure::LostStep(LostStep::TooFast { .. }))),
    Fault::Block(7, BlockCause::Thread(ThreadFailure::LostStep(LostStep::TooFast { wanted: 26.0, allowed: 25.0 }))),
    "line 7: the spindle is too fast for the axes: it asks for 26.00 mm/s along the thread, they go 25.00 mm/s at most: lower S";

    Fault::Block(_, BlockCause::Thread(ThreadFailure::LostStep(LostStep::Behind { .. }))),
    Fault::Block(7, BlockCause::Thread(ThreadFailure::LostStep(LostStep::Behind { distance: 0.125 }))),
    "line 7: the axes cannot follow the spindle, they are 0.125 mm away from where it wants them: look for what makes its speed change, or lower S";

    Fault::Block(_, BlockCause::Thread(ThreadFailure::LostStep(LostStep::TooDeep))),
    Fault::Block(7, BlockCause::Thread(ThreadFailure::LostStep(LostStep::TooDeep))),
    "line 7: the spindle was told to turn round, and does not stand where the thread ends: look at its drive, and whether `ramp_ms` in [spindle] is what it can";

    Fault::Spindle(SpindleCause::Speed { .. }), Fault::Spindle(SpindleCause::Speed { speed: -1803.4, told: -2400.0, allowed: 72.0 }),
    "the spindle turned with -1803 1/min in a cut, told were -2400 ± 72 1/min: look for what holds it back, tool, feed and depth of the cut, and at its drive";

    Fault::Spindle(SpindleCause::Angle { .. }), Fault::Spindle(SpindleCause::Angle { off: -3.418, allowed: 0.5 }),
    "the oriented spindle was -3.42° away from its angle, allowed is 0.5°, while axes moved: look for what turns it, and at its drive";

    Fault::Touched, Fault::Touched,
    "the probe touched something, or a tool the tool setter, while nobody probed: move away, and look at probe, program and work";

    Fault::Pressed, Fault::Pressed,
    "the probe, or the tool setter, is in contact and was moved on by more than `overtravel` from where that began: move back the way it came, and look at probe, program and work";

    Fault::NoPlan, Fault::NoPlan,
    "the path rests in mid-program, nobody holds it, and no plan came for 30 s: this is a defect of \
     syncline, please report it with the machine, the program and what was done";
}

#[test]
fn every_failure_of_a_homing_has_its_text() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/router/machine.toml");
    let router = Layout::new(&Machine::load(&file).unwrap()).unwrap();
    for (failure, text) in [
        (
            HomingFailure::NotFound,
            "no switch came on within 1800 mm in negative direction: check the switch and its \
             wiring, `direction`, and the drive's `direction`",
        ),
        (
            HomingFailure::StaysOn,
            "its switch stays on, 5 mm and more in front of its edge: check whether it is stuck, and \
             `active_low`",
        ),
        (
            HomingFailure::NeverOff,
            "its switch was on as the search began, and 1800 mm against negative direction it still \
             is: check whether it is stuck, `active_low`, and whether it is at the other end, by \
             `direction`",
        ),
        (
            HomingFailure::BlockedBefore,
            "it did not follow in negative direction, and no switch had come on: check what is in \
             its way, the switch and its wiring, and whether it is at that end, by `direction`",
        ),
        (
            HomingFailure::BlockedOnSwitch,
            "its switch was on as the search began, and against negative direction it did not \
             follow: check what is in its way, `active_low`, and whether the switch is at the \
             other end, by `direction`",
        ),
        (
            HomingFailure::SideJammed { side: 0 },
            "its first side did not follow as the other one did: check whether it is jammed, its \
             motor and its brake",
        ),
        (
            HomingFailure::Lost,
            "its switch came on at speed, and not again within 5 mm of there: check whether it is \
             loose, or too narrow for `speed`",
        ),
        (
            HomingFailure::OneSide { side: 1 },
            "the switch of its second side did not come on within 5 mm of the other one's: check \
             that switch, and whether the side is jammed",
        ),
        (
            HomingFailure::TooLong,
            "it took longer than 120 s: check `max_time_ms` and the rapid override",
        ),
        (
            HomingFailure::NoSignal,
            "its switch tells no level: check the drive that it is wired to",
        ),
        (
            HomingFailure::Shared,
            "its switch is on already, and another axis has the same one: move the axes off it",
        ),
        (
            HomingFailure::NoSpeed,
            "the rapid override is 0: raise it, and home it again",
        ),
        (HomingFailure::Held, "a feed hold ended it: home it again"),
        (HomingFailure::DoorOpen, "a door is open: close it"),
        (
            HomingFailure::FeedHold,
            "the input for feed hold came on: home it again once that is off",
        ),
        (
            HomingFailure::NotHome,
            "its drive did not find its place by itself: check the switches wired to the drive, the functions of its \
             inputs, and `method`",
        ),
        (
            HomingFailure::IndexTooNear { thousandths: 13 },
            "the index pulse that counts is 1.3 % of a turn from the edge of its switch, less than 2 % or than what the edge may be \
             off, and the next one may be another: move the switch by a quarter of a turn",
        ),
        (
            HomingFailure::TooFar,
            "its drive went more than 1800 mm from where it began: check the switches wired to the drive, `method` and \
             `max_distance`",
        ),
    ] {
        let told = Fault::Axis(0, AxisCause::Homing(failure)).describe(&router);
        assert_eq!(told, format!("axis X is not homed: {text}"));
    }
}

#[test]
fn every_failure_on_a_hard_stop_has_its_text() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/router/machine.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    let switch = "kind = \"switch\"\norder = 2\nswitches = [\"home Y\"]\ndirection = \"negative\"\nspeed = 80.0\nslow_speed = 2.0\n";
    let stop = "kind = \"hard_stop\"\nweight = \"none\"\ndirection = \"negative\"\ntorque = 30.0\nspeed = 10.0\nmin_distance = 20.0\n";
    let input = "[[input]]\nname = \"home Y\"\ndrive = \"Y\"\nsignal = \"DI0\"\nfunction = \"home\"\nsimulated = [-60.0, -4.0]\n";
    assert!(text.contains(switch) && text.contains(input));
    let text = text.replacen(switch, stop, 1).replacen(input, "", 1);
    let router = Layout::new(&Machine::parse(&file, &text).unwrap()).unwrap();
    for (failure, text) in [
        (
            HomingFailure::NoStop,
            "nothing stopped it within 1200 mm in negative direction: check the stop, `direction`, the drive's \
             `direction`, and `max_distance`",
        ),
        (
            HomingFailure::TooEarly,
            "something stopped it less than 20 mm from where it began, and it went back there: check what is in its \
             way, whether 30 % of its torque moves it, and `min_distance`",
        ),
        (
            HomingFailure::GaveWay,
            "what stopped it gave way: check what is in its way, whether 30 % of its torque moves it, and `contact_ms`",
        ),
        (
            HomingFailure::Weak,
            "with 30 % of its torque it did not follow in negative direction, and did not stand either: check what \
             brakes it, `torque`, and `speed`",
        ),
        (
            HomingFailure::Holds,
            "with 30 % of its torque it did not come off what it had met: check what holds it, and `torque`",
        ),
        (
            HomingFailure::WeakAlready,
            "its torque was limited to no more than 30 % before: switch the drive's supply off and on if a search was \
             cut off with the controller, or lower `torque`",
        ),
    ] {
        let told = Fault::Axis(1, AxisCause::Homing(failure)).describe(&router);
        assert_eq!(told, format!("axis Y is not homed: {text}"));
    }
}
