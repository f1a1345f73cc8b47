//! What the cycle must never do once it runs: allocate, take a lock, touch a page for the first
//! time, make a system call of its own. Each proof is shown to see a planted offence.
//!
//! Controller, simulated buses and simulated drives run in one thread, so the proofs cover all
//! three. System calls and locks are watched from outside, by tracing a child of this program: a
//! lock is an atomic compare-and-exchange or exchange instruction, found by breakpoints or by
//! single steps.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use libc::{c_int, c_long, pid_t};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::collections::{BTreeMap, HashSet, VecDeque};
use std::fs::File;
use std::hint::black_box;
use std::os::unix::fs::FileExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Mutex};
use syncline_canopen::Instant;
use syncline_canopen::time::Duration;
use syncline_controller::bench::rig::{Shape, Shuttle, ready_machine};
use syncline_controller::control::Layout as MachineLayout;
use syncline_controller::control::{Instruction, PointToPoint, StopPoint, Wake};
use syncline_controller::machine::{COORDINATES, Machine};
use syncline_controller::observe::frames::SharedFrames;
use syncline_controller::port::Port;
use syncline_controller::port::sim::{SimPort, Simulated};
use syncline_controller::realtime;
use syncline_controller::run::driver::Driver;
use syncline_trajectory::path::{
    Command as PathCommand, Curve, Feed, Limits, Move, PathControlMode, PathItem, Planner,
};

/// Counts what each thread allocates.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: everything is left to the system's allocator; counting touches a thread's own cell.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: what the caller promises is what the system asks for.
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: what the caller promises is what the system asks for.
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: what the caller promises is what the system asks for.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// An offence to be found.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Plant {
    Nothing,
    Allocation,
    Lock,
    FirstTouch,
    SystemCall,
}

static LOCK: Mutex<u64> = Mutex::new(0);

/// One proof at a time: starting a child makes every page of this process fault once more.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

impl Plant {
    fn commit(self, fresh: &mut [u8]) {
        match self {
            Self::Nothing => {}
            Self::Allocation => drop(black_box(Box::new(1_u64))),
            Self::Lock => *LOCK.lock().unwrap() += 1,
            Self::FirstTouch => black_box(fresh)[1 << 20] = 1,
            // SAFETY: asks for a number.
            Self::SystemCall => drop(unsafe { libc::syscall(libc::SYS_getpgrp) }),
        }
    }

    fn by_name(name: &str) -> Self {
        [
            Self::Nothing,
            Self::Allocation,
            Self::Lock,
            Self::FirstTouch,
            Self::SystemCall,
        ]
        .into_iter()
        .find(|plant| format!("{plant:?}") == name)
        .unwrap()
    }
}

/// Axes of the machines but for those that are watched step by step.
const AXES: usize = 3;
/// Cycles that run on one staging of the plan.
const CHUNK: usize = 500;

type Machinery = Driver<COORDINATES, Box<dyn Port + Send>>;

/// A machine in motion.
struct Warm {
    machine: Machinery,
    /// The next instruction of a plan that does not end.
    plan: Box<dyn FnMut() -> Instruction<COORDINATES>>,
    /// Instructions that a planner has ready for the cycle.
    staged: VecDeque<Instruction<COORDINATES>>,
    fresh: Vec<u8>,
    /// What the buses relay, if they do.
    frames: Option<SharedFrames>,
}

impl Warm {
    fn new(axes: usize) -> Self {
        let shape = Shape::on_fewest_buses(axes, Duration::from_millis(2)).unwrap();
        let mut shuttle = Shuttle::new(axes);
        Self::of(
            ready_machine(&shape),
            None,
            Box::new(move || shuttle.instruction()),
        )
    }

    /// The example of devices of several kinds: axes that are sent positions and velocities, loops closed by an encoder and by
    /// a drive, polls, and one that goes point to point. Its frames are relayed, as in a run in real time.
    fn mixed() -> Self {
        Self::of_example(&example("mixed"), Some(FEEDER))
    }

