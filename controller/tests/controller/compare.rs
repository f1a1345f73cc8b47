//! Two motions side by side, over the space of paths, speeds and lags.

use proptest::prelude::*;
use std::fmt::Write as _;
use syncline_controller::compare::{Comparison, Motion};
use tempfile::NamedTempFile;

/// A trace along corners, in some steps each, of axes that lag by so many of them, beside their setpoints by so much
/// in Y, with so many rows a second.
fn motion(corners: &[[f64; 2]], steps: usize, lag: f64, beside: f64, rate: f64) -> Motion {
    let mut trace = "t_s,line,X_set,X_act,Y_set,Y_act\n".to_owned();
    let mut row = 0;
    let mut push = |line: usize, set: [f64; 2], act: [f64; 2]| {
        let time = f64::from(row) / rate;
        let (x, y) = (act[0], act[1] + beside);
        writeln!(trace, "{time},{line},{},{x},{},{y}", set[0], set[1]).unwrap();
        row += 1;
    };
    for (line, pair) in corners.windows(2).enumerate() {
        for step in 0..steps {
            let part = step as f64 / steps as f64;
            let at = |part: f64| [0, 1].map(|i| pair[0][i] + part * (pair[1][i] - pair[0][i]));
            push(line + 1, at(part), at((part - lag / steps as f64).max(0.0)));
        }
    }
    let last = corners[corners.len() - 1];
    push(corners.len() - 1, last, last);
    let file = NamedTempFile::new().unwrap();
    std::fs::write(file.path(), trace).unwrap();
    Motion::read(file.path()).unwrap()
}

fn corners() -> impl Strategy<Value = Vec<[f64; 2]>> {
    let corner = [-100.0..100.0, -100.0..100.0];
    let corners = prop::collection::vec(corner, 2..8);
    corners.prop_filter("no way", |corners| {
        let mut ways = corners.windows(2);
        ways.all(|pair| f64::hypot(pair[0][0] - pair[1][0], pair[0][1] - pair[1][1]) > 5.0)
    })
}

proptest! {
    /// What is compared with itself differs in nothing, though the path may cross itself or go back on itself.
    #[test]
    fn a_motion_is_like_itself(corners in corners(), steps in 5_usize..80, lag in 0.0..2.0) {
        let it = motion(&corners, steps, lag, 0.0, 250.0);
        let same = Comparison::of(&it, &it).unwrap();
        prop_assert_eq!(same.difference_s, 0.0);
        prop_assert!(same.max_path_difference_mm < 1e-9, "{}", same);
        prop_assert!(same.max_contour_difference_mm < 1e-9, "{}", same);
        prop_assert!(same.axes.iter().all(|axis| axis.max_difference_mm < 1e-9), "{}", same);
        prop_assert!(same.lines.iter().all(|line| line.difference_s.abs() < 1e-9), "{}", same);
    }

    /// One that is as many times slower takes as much longer in each line, on the same path.
    #[test]
    fn time_is_told_by_line(
        corners in corners(),
        steps in 5_usize..60,
        slower in 0.5..2.0,
    ) {
        let one = motion(&corners, steps, 0.0, 0.0, 250.0);
        let other = motion(&corners, steps, 0.0, 0.0, 250.0 / slower);
        let compared = Comparison::of(&one, &other).unwrap();
        prop_assert!(compared.max_path_difference_mm < 1e-9, "{}", compared);
        let [first, second] = compared.duration_s;
        prop_assert!(f64::abs(second - slower * first) < 1e-9, "{}", compared);
        for line in &compared.lines {
            let [one, other] = line.time_s;
            prop_assert!(f64::abs(other - slower * one) < 1e-9, "{:?}", line);
        }
        let whole: f64 = compared.lines.iter().map(|line| line.difference_s).sum();
        prop_assert!((whole - compared.difference_s).abs() < 1e-9, "{}", whole);
    }

    /// However the second is sampled, it is on the same path and takes its own time.
    #[test]
    fn samples_do_not_matter(corners in corners(), steps in [20_usize..60, 20_usize..60]) {
        let [one, other] = steps.map(|steps| motion(&corners, steps, 0.0, 0.0, 250.0));
        let compared = Comparison::of(&one, &other).unwrap();
        let lines = (corners.len() - 1) as f64;
        let expected = lines * (steps[1] as f64 - steps[0] as f64) / 250.0;
        prop_assert!((compared.difference_s - expected).abs() < 1e-9, "{}", compared);
        prop_assert!(compared.max_path_difference_mm < 1e-6, "{}", compared);
    }

    /// Where a path leaves the other it is told from that place on, and an end that comes early with what is behind it.
    #[test]
    fn another_path_is_told(corners in corners(), steps in 5_usize..60, aside in 1.0..50.0) {
        let whole = motion(&corners, steps, 0.0, 0.0, 250.0);
        let compared = Comparison::of(&whole, &whole).unwrap();
        prop_assert!(compared.off_path_at.is_none() && compared.beyond_mm < 1e-6, "{}", compared);
        let mut detour = corners.clone();
        let last = detour[corners.len() - 1];
        detour.push([last[0] + 200.0 + aside, last[1]]);
        let detour = motion(&detour, steps, 0.0, 0.0, 250.0);
        let compared = Comparison::of(&detour, &whole).unwrap();
        let off = compared.off_path_at.map(|place| place.line as usize);
        prop_assert_eq!(off, Some(corners.len()), "{}", compared);
        let compared = Comparison::of(&whole, &detour).unwrap();
        prop_assert!(f64::abs(compared.beyond_mm - 200.0 - aside) < 1e-6, "{}", compared);
    }

    /// A tool that is beside the other is told with its distance, and an axis that lags more with that.
    #[test]
    fn what_is_beside_is_told(beside in 0.001..0.4, lag in 0.1..2.0, steps in 20_usize..80) {
        let corners = [[0.0, 0.0], [100.0, 0.0]];
        let straight = motion(&corners, steps, 0.0, 0.0, 250.0);
        let moved = motion(&corners, steps, lag, beside, 250.0);
        let compared = Comparison::of(&straight, &moved).unwrap();
        prop_assert!((compared.max_contour_difference_mm - beside).abs() < 1e-6, "{}", compared);
        let [x, y] = [0, 1].map(|axis| compared.axes[axis].max_difference_mm);
        prop_assert!((x - lag * 100.0 / steps as f64).abs() < 1e-6, "{}", compared);
        prop_assert!((y - beside).abs() < 1e-9, "{}", compared);
    }
}
