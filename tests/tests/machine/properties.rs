//! Whatever happens, and whenever: the machine comes to rest inside its limits and ends with its
//! drives off.

use crate::shaper::portal;
use proptest::prelude::*;
use syncline_canopen::CobId;
use syncline_controller::control::{End, Phase};
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

/// Something that goes wrong, or that a person does.
#[derive(Clone, Copy, Debug)]
enum Event {
    Interrupt,
    Error(ErrorClass),
    Mute,
    Reboot,
    Block,
    Drop(u32),
    Delay(u32),
    Tear,
    LoseTPdos(u32),
}

fn event() -> impl Strategy<Value = Event> {
    use ErrorClass::{Fatal, QuickStop, StopAndSwitchOff, SwitchOff, Warning};
    let classes = [Warning, QuickStop, StopAndSwitchOff, SwitchOff, Fatal];
    prop_oneof![
        Just(Event::Interrupt),
        prop::sample::select(classes.to_vec()).prop_map(Event::Error),
        Just(Event::Mute),
        Just(Event::Reboot),
        Just(Event::Block),
        (1..4_u32).prop_map(Event::Drop),
        (1..4_u32).prop_map(Event::Delay),
        Just(Event::Tear),
        (1..4_u32).prop_map(Event::LoseTPdos),
    ]
}

impl Event {
    fn happen(self, rig: &mut Rig, drive: usize) {
        match self {
            Self::Interrupt => rig.controller().interrupt(),
            Self::Error(class) => rig.twin(drive).disturb(Disturbance::Fault(class)),
            Self::Mute => rig.twin(drive).disturb(Disturbance::Mute(true)),
            Self::Reboot => rig.twin(drive).disturb(Disturbance::Reset),
            Self::Block => rig.twin(drive).disturb(Disturbance::Block(true)),
            Self::Drop(count) => rig.bus().drop_bursts = count,
            Self::Delay(count) => rig.bus().delay_bursts = count,
            Self::Tear => rig.bus().tear_bursts = 1,
            Self::LoseTPdos(count) => rig.twin(drive).disturb(Disturbance::LoseTPdos(count)),
        }
    }
}

/// What holds at every end, whatever happened before.
fn assert_ended_well(rig: &mut Rig) {
    if !rig.rows.is_empty() {
        let trace = rig.trace();
        trace.assert_within_limits();
        assert!(rig.ends_at_rest());
    }
    assert_eq!(rig.controller().phase(), Phase::Done);
    for drive in 0..rig.machine.drives.len() {
        let commands = rig.commands(drive);
        // Enabled once at most, and switched off to the end.
        let mut words: Vec<u16> = commands.iter().map(|it| it.1).collect();
        words.dedup();
        let enables = words
            .windows(2)
            .filter(|pair| pair == &[0x06, 0x0F])
            .count();
        assert!(enables <= 1, "{words:04X?}");
        assert!(words.last().is_none_or(|word| *word == 0), "{words:04X?}");
        let seen = rig.twin(drive).observe();
        assert!(!seen.is_powered, "drive {drive}: {seen:?}");
        let node = rig.machine.drives[drive].node;
        let last_command = commands.last().map(|it| it.0);
        let last_request = rig.sent(CobId::r_sdo(node)).last().map(|it| it.start);
        let last_sync = rig.syncs().last().copied();
        assert!(last_command <= last_request && last_command <= last_sync);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Two events in the midst of the program; the second one mostly falls into the stop.
    #[test]
    fn events_in_motion(
        row in 1..2500_usize,
        first in event(),
        later in 0..100_usize,
        second in event(),
        drives in (0..4_usize, 0..4_usize),
        shaped in any::<bool>(),
    ) {
        let mut rig = portal(shaped, PORTAL_PROGRAM);
        rig.run_until(|rig| rig.rows.len() >= row || rig.end().is_some());
        first.happen(&mut rig, drives.0);
        for _ in 0..later {
            rig.step();
        }
        second.happen(&mut rig, drives.1);
        rig.finish();
        assert_ended_well(&mut rig);
    }

    /// An event at any wake-up of the bring-up.
    #[test]
    fn events_in_the_bring_up(step in 0..600_usize, event in event(), drive in 0..4_usize) {
        let mut rig = Rig::portal("G0 X5\nM2\n");
        for _ in 0..step {
            rig.step();
        }
        event.happen(&mut rig, drive);
        rig.finish();
        assert_ended_well(&mut rig);
    }

    /// Interrupts alone: the stop is inside the limits wherever it begins, and no fault.
    #[test]
    fn an_interrupt_at_any_row(row in 0..2500_usize) {
        let mut rig = Rig::portal(PORTAL_PROGRAM);
        rig.run_until(|rig| rig.rows.len() >= row || rig.end().is_some());
        rig.controller().interrupt();
        let end = rig.finish();
        prop_assert!(matches!(end, End::Interrupted | End::Finished), "{:?}", end);
        let moving = rig.rows.iter().skip(row).take_while(|row| row.plan.speed > 0.0).count();
        prop_assert!(moving <= 300, "{} rows to come to rest", moving);
        assert_ended_well(&mut rig);
    }
}

/// Braking cycle by cycle would step over a blend of a few micrometres.
#[test]
fn an_interrupt_in_front_of_a_sharp_corner() {
    let mut rig = Rig::portal(PORTAL_PROGRAM);
    rig.run_until(|rig| rig.rows.len() >= 783);
    rig.controller().interrupt();
    rig.finish();
    assert_ended_well(&mut rig);
}
