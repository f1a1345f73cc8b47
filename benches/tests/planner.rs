//! Short versions of the campaigns in `benches/benches`.

use syncline_benches::campaign::{run, together};
use syncline_benches::cases::{Case, Class, Rng, is_inside};
use syncline_benches::peer::{Peer, input};
use syncline_benches::properties::{brute_force, lines, lowering, metamorphic, replanning};
use syncline_trajectory::limits::Limits;
use syncline_trajectory::profile::State;
use syncline_trajectory::state_to_state::{Problem, plan};
use syncline_trajectory::verify;

#[test]
fn no_class_has_a_plan_longer_than_the_references_or_one_that_does_not_pass() {
    for class in Class::ALL {
        let tally = run(class, 2_000, 11, |what, case, by| {
            println!("{what} by {by:e}: {case:?}")
        });
        let bad = (tally.failed, tally.unsound, tally.longer);
        assert_eq!(bad, (0, 0, 0), "{class:?}: {tally:?}");
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
    let count = replanning(10_000, 14);
    assert_eq!(count.broken, 0, "{count:?}");
}

/// Where the target has a velocity, a plan made again may last longer than what is left of the running one. Who
/// changes to those that arrive earlier, and to no other, arrives no later than by the first plan, and at the target.
#[test]
fn planning_again_to_a_velocity_keeps_the_better_plan() {
    let mut rng = Rng::new(18);
    let mut longer = 0;
    for _ in 0..20_000 {
        let case = [Class::TargetVelocity, Class::Generic, Class::AtLimits][rng.below(3) as usize]
            .draw(&mut rng);
        let problem = Problem::new(case.start, case.target, case.limits);
        let Ok(first) = plan(&problem, 0.0) else {
            continue;
        };
        let (mut running, mut elapsed, mut arrival) = (first, 0.0, first.duration());
        for _ in 0..10 {
            elapsed += rng.log(1e-15, 0.3) * (running.duration() - elapsed);
            let start = running.at(elapsed);
            let again = plan(&Problem { start, ..problem }, 0.0).unwrap();
            let left = running.duration() - elapsed;
            longer += u32::from(again.duration() > left * (1.0 + 1e-9));
            if again.duration() < left {
                arrival += again.duration() - left;
                (running, elapsed) = (again, 0.0);
            }
        }
        assert!(arrival <= first.duration(), "{case:?}");
        let (end, target) = (running.end(), case.target);
        assert!(
            (end.v - target.v).abs() < 1e-9 && (end.p - target.p).abs() < 1e-6,
            "{case:?}"
        );
    }
    assert!(longer > 0, "none that would have arrived later");
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

/// Problems that once had a plan that was unsound or too long: `p0 v0 a0 pf vf af v_max v_min a_max
/// j_max`, the other limits alike. On own plans beside a single ramp, where both peak accelerations
/// are equal to rounding; beside the gap of durations; from far outside the limits.
#[rustfmt::skip]
const ONCE_WRONG: [[f64; 10]; 11] = [
    [-5.429572942383757, 0.016005958579711446, 0.49534917886758817, -5.429472621692893, 0.01880961398203221, 0.47810196286016127, 0.23816767214807874, -0.23816767214807874, 5.337653179520661, 2.994184324535265],
    [3.340232467911514, -0.4621281817824716, 0.9361350450745096, 3.326640688996588, -0.4335191900450175, 0.9492298750937596, 5.680649307764441, -5.680649307764441, 2.6681239957185157, 0.43148205606873463],
    [0.7985706215684768, -0.011932434294213964, -0.9471663261553189, 0.762900656772955, -0.15327508107721766, -0.099668831884129, 1.2677695005682186, -1.2677695005682186, 1.2163996406203113, 3.2087132565798084],
    [-2.880981478331857, -0.04844726596799567, 0.4843068498831242, -2.881308150232907, -0.04504089491342844, 0.4906175324295994, 1.2113754398724534, -1.2113754398724534, 2.0844721841094422, 0.9030781123132311],
    [8.872341804970176, -0.010412355359441114, -0.36437003900536813, 8.872061042902367, -0.017520121354945614, -0.34445323615754203, 0.10157711487064519, -0.10157711487064519, 0.8905376255021769, 0.9931034191544279],
    [4.433254950078134, -0.23984988529598278, -0.5687800615634733, 4.294003904850629, -0.3454693099786663, -0.2210901645105019, 1.0230296614957375, -1.0230296614957375, 1.1306085257969938, 1.7628935235303498],
    [0.7985706215684767, -0.011932434294219387, -0.9471663261553005, 0.762900656772955, -0.15327508107721766, -0.099668831884129, 1.2677695005682186, -1.2677695005682186, 1.2163996406203113, 3.2087132565798084],
    [9.642185510304262, -0.15423415763182496, 0.12235221380966821, 9.642226852618318, 0.22891820507580107, 0.466251194551786, 0.2336939550394973, -0.2336939550394973, 0.9568071519876046, 0.26415093824085634],
    [-8.34782924873631, -0.09505122709335552, 13.282053444172297, -9.555119225941686, -0.010268519122599809, 0.1874181099754974, 0.1042681147563455, -0.1042681147563455, 9.86081128312022, 0.3477678102148774],
    [2.9940992477876893, -0.008676488945320655, 26.23217112375194, -0.6025416639156895, -0.0435964292978834, 0.15101931857159756, 0.10081511770836035, -0.10081511770836035, 9.758161660961795, 0.27669800886923684],
    [0.0, 0.0004750133039836957, 2.4052344665544783, 4.256571868872895, 0.0, 0.0, 0.0001490678810343018, -1.2293882461492265, 5.625015788503555, 2.9981660530789114],
];

#[test]
fn what_once_was_wrong_is_right() {
    for [p0, v0, a0, pf, vf, af, v_max, v_min, a_max, j_max] in ONCE_WRONG {
        let case = Case {
            start: State {
                p: p0,
                v: v0,
                a: a0,
            },
            target: State {
                p: pf,
                v: vf,
                a: af,
            },
            limits: Limits {
                v_min,
                ..Limits::symmetric(v_max, a_max, j_max)
            },
        };
        let problem = Problem::new(case.start, case.target, case.limits);
        let profile = plan(&problem, 0.0).unwrap();
        let certificate = verify::axis(&profile, &problem);
        assert!(certificate.holds(1e-12), "{case:?}: {certificate:?}");
        if is_inside(&case.start, &case.limits) {
            let theirs = Peer::<1>::default().plan(&input(&[case])).unwrap();
            let ours = profile.duration();
            assert!(ours <= theirs * (1.0 + 1e-9), "{case:?}: {ours} {theirs}");
        }
    }
}

/// A ramp between two equal peak accelerations left a longer ramp than both allow.
#[test]
fn a_duration_beyond_the_gap_of_a_near_limit_change_is_sound() {
    let start = State {
        p: -0.5522319614979665,
        v: -7.261982640774658,
        a: 0.0,
    };
    let target = State {
        p: -0.5735411769491384,
        v: -7.261980125212725,
        a: 0.006534423445564944,
    };
    let limits = Limits::symmetric(7.261982640774658, 0.13149003864013592, 8.48690887080396);
    let problem = Problem::new(start, target, limits);
    let profile = plan(&problem, 36.2).unwrap();
    assert!(profile.duration() > 220.0);
    assert!(verify::axis(&profile, &problem).holds(1e-12));
}