    /// A drive that is sent torques, on an axis whose backlash and lead error are compensated.
    fn compensated() -> Self {
        let keys = "max_velocity = 800.0\nbacklash = 0.05\nlead_error = [[0, 0], [100, 20], [250, -15], [400, 5]]\n\
            feed_forward = { rated_torque = 1.4, inertia = 8e-4, motor_inertia = 3e-4, coulomb_friction = 0.2, \
            viscous_friction = 1e-3, gravity = 0.1 }";
        let text = std::fs::read_to_string(example("csp")).unwrap();
        let text = text.replacen("max_velocity = 800.0", keys, 1);
        // A child reads it while its parent's stays as it is.
        let name = format!("compensated-{}.toml", std::process::id());
        let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::write(&file, text).unwrap();
        let warm = Self::of_example(&file, None);
        std::fs::remove_file(file).unwrap();
        warm
    }

    /// A machine file's, in simulation; at each end of its moves it has this axis go point to point.
    fn of_example(file: &Path, feeder: Option<usize>) -> Self {
        let (machine, frames, start) = simulated(file);
        let mut plan = ExamplePlan::new(start, feeder);
        Self::of(machine, Some(frames), Box::new(move || plan.instruction()))
    }

    fn of(
        machine: Machinery,
        frames: Option<SharedFrames>,
        plan: Box<dyn FnMut() -> Instruction<COORDINATES>>,
    ) -> Self {
        let mut warm = Self {
            machine,
            plan,
            staged: VecDeque::new(),
            fresh: vec![0; 4 << 20],
            frames,
        };
        warm.run(4 * CHUNK, Plant::Nothing, |_| ());
        warm
    }

    fn stage(&mut self) {
        while self.staged.len() < 4096 {
            self.staged.push_back((self.plan)());
        }
    }

    fn hand_over(&mut self) {
        while self.machine.controller.room() > 0
            && let Some(instruction) = self.staged.pop_front()
        {
            self.machine.controller.accept(instruction);
        }
    }

    /// Runs whole chunks of cycles; `watch` is told when the cycle runs and when the planner does.
    fn run(&mut self, cycles: usize, plant: Plant, mut watch: impl FnMut(bool)) {
        for chunk in 0..cycles.div_ceil(CHUNK) {
            // Full to begin with, so that a cycle is handed no more than the one before has used up.
            self.stage();
            self.hand_over();
            self.stage();
            watch(true);
            for wake in 0..2 * CHUNK.min(cycles) {
                self.hand_over();
                let next = self.machine.controller.next_wake();
                let now = next.map_or(Instant::ZERO, Wake::at);
                self.machine.step(now).unwrap();
                if chunk == 0 && wake == 2 {
                    plant.commit(&mut self.fresh);
                }
            }
            watch(false);
            self.frames.iter().for_each(SharedFrames::catch_up);
            assert_eq!(self.machine.controller.end(), None);
        }
    }
}

/// The axis of `examples/mixed` that goes point to point.
const FEEDER: usize = 6;

/// The machine file of an example.
fn example(name: &str) -> PathBuf {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    examples.join(name).join("machine.toml")
}

/// A machine in simulation, ready for its plan, and where that starts.
fn simulated(file: &Path) -> (Machinery, SharedFrames, [f64; COORDINATES]) {
    let machine = Machine::load(file).unwrap();
    let frames = SharedFrames::new(&machine);
    let relays = (0..machine.buses.len()).map(|bus| Some(Box::new(frames.relay(bus)) as _));
    let simulated = Simulated::new(&machine, 0, relays, |_, _| ()).unwrap();
    let ports = (simulated.buses.iter().flatten())
        .map(|&bus| Box::new(SimPort::new(bus)) as Box<dyn Port + Send>)
        .collect();
    let layout = Arc::new(MachineLayout::new(&machine).unwrap());
    let mut driver = Driver::new(layout, simulated.world, ports, Instant::ZERO);
    driver.controller.touch();
    for _ in 0..20_000 {
        if let Some(start) = driver.controller.ready() {
            return (driver, frames, start);
        }
        let wake = driver.controller.next_wake().unwrap();
        driver.step(wake.at()).unwrap();
    }
    panic!("no bring-up: {:?}", driver.controller.end());
}

