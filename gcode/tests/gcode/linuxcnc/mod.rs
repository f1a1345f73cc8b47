//! Compensated contours, polar coordinates and saved modes against LinuxCNC's stand-alone interpreter, `rs274`, where it
//! is installed.

use std::fs::{self, File};
use std::process::Command;

use syncline_gcode::{Action, AxisLetter};

use super::listing::run;
use super::sweep::Random;

/// Whether the tool starts. Where every tool is required, as in CI, it has to.
fn available() -> bool {
    let found = Command::new("rs274").arg("-?").output().is_ok();
    let required = std::env::var_os("SYNCLINE_REQUIRE_TOOLS").is_some();
    assert!(found || !required, "required, but there is no rs274");
    if !found {
        eprintln!("skipped: there is no rs274 (Debian's linuxcnc-uspace)");
    }
    found
}

/// Ends of moves and centres of arcs in the plane X Y, mm, by the other interpreter; `None` where it
/// refuses the program.
fn theirs(program: &str) -> Option<Vec<Vec<f64>>> {
    // Two of it at a time disturb each other, those of other processes too.
    let one = File::create(std::env::temp_dir().join("syncline-rs274.lock")).unwrap();
    one.lock().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.ngc");
    fs::write(&file, program).unwrap();
    let mut command = Command::new("rs274");
    command.arg("-g").arg(&file).current_dir(folder.path());
    let output = command.output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let mut unit = 1.0;
    // What it tells of places is in the program's coordinates.
    let (mut origin, mut shift, mut turned) = ([0.0; 3], [0.0; 3], 0.0_f64);
    let moves = text.lines().filter_map(|line| {
        let (name, values) = line.split_once('(')?;
        match values {
            "CANON_UNITS_INCHES)" => unit = 25.4,
            "CANON_UNITS_MM)" => unit = 1.0,
            _ => {}
        }
        let values: Vec<f64> = values
            .split([',', ')'])
            .map_while(|value| value.trim().parse::<f64>().ok())
            .map(|value| value * unit)
            .collect();
        let in_machine = |x: f64, y: f64| {
            let (sine, cosine) = turned.to_radians().sin_cos();
            let [x, y] = [x + shift[0], y + shift[1]];
            [
                origin[0] + x * cosine - y * sine,
                origin[1] + x * sine + y * cosine,
            ]
        };
        match name.split_whitespace().last()? {
            "SET_G5X_OFFSET" => origin.copy_from_slice(&values[1..4]),
            "SET_G92_OFFSET" => shift.copy_from_slice(&values[..3]),
            "SET_XY_ROTATION" => turned = values[0] / unit,
            "ARC_FEED" => {
                let [to, center] = [0, 2].map(|at| in_machine(values[at], values[at + 1]));
                return Some([to, center].concat());
            }
            "STRAIGHT_FEED" | "STRAIGHT_TRAVERSE" => {
                let [x, y] = in_machine(values[0], values[1]);
                return Some(vec![x, y, origin[2] + shift[2] + values[2]]);
            }
            _ => {}
        }
        None
    });
    let moves = moves.collect();
    text.contains("PROGRAM_END").then_some(moves)
}

fn ours(program: &str) -> Option<Vec<Vec<f64>>> {
    let commands = run(program).ok()?;
    let moves = commands.iter().filter_map(|command| match &command.action {
        Action::Rapid { to } | Action::Feed { to, .. } => Some(to.0[..3].to_vec()),
        Action::Arc { arc, .. } => {
            let [x, y] = arc.center;
            Some(vec![arc.to[AxisLetter::X], arc.to[AxisLetter::Y], x, y])
        }
        _ => None,
    });
    Some(moves.collect())
}

/// Whether moves lead elsewhere.
fn differ(ours: &[Vec<f64>], theirs: &[Vec<f64>], by: f64) -> bool {
    let apart = |(ours, theirs): (&Vec<f64>, &Vec<f64>)| {
        ours.len() != theirs.len() || ours.iter().zip(theirs).any(|(a, b)| (a - b).abs() > by)
    };
    ours.len() != theirs.len() || ours.iter().zip(theirs).any(apart)
}

/// A contour that turns by at least 5° at every corner: below that the other joins as if smooth.
fn contour(random: &mut Random) -> String {
    let mut text = "G21 G17 G90 G0 X0 Y0 Z0\nF600\n".to_owned();
    let code = if random.chance(0.5) { "G41.1" } else { "G42.1" };
    text += &format!("{code} D{:.3} G1 X50 Y0\nG91\n", random.scaled(0.1, 12.0));
    let mut direction: f64 = 0.0;
    for _ in 0..8 {
        let turn = random.between(0.1, 2.5) * if random.chance(0.5) { 1.0 } else { -1.0 };
        direction += turn;
        if random.chance(0.6) {
            let length = random.scaled(3.0, 60.0);
            let [x, y] = [direction.cos(), direction.sin()].map(|x| x * length);
            text += &format!("G1 X{x:.4} Y{y:.4}\n");
            continue;
        }
        let (radius, sweep) = (random.scaled(3.0, 60.0), random.between(0.3, 2.8));
        let left = if random.chance(0.5) { 1.0 } else { -1.0 };
        let out = direction - left * std::f64::consts::FRAC_PI_2;
        let end = out + left * sweep;
        direction += left * sweep;
        let [i, j] = [-out.cos(), -out.sin()].map(|x| x * radius);
        let [x, y] = [end.cos() * radius + i, end.sin() * radius + j];
        let code = if left > 0.0 { "G3" } else { "G2" };
        text += &format!("{code} X{x:.6} Y{y:.6} I{i:.6} J{j:.6}\n");
    }
    text + "G90 G40 G1 X0 Y0\nM2\n"
}

