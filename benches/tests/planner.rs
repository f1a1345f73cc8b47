//! Short versions of the campaigns in `benches/benches`.

use syncline_benches::campaign::{run, together};
use syncline_benches::cases::Class;
use syncline_benches::properties::{brute_force, lines, lowering, metamorphic, replanning};

#[test]
fn no_class_has_a_plan_longer_than_the_references_or_one_that_does_not_pass() {
    for class in Class::ALL {
        let tally = run(class, 2_000, 11, |what, case, by| {
            println!("{what} by {by:e}: {case:?}")
        });
        assert_eq!((tally.failed, tally.longer), (0, 0), "{class:?}: {tally:?}");
        // Near the end of a plan to rest the positions' rounding is more than the tolerance allows.
        let rounded = if class == Class::Sampled {
            tally.cases / 20
        } else {
            0
        };
        assert!(tally.unsound <= rounded, "{class:?}: {tally:?}");
        assert!(tally.compared > 0, "{class:?}: {tally:?}");
    }
}

#[test]
fn axes_together_arrive_at_once_and_no_later_than_the_references() {
    let tally = together(2_000, 12, |what, case, by| {
        println!("{what} by {by:e}: {case:?}")
    });
    let bad = (tally.failed, tally.unsound, tally.apart, tally.longer);
    assert_eq!(bad, (0, 0, 0, 0), "{tally:?}");
    assert!(tally.compared > 1_000 && tally.stretched > 500, "{tally:?}");
}

#[test]
fn durations_follow_scale_side_place_and_direction_of_time() {
    let m = metamorphic(2_400, 13);
    for count in [m.powers, m.mirror, m.scales, m.shift, m.reversal] {
        assert_eq!(count.broken, 0, "{m:?}");
        assert!(
            count.cases > 1_000 && count.apart < count.cases / 5,
            "{m:?}"
        );
    }
}

#[test]
fn planning_again_on_the_way_to_rest_arrives_no_later() {
    let count = replanning(5_000, 14);
    assert!(count.broken <= count.cases / 1_000, "{count:?}");
}

#[test]
fn a_lowered_limit_is_met_without_a_dip() {
    assert_eq!(lowering(2_000, 15).broken, 0);
}

#[test]
fn a_line_is_straight_and_as_fast_as_its_one_dimension() {
    assert_eq!(lines(1_000, 16).broken, 0);
}

#[test]
fn no_lattice_sequence_is_faster() {
    let (count, ahead) = brute_force(150, 17);
    assert_eq!(count.broken, 0);
    assert!(ahead < 0.1, "{ahead}");
}