/// Axes of the path to and fro, and at each end the feeder, if there is one.
struct ExamplePlan {
    planner: Planner<COORDINATES>,
    ends: [[f64; COORDINATES]; 2],
    moves: u32,
    feeder: Option<usize>,
}

impl ExamplePlan {
    fn new(start: [f64; COORDINATES], feeder: Option<usize>) -> Self {
        let limits = Limits {
            velocity: [40.0; COORDINATES],
            acceleration: [400.0; COORDINATES],
            jerk: [10_000.0; COORDINATES],
        };
        let mut end = start;
        for (axis, way) in [50.0, 40.0, -30.0].into_iter().enumerate() {
            end[axis] += way;
        }
        Self {
            planner: Planner::new(limits, start),
            ends: [start, end],
            moves: 0,
            feeder,
        }
    }

    fn instruction(&mut self) -> Instruction<COORDINATES> {
        loop {
            match self.planner.pop() {
                Some(PathCommand::Mark { item, mark }) => {
                    let mut targets = [None; COORDINATES];
                    if let Some(feeder) = self.feeder {
                        targets[feeder] = Some(if mark % 2 == 0 { 5.0 } else { 0.0 });
                    }
                    let feeds = PointToPoint {
                        targets,
                        speed: None,
                    };
                    let stop = StopPoint::PointToPoint {
                        motion: feeds,
                        line: 0,
                    };
                    return Instruction::Mark { item, mark, stop };
                }
                Some(command) => return Instruction::Plan(command),
                None => self.push(),
            }
        }
    }

    fn push(&mut self) {
        let [from, to] = [self.moves, self.moves + 1].map(|end| self.ends[end as usize % 2]);
        let item = PathItem::Move(Move {
            curve: Curve::line(from, to).unwrap(),
            feed: Feed::Rapid,
            mode: PathControlMode::Stop,
            tag: 1,
        });
        self.planner.push(item).unwrap();
        if self.feeder.is_some() {
            self.planner.mark(self.moves);
        }
        self.moves += 1;
    }
}

#[test]
fn no_allocation_and_no_first_touch_in_100_000_cycles() {
    cost_nothing(|| Warm::new(AXES), 100_000);
}

#[test]
fn no_allocation_and_no_first_touch_with_devices_of_several_kinds() {
    cost_nothing(Warm::mixed, 20_000);
}

#[test]
fn no_allocation_and_no_first_touch_with_compensated_axes_and_torques() {
    cost_nothing(Warm::compensated, 20_000);
}

/// So many cycles allocate nothing and touch no page for the first time; one that does is seen.
fn cost_nothing(warm: impl FnOnce() -> Warm, cycles: usize) {
    let _alone = ONE_AT_A_TIME.lock();
    let mut warm = warm();
    assert_eq!(costs(&mut warm, cycles, Plant::Nothing), (0, 0));
    assert_eq!(costs(&mut warm, CHUNK, Plant::Allocation).0, 1);
    assert_eq!(costs(&mut warm, CHUNK, Plant::FirstTouch).1, 1);
}

/// Allocations and first touches of pages while the cycle runs.
fn costs(warm: &mut Warm, cycles: usize, plant: Plant) -> (u64, u64) {
    let (mut before, mut sum) = ((0, 0), (0, 0));
    warm.run(cycles, plant, |running| {
        let now = (ALLOCATIONS.get(), realtime::usage().page_faults);
        if running {
            before = now;
        } else {
            sum = (sum.0 + now.0 - before.0, sum.1 + now.1 - before.1);
        }
    });
    sum
}

#[test]
fn no_system_call_in_100_000_cycles() {
    let _alone = ONE_AT_A_TIME.lock();
    assert_eq!(watch(Plant::Nothing, 100_000, Watch::SystemCalls), 0);
    assert_eq!(watch(Plant::SystemCall, 1_000, Watch::SystemCalls), 1);
}