#[test]
fn compensated_contours_end_where_linuxcnc_ends_them() {
    if !available() {
        return;
    }
    let (mut both, mut only_theirs) = (0, 0);
    for seed in 0..100 {
        let program = contour(&mut Random(seed));
        let (Some(ours), theirs) = (ours(&program), theirs(&program)) else {
            only_theirs += u32::from(theirs(&program).is_some());
            continue;
        };
        let theirs = theirs.unwrap_or_else(|| panic!("seed {seed}: they refuse\n{program}"));
        let differ = differ(&ours, &theirs, 1e-4);
        assert!(!differ, "seed {seed}\n{program}{ours:#?}\n{theirs:#?}");
        both += 1;
    }
    println!("{both} contours agree; {only_theirs} are accepted by them alone");
    assert!(both > 20, "{both}");
}

/// Moves by X and Y and by polar coordinates, absolute and incremental, in mm and inches, with modes that are saved and
/// restored, in subroutines too.
fn modal(random: &mut Random) -> String {
    let mut text = "o1 sub\nM73\nG91 G1 X1 ^10\no1 endsub\no2 sub\nM73\nG90 G20 F5\nG0 X2 Y1\n\
                    o1 call\no2 endsub\n"
        .replace("X1 ^10", "@1 ^10");
    text += "G21 G17 G90 F100 G0 X10 Y5 Z0\n";
    let mut saved = false;
    for _ in 0..20 {
        let [a, b] = [(); 2].map(|()| random.between(1.0, 40.0));
        let angle = random.between(-200.0, 200.0);
        text += &match random.between(0.0, 14.0) as u32 {
            0 => format!("G0 X{a:.3} Y{b:.3}"),
            1 => format!("G1 X{a:.3}"),
            2 => format!("G1 @{a:.3} ^{angle:.3}"),
            3 => format!("G0 @{b:.3}"),
            4 => format!("G1 ^{angle:.3} Z{a:.3}"),
            5 => "G90".to_owned(),
            6 => "G91".to_owned(),
            7 => "G20".to_owned(),
            8 => "G21".to_owned(),
            9 => "M70".to_owned(),
            10 if saved => "M72".to_owned(),
            11 if saved => "M71".to_owned(),
            12 => "o1 call".to_owned(),
            13 => "o2 call".to_owned(),
            _ => format!("F{a:.1}"),
        };
        saved = match text.rsplit('\n').next() {
            Some("M70") => true,
            Some("M71") => false,
            _ => saved,
        };
        text.push('\n');
    }
    text + "G21 G90 G0 X0 Y0\nM2\n"
}

#[test]
fn polar_coordinates_and_saved_modes_lead_where_linuxcnc_goes() {
    if !available() {
        return;
    }
    for seed in 0..100 {
        let program = modal(&mut Random(seed));
        let (ours, theirs) = (ours(&program), theirs(&program));
        let (Some(ours), Some(theirs)) = (&ours, &theirs) else {
            panic!("seed {seed}: {ours:?} {theirs:?}\n{program}");
        };
        // Four decimals, of an inch too.
        assert!(
            !differ(ours, theirs, 0.0015),
            "seed {seed}\n{program}{ours:#?}\n{theirs:#?}"
        );
    }
}

/// Work offsets that are turned, shifted and set by the position, between moves and arcs. Behind each there is a move in
/// X and Y: of one in X alone after G10 L2 R of the active offset under G92 the other lets Y jump.
fn turned(random: &mut Random) -> String {
    let mut text = "G21 G17 G90 F100 G0 X10 Y5 Z0\n".to_owned();
    for _ in 0..20 {
        let [a, b] = [(); 2].map(|()| random.between(-40.0, 40.0));
        let angle = random.between(-200.0, 200.0);
        text += &match random.between(0.0, 12.0) as u32 {
            0 => format!("G0 X{a:.3} Y{b:.3}"),
            1 => format!("G1 X{a:.3}"),
            2 => format!("G1 Y{a:.3} Z{b:.3}"),
            3 => format!("G2 I{a:.3} J{b:.3}"),
            4 => format!("G10 L2 P1 R{angle:.3}\nG0 X{a:.3} Y{b:.3}"),
            5 => format!("G10 L2 P2 X{a:.3} Y{b:.3} R{angle:.3}\nG0 X1 Y2"),
            6 => format!("G10 L20 P1 X{a:.3} Y{b:.3}"),
            7 => format!("G92 X{a:.3} Y{b:.3}"),
            8 => "G54".to_owned(),
            9 => "G55".to_owned(),
            10 => format!("G91 G1 X{a:.3}\nG90"),
            _ => format!("G53 G0 X{a:.3} Y{b:.3}"),
        };
        text.push('\n');
    }
    text + "G0 X0 Y0\nM2\n"
}

#[test]
fn turned_work_leads_where_linuxcnc_goes() {
    if !available() {
        return;
    }
    for seed in 0..100 {
        let program = turned(&mut Random(seed));
        let (ours, theirs) = (ours(&program), theirs(&program));
        let (Some(ours), Some(theirs)) = (&ours, &theirs) else {
            panic!("seed {seed}: {ours:?} {theirs:?}\n{program}");
        };
        // Four decimals, and what they round in each offset adds up.
        assert!(
            !differ(ours, theirs, 0.003),
            "seed {seed}\n{program}{ours:#?}\n{theirs:#?}"
        );
    }
}
