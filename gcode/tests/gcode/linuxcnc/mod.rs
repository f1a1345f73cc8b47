//! Compensated contours, polar coordinates, saved modes and whatever else programs are written in against LinuxCNC's stand-alone interpreter, `rs274`, where it
//! is installed.

mod language;
mod modes;

use std::fs::{self, File};
use std::process::Command;

use syncline_gcode::{Action, AxisLetter, Error, Plane, Tool};

use super::listing::{run_with, xyz};
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

/// Tools as both have them: number, length and diameter, mm.
const TOOLS: [(u32, f64, f64); 3] = [(1, 50.0, 6.0), (2, 70.0, 10.0), (3, 30.5, 4.0)];

/// How the other interpreter's coordinates lie in the machine, mm and degrees.
struct Theirs {
    unit: f64,
    origin: [f64; 3],
    shift: [f64; 3],
    turned: f64,
    tool: [f64; 3],
    plane: Plane,
}

impl Theirs {
    fn in_machine(&self, place: [f64; 3]) -> [f64; 3] {
        let (sine, cosine) = self.turned.to_radians().sin_cos();
        let [x, y, z] = [0, 1, 2].map(|axis| place[axis] + self.shift[axis]);
        let turned = [x * cosine - y * sine, x * sine + y * cosine, z];
        [0, 1, 2].map(|axis| self.origin[axis] + turned[axis] + self.tool[axis])
    }

    /// The end of a move, and of an arc the centre and the turns, from a line of what it tells.
    fn take(&mut self, line: &str) -> Option<Vec<f64>> {
        let (name, values) = line.split_once('(')?;
        match values.trim_end_matches(')') {
            "CANON_UNITS_INCHES" => self.unit = 25.4,
            "CANON_UNITS_MM" => self.unit = 1.0,
            "CANON_PLANE_XY" => self.plane = Plane::Xy,
            "CANON_PLANE_XZ" => self.plane = Plane::Zx,
            "CANON_PLANE_YZ" => self.plane = Plane::Yz,
            _ => {}
        }
        let values: Vec<f64> = values
            .split([',', ' ', ')'])
            .filter(|value| !value.is_empty())
            .map_while(|value| value.parse::<f64>().ok())
            .map(|value| value * self.unit)
            .collect();
        match name.split_whitespace().last()? {
            "SET_G5X_OFFSET" => self.origin.copy_from_slice(&values[1..4]),
            "SET_G92_OFFSET" => self.shift.copy_from_slice(&values[..3]),
            "SET_XY_ROTATION" => self.turned = values[0] / self.unit,
            "USE_TOOL_LENGTH_OFFSET" => self.tool.copy_from_slice(&values[..3]),
            "ARC_FEED" => {
                let axes = self.plane.axes().map(AxisLetter::index);
                let placed = |first, second| {
                    let mut place = [0.0; 3];
                    for (axis, value) in axes.into_iter().zip([first, second, values[5]]) {
                        place[axis] = value;
                    }
                    self.in_machine(place)
                };
                let center = placed(values[2], values[3]);
                let mut arc = placed(values[0], values[1]).to_vec();
                arc.extend([center[axes[0]], center[axes[1]], values[4] / self.unit]);
                return Some(arc);
            }
            "STRAIGHT_FEED" | "STRAIGHT_TRAVERSE" => {
                return Some(self.in_machine([values[0], values[1], values[2]]).to_vec());
            }
            _ => {}
        }
        None
    }
}

/// Where a program leads in the other interpreter: ends of moves, of arcs with centre and turns, mm; `None` where it
/// refuses the program.
fn theirs(program: &str) -> Option<Vec<Vec<f64>>> {
    // Two of it at a time disturb each other, those of other processes too.
    let one = File::create(std::env::temp_dir().join("syncline-rs274.lock")).unwrap();
    one.lock().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let [file, tools] = ["part.ngc", "tools.tbl"].map(|name| folder.path().join(name));
    fs::write(&file, program).unwrap();
    // By itself it counts in inches.
    let tool = |(number, length, diameter): (u32, f64, f64)| {
        let [length, diameter] = [length, diameter].map(|mm| mm / 25.4);
        format!("T{number} P{number} Z{length:.9} D{diameter:.9}\n")
    };
    fs::write(&tools, TOOLS.map(tool).concat()).unwrap();
    let mut command = Command::new("rs274");
    command.arg("-g").arg("-t").arg(tools).arg(&file);
    // It keeps its tools in a file there, which also the one that is only asked whether it is there writes anew.
    command.env("HOME", folder.path());
    let output = command.current_dir(folder.path()).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let mut machine = Theirs {
        unit: 1.0,
        origin: [0.0; 3],
        shift: [0.0; 3],
        turned: 0.0,
        tool: [0.0; 3],
        plane: Plane::Xy,
    };
    let moves = text.lines().filter_map(|line| machine.take(line)).collect();
    let ended = text.contains("PROGRAM_END");
    if !ended {
        // Shown where the test fails.
        println!(
            "{}{}",
            output.status,
            String::from_utf8_lossy(&output.stderr)
        );
    }
    ended.then_some(moves)
}

fn refused_or_moves(program: &str) -> Result<Vec<Vec<f64>>, Error> {
    let mut setup = xyz();
    for (number, length, diameter) in TOOLS {
        let mut tool = Tool {
            diameter,
            ..Tool::default()
        };
        tool.offset[AxisLetter::Z] = length;
        setup.tables.tools.insert(number, tool);
    }
    let commands = run_with(setup, program)?;
    let moves = commands.iter().filter_map(|command| match &command.action {
        Action::Rapid { to } | Action::Feed { to, .. } => Some(to.0[..3].to_vec()),
        Action::Arc { arc, .. } => {
            let mut moved = arc.to.0[..3].to_vec();
            let turns = f64::from(arc.turns + 1).copysign(arc.sweep);
            moved.extend([arc.center[0], arc.center[1], turns]);
            Some(moved)
        }
        _ => None,
    });
    Ok(moves.collect())
}

fn ours(program: &str) -> Option<Vec<Vec<f64>>> {
    refused_or_moves(program).ok()
}

/// Without lines that lead no farther than that: theirs has one for a G1 that only says that lines follow.
fn moved(moves: Vec<Vec<f64>>, least: f64) -> Vec<Vec<f64>> {
    let mut at = vec![0.0; 3];
    let leads = |to: &Vec<f64>| {
        let is_line = to.len() == 3;
        let rests = at.iter().zip(to).all(|(at, to)| (at - to).abs() < least);
        at = to[..at.len()].to_vec();
        !(is_line && rests)
    };
    moves.into_iter().filter(leads).collect()
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
    text + "G90 G40 G1 X0 Y0 Z5\nM2\n"
}

/// The same contour under G18, whose axes are Z and X.
fn under_g18(contour: &str) -> String {
    let put = |letter| match letter {
        'X' => 'Z',
        'Y' => 'X',
        'Z' => 'Y',
        'I' => 'K',
        'J' => 'I',
        other => other,
    };
    let contour: String = contour.chars().map(put).collect();
    contour.replace("G17", "G18")
}

#[test]
fn compensated_contours_end_where_linuxcnc_ends_them() {
    if !available() {
        return;
    }
    let (mut both, mut only_theirs) = (0, 0);
    for seed in 0..150 {
        let mut program = contour(&mut Random(seed));
        if seed >= 100 {
            program = under_g18(&program);
        }
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