/// While the cycle runs, every compare-and-exchange of the whole process is a breakpoint: a lock's
/// way in.
#[test]
fn no_lock_is_taken_in_100_000_cycles() {
    let _alone = ONE_AT_A_TIME.lock();
    assert_eq!(watch(Plant::Nothing, 100_000, Watch::CompareExchanges), 0);
    assert!(watch(Plant::Lock, 1_000, Watch::CompareExchanges) >= 1);
}

#[test]
fn no_lock_is_taken_with_devices_of_several_kinds_whose_frames_are_relayed() {
    let _alone = ONE_AT_A_TIME.lock();
    for machine in ["mixed", "compensated"] {
        let locks = |plant| watch_machine(machine, plant, 1_000, Watch::CompareExchanges);
        assert_eq!(locks(Plant::Nothing), 0, "{machine}");
        assert!(locks(Plant::Lock) >= 1, "{machine}");
    }
}

/// Exchanges too, as a spin lock takes them. Single steps are slow: a few cycles of one axis, whose code is
/// that of more.
#[test]
fn no_lock_is_taken_in_any_way() {
    let _alone = ONE_AT_A_TIME.lock();
    assert_eq!(watch(Plant::Nothing, 2, Watch::Locks), 0);
    assert!(watch(Plant::Lock, 2, Watch::Locks) >= 1);
}

/// What is watched in the child while its cycle runs.
#[derive(Clone, Copy, PartialEq)]
enum Watch {
    SystemCalls,
    CompareExchanges,
    Locks,
}

/// Breakpoints in another process, each with the byte that it stands in for.
struct Breakpoints {
    memory: File,
    bytes: BTreeMap<u64, u8>,
}

impl Breakpoints {
    const INT3: u8 = 0xCC;

    /// For every atomic compare-and-exchange in the code of a process that is stopped.
    fn at_compare_exchanges(pid: pid_t) -> Self {
        let mut memory = File::options();
        let memory = memory.read(true).write(true);
        let memory = memory.open(format!("/proc/{pid}/mem")).unwrap();
        let mut bytes = BTreeMap::new();
        for line in std::fs::read_to_string(format!("/proc/{pid}/maps"))
            .unwrap()
            .lines()
        {
            let mut fields = line.split_ascii_whitespace();
            let (range, rights) = (fields.next().unwrap(), fields.next().unwrap());
            if !rights.contains('x') || line.contains("[v") {
                continue;
            }
            let (from, to) = range.split_once('-').unwrap();
            let [from, to] = [from, to].map(|hex| u64::from_str_radix(hex, 16).unwrap());
            let mut code = vec![0; (to - from) as usize];
            memory.read_exact_at(&mut code, from).unwrap();
            for place in 0..code.len().saturating_sub(8) {
                let here: [u8; 8] = code[place..place + 8].try_into().unwrap();
                // Not into the middle of one: assemblers put the size before the lock.
                let whole = place == 0 || code[place - 1] != 0x66;
                if whole && here[0] == 0xF0 && takes_lock(&here) {
                    bytes.insert(from + place as u64, here[0]);
                }
            }
        }
        assert!(bytes.len() > 10, "a mutex is among them");
        Self { memory, bytes }
    }

    /// Puts them into the code, or takes them out.
    fn arm(&self, armed: bool) {
        for (&address, &byte) in &self.bytes {
            self.write(address, if armed { Self::INT3 } else { byte });
        }
    }

    fn write(&self, address: u64, byte: u8) {
        self.memory.write_all_at(&[byte], address).unwrap();
    }

    /// Goes over the one that the process has just met, if it has.
    fn step_over(&self, pid: pid_t) -> bool {
        let mut registers = registers(pid);
        let address = registers.rip - 1;
        let Some(&byte) = self.bytes.get(&address) else {
            return false;
        };
        self.write(address, byte);
        registers.rip = address;
        // SAFETY: the kernel reads one set of registers.
        let set = unsafe { libc::ptrace(libc::PTRACE_SETREGS, pid, 0_usize, &raw const registers) };
        assert_eq!(set, 0);
        trace(libc::PTRACE_SINGLESTEP, pid, 0);
        assert!(libc::WIFSTOPPED(wait(pid)));
        self.write(address, Self::INT3);
        true
    }
}

