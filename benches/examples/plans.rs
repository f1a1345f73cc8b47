//! Plans that are the same in every build, for counting the planner's instructions: 30,000 problems of one axis from
//! state to state, or a whole program.
//!
//! ```sh
//! cargo build --release -p syncline-benches --example plans
//! count() {
//!     valgrind --tool=callgrind --callgrind-out-file=/dev/null --collect-atstart=no "--toggle-collect=*$1*" \
//!         target/release/examples/plans "${@:2}"
//! }
//! count solve_all
//! count plan_program examples/portal/machine.toml examples/portal/bracket.ngc
//! ```
//!
//! With `--csv` it writes the problems as `syncline plan` reads them, for builds that do not have this example.

use std::hint::black_box;
use std::path::Path;
use syncline_benches::cases::Rng;
use syncline_controller::machine::{Machine, Position};
use syncline_controller::program::{Program, Timetable};
use syncline_trajectory::limits::Limits;
use syncline_trajectory::profile::{Profile, State};
use syncline_trajectory::state_to_state::Problem;
use syncline_trajectory::synchronise::{Synchronisation, plan};

/// How many problems.
const PROBLEMS: usize = 30_000;

/// What draws them.
const SEED: u64 = 20_261_126;

/// Start, target and limits, which are over three decades and more and differ by direction. Two in three set off in motion,
/// and one in five arrives in motion.
fn draw(rng: &mut Rng, number: usize) -> (State, State, Limits) {
    let (v_max, a_max) = (rng.log(1.0, 1e3), rng.log(10.0, 1e4));
    let j_max = rng.log(100.0, 1e6);
    let v_min = -v_max * rng.uniform(0.3, 1.5);
    let a_min = -a_max * rng.uniform(0.3, 1.5);
    let mut state = |moves: bool| State {
        p: rng.uniform(-500.0, 500.0),
        v: if moves {
            0.5 * rng.uniform(v_min, v_max)
        } else {
            0.0
        },
        a: 0.0,
    };
    let start = state(!number.is_multiple_of(3));
    let target = state(number.is_multiple_of(5));
    let limits = Limits {
        v_max,
        v_min,
        a_max,
        a_min,
        j_max,
        j_min: -j_max,
    };
    (start, target, limits)
}

/// Plans each; how many have a plan, and how long they take together, s.
#[inline(never)]
fn solve_all(problems: &[Problem]) -> (usize, f64) {
    let mut profile = [Profile::new(State::default())];
    let durations = problems.iter().filter_map(|problem| {
        let problem = black_box(std::slice::from_ref(problem));
        plan(problem, Synchronisation::Line, 0.0, &mut profile).ok()
    });
    durations.fold((0, 0.0), |(count, sum), duration| {
        (count + 1, sum + duration)
    })
}

/// Interprets and plans a program from where the machine rests.
#[inline(never)]
fn plan_program(program: &Program, start: Position) -> Timetable {
    let planned = program.timetable(start);
    planned.expect("a program that can be run")
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [machine_file, program] = &arguments[..] {
        let machine_file = Path::new(machine_file);
        let machine = Machine::load(machine_file).expect("a machine file");
        let program = Program::new(Path::new(program), &machine, machine_file).expect("its tables");
        println!(
            "{:.3} s in motion",
            plan_program(&program, machine.rest()).motion()
        );
        return;
    }
    let mut rng = Rng::new(SEED);
    let drawn: Vec<_> = (0..PROBLEMS).map(|it| draw(&mut rng, it)).collect();
    if arguments.iter().any(|it| it == "--csv") {
        println!("id,sync,p0_0,v0_0,a0_0,pf_0,vf_0,af_0,vmax_0,vmin_0,amax_0,amin_0,jmax_0");
        for (id, (start, target, limits)) in drawn.iter().enumerate() {
            let Limits {
                v_max,
                v_min,
                a_max,
                a_min,
                j_max,
                ..
            } = limits;
            println!(
                "{id},line,{},{},0,{},{},0,{v_max},{v_min},{a_max},{a_min},{j_max}",
                start.p, start.v, target.p, target.v
            );
        }
        return;
    }
    let problems: Vec<_> = drawn
        .into_iter()
        .map(|(start, target, limits)| Problem::new(start, target, limits))
        .collect();
    let (planned, duration) = solve_all(&problems);
    println!("{planned} of {PROBLEMS} planned, {duration:.6} s");
}