/// A system call that nothing else here makes.
const MARK: c_long = libc::SYS_getsid;

fn mark() {
    // SAFETY: asks for a number.
    unsafe { libc::syscall(MARK, 0) };
}

/// The watched program: a mark where the cycle begins to run and where the planner does. It runs
/// in place of the test harness, which would put it into a thread of its own.
extern "C" fn watched() {
    let [Ok(plant), Ok(axes), Ok(cycles)] = ["PLANT", "AXES", "CYCLES"].map(std::env::var) else {
        return;
    };
    let mut warm = match axes.as_str() {
        "mixed" => Warm::mixed(),
        "compensated" => Warm::compensated(),
        axes => Warm::new(axes.parse().unwrap()),
    };
    warm.run(cycles.parse().unwrap(), Plant::by_name(&plant), |_| mark());
    std::process::exit(0);
}

#[used]
#[unsafe(link_section = ".init_array")]
static BEFORE_MAIN: extern "C" fn() = watched;

/// Runs [`watched`] under trace and counts what was asked for while its cycle runs, step by step no more than
/// one of it.
fn watch(plant: Plant, cycles: usize, what: Watch) -> u64 {
    let axes = if what == Watch::Locks { 1 } else { AXES };
    watch_machine(&axes.to_string(), plant, cycles, what)
}

/// The same of a machine with so many axes, of the [mixed](Warm::mixed) or of the [compensated](Warm::compensated) one.
fn watch_machine(axes: &str, plant: Plant, cycles: usize, what: Watch) -> u64 {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command
        .env("PLANT", format!("{plant:?}"))
        .env("AXES", axes)
        .env("CYCLES", cycles.to_string())
        .stdout(std::process::Stdio::null());
    // SAFETY: the child only asks to be traced; ptrace is a bare system call.
    unsafe {
        command.pre_exec(|| match libc::ptrace(libc::PTRACE_TRACEME, 0, 0, 0) {
            0 => Ok(()),
            _ => Err(std::io::Error::last_os_error()),
        });
    }
    // Only the thread that started the child may trace it; `wait` below waits for its end.
    #[allow(clippy::zombie_processes)]
    let mut child = command.spawn().unwrap();
    let pid = child.id() as pid_t;
    let mut count = 0;
    let mut marks = 0;
    let mut entering = true;
    let mut breakpoints = None;
    // Where instructions are that take no lock and call no system.
    let mut harmless = HashSet::new();
    assert!(
        libc::WIFSTOPPED(wait(pid)),
        "stopped at its first instruction"
    );
    trace(
        libc::PTRACE_SETOPTIONS,
        pid,
        libc::PTRACE_O_TRACESYSGOOD.into(),
    );
    loop {
        let stepping = what == Watch::Locks && marks % 2 == 1;
        let go_on = if stepping {
            libc::PTRACE_SINGLESTEP
        } else {
            libc::PTRACE_SYSCALL
        };
        trace(go_on, pid, 0);
        let status = wait(pid);
        if libc::WIFEXITED(status) {
            assert_eq!(libc::WEXITSTATUS(status), 0, "the watched program failed");
            assert!(marks >= 2);
            return count;
        }
        assert!(libc::WIFSTOPPED(status), "{status:x}");
        if stepping && harmless.contains(&instruction_pointer(pid)) {
            continue;
        }
        let registers = registers(pid);
        if libc::WSTOPSIG(status) == libc::SIGTRAP | 0x80 {
            if entering {
                if registers.orig_rax as c_long == MARK {
                    marks += 1;
                    if what == Watch::CompareExchanges {
                        breakpoints
                            .get_or_insert_with(|| Breakpoints::at_compare_exchanges(pid))
                            .arm(marks % 2 == 1);
                    }
                } else if marks % 2 == 1 {
                    count += 1;
                }
            }
            entering = !entering;
        } else if let Some(breakpoints) = &breakpoints {
            if breakpoints.step_over(pid) && marks % 2 == 1 {
                count += 1;
            }
        } else if stepping {
            let next = code(pid, registers.rip);
            let calls = next.starts_with(&[0x0F, 0x05]);
            if calls && registers.rax as c_long == MARK {
                // The closing mark, seen as a step: go on to its exit by system calls.
                marks += 1;
                trace(libc::PTRACE_SINGLESTEP, pid, 0);
                wait(pid);
                entering = true;
            } else if takes_lock(&next) {
                child.kill().unwrap();
                child.wait().unwrap();
                return 1;
            } else if !calls {
                harmless.insert(registers.rip);
            }
        }
    }
}

fn trace(request: libc::c_uint, pid: pid_t, data: c_long) {
    // SAFETY: these requests read nothing of ours but the number `data`.
    let result = unsafe { libc::ptrace(request, pid, 0_usize, data) };
    assert_eq!(result, 0, "{}", std::io::Error::last_os_error());
}

fn wait(pid: pid_t) -> c_int {
    let mut status = 0;
    // SAFETY: the kernel writes one int.
    let found = unsafe { libc::waitpid(pid, &raw mut status, 0) };
    assert_eq!(found, pid);
    status
}

fn registers(pid: pid_t) -> libc::user_regs_struct {
    // SAFETY: plain data, filled by the kernel.
    unsafe {
        let mut registers: libc::user_regs_struct = std::mem::zeroed();
        let result = libc::ptrace(libc::PTRACE_GETREGS, pid, 0_usize, &raw mut registers);
        assert_eq!(result, 0);
        registers
    }
}

/// Where the next instruction is.
fn instruction_pointer(pid: pid_t) -> u64 {
    let place = std::mem::offset_of!(libc::user_regs_struct, rip);
    // SAFETY: reads a register of the child through the kernel.
    let word = unsafe { libc::ptrace(libc::PTRACE_PEEKUSER, pid, place, 0_usize) };
    word.cast_unsigned()
}

/// The instruction at an address, as far as it matters.
fn code(pid: pid_t, address: u64) -> [u8; 8] {
    // SAFETY: reads the child's memory through the kernel, which checks the address.
    let word = unsafe { libc::ptrace(libc::PTRACE_PEEKTEXT, pid, address, 0_usize) };
    word.to_ne_bytes()
}

/// Whether an instruction is an atomic compare-and-exchange, or an exchange with memory.
fn takes_lock(code: &[u8; 8]) -> bool {
    let prefixes = [
        0x66, 0x67, 0xF0, 0xF2, 0xF3, 0x2E, 0x36, 0x3E, 0x26, 0x64, 0x65,
    ];
    let end = code
        .iter()
        .position(|byte| !prefixes.contains(byte))
        .unwrap_or(8);
    let locked = code[..end].contains(&0xF0);
    let opcode = match &code[end..] {
        [0x40..=0x4F, rest @ ..] => rest,
        rest => rest,
    };
    match opcode {
        [0x0F, 0xB0 | 0xB1 | 0xC7, ..] => locked,
        [0x86 | 0x87, operand, ..] => operand >> 6 != 3,
        _ => false,
    }
}

#[test]
fn lock_instructions_are_told_from_others() {
    let padded = |bytes: &[u8]| {
        let mut code = [0x90; 8];
        code[..bytes.len()].copy_from_slice(bytes);
        takes_lock(&code)
    };
    assert!(padded(&[0xF0, 0x0F, 0xB1, 0x0F]), "lock cmpxchg [rdi], ecx");
    assert!(
        padded(&[0xF0, 0x48, 0x0F, 0xB1, 0x0F]),
        "lock cmpxchg [rdi], rcx"
    );
    assert!(padded(&[0x87, 0x07]), "xchg [rdi], eax");
    assert!(!padded(&[0x87, 0xC7]), "xchg edi, eax");
    assert!(
        !padded(&[0xF0, 0xFF, 0x07]),
        "lock inc [rdi]: counts references"
    );
    assert!(!padded(&[0x89, 0x07]), "mov [rdi], eax");
}
