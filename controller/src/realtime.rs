//! What a thread asks of the kernel to keep a cycle, and what it got.
//!
//! Every request can fail and none is fatal: the report says what was granted, and for the rest
//! which command grants it. The thread calls [`enter`] once before its cycle and
//! [`sleep_until`] in it.
#![allow(unsafe_code)]

use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::mem::MaybeUninit;
use std::os::fd::AsRawFd;
use std::time::Duration;
use syncline_canopen::Instant;

/// Stack that is touched before the cycle so that the cycle touches no page for the first time.
const STACK: usize = 256 * 1024;
/// Memory that a run has in hand before axes move: far more than planning, telling and ending take meanwhile.
const HEAP: usize = 32 << 20;
/// How much of it is asked for at a time.
const BLOCK: usize = 64 << 10;

/// What the cycle thread wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// SCHED_FIFO priority, 1…99; the network interrupt thread should be above it.
    pub priority: u8,
    /// The core to run on, as the kernel counts them; `None` leaves it to the scheduler. An
    /// isolated core is named here, the inherited mask does not list it.
    pub core: Option<usize>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            priority: 80,
            core: None,
        }
    }
}

/// One request to the kernel and its answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// What was asked for, for example `SCHED_FIFO 80`.
    pub what: String,
    /// `None` if granted.
    pub refused: Option<Refusal>,
}

/// Why a request was refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The kernel's reason.
    pub reason: String,
    /// What to type so that it is granted.
    pub grant: String,
}

/// What the thread got. What holds only as long as it is wanted is given back on drop.
#[derive(Debug)]
pub struct Granted {
    requests: Vec<Request>,
    /// Keeps the processor out of deep sleep states while open.
    _awake: Option<File>,
}

impl Granted {
    /// Each request with its answer.
    #[must_use]
    pub fn requests(&self) -> &[Request] {
        &self.requests
    }

    /// Whether everything was granted.
    #[must_use]
    pub fn complete(&self) -> bool {
        self.requests
            .iter()
            .all(|request| request.refused.is_none())
    }
}

/// One line: `real time: SCHED_FIFO 80, core 3; not: memory locked (…; sudo …)`.
impl fmt::Display for Granted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("real time: ")?;
        let granted = self.requests.iter().filter(|it| it.refused.is_none());
        for (index, request) in granted.enumerate() {
            write!(f, "{}{}", if index > 0 { ", " } else { "" }, request.what)?;
        }
        let refused = self
            .requests
            .iter()
            .filter_map(|request| Some((request, request.refused.as_ref()?)));
        for (index, (request, refusal)) in refused.enumerate() {
            let lead = if index > 0 { ", " } else { "; not: " };
            write!(
                f,
                "{lead}{} ({}: {})",
                request.what, refusal.reason, refusal.grant
            )?;
        }
        Ok(())
    }
}

/// Makes the calling thread as punctual as the kernel allows: SCHED_FIFO, its core, all memory
/// locked, its stack touched, the processor kept out of deep sleep.
#[must_use]
pub fn enter(settings: &Settings) -> Granted {
    let mut requests = Vec::new();
    let mut ask = |what: String, answer: io::Result<()>, grant: &dyn Fn() -> String| {
        requests.push(Request {
            what,
            refused: answer.err().map(|error| Refusal {
                reason: reason(&error),
                grant: grant(),
            }),
        });
    };
    ask(
        format!("SCHED_FIFO {}", settings.priority),
        set_fifo(settings.priority),
        &grant_capabilities,
    );
    if let Some(core) = settings.core {
        ask(format!("core {core}"), pin(core), &|| {
            format!(
                "name a core that `taskset -pc $$` allows, this machine has 0…{}",
                cores() - 1
            )
        });
    }
    ask("memory locked".into(), lock_memory(), &grant_capabilities);
    touch_stack();
    ask("stack touched".into(), Ok(()), &String::new);
    let awake = stay_awake();
    ask(
        "no deep sleep".into(),
        awake
            .as_ref()
            .map(drop)
            .map_err(|error| match error.raw_os_error() {
                Some(code) => io::Error::from_raw_os_error(code),
                None => error.kind().into(),
            }),
        &|| "sudo chmod o+rw /dev/cpu_dma_latency, or boot with cpuidle.off=1".into(),
    );
    // Matters only without SCHED_FIFO: the default slack of 50 us comes on top of every sleep.
    // SAFETY: PR_SET_TIMERSLACK takes one number and touches no memory.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1, 0, 0, 0) };
    Granted {
        requests,
        _awake: awake.ok(),
    }
}

fn reason(error: &io::Error) -> String {
    match error.raw_os_error() {
        Some(libc::EPERM | libc::EACCES) => "not permitted".into(),
        Some(libc::ENOENT) => "not there".into(),
        Some(libc::ENOMEM) => "over the memlock limit".into(),
        _ => error.to_string(),
    }
}

/// The command that lets this program have real-time scheduling and locked memory.
fn grant_capabilities() -> String {
    let program = std::env::current_exe()
        .map_or_else(|_| "syncline".into(), |path| path.display().to_string());
    format!("sudo setcap cap_sys_nice,cap_ipc_lock,cap_net_admin=ep {program}")
}

/// Processors that the kernel has configured.
pub(crate) fn cores() -> usize {
    // SAFETY: sysconf takes a number and gives one.
    usize::try_from(unsafe { libc::sysconf(libc::_SC_NPROCESSORS_CONF) }).unwrap_or(1)
}

fn set_fifo(priority: u8) -> io::Result<()> {
    let parameters = libc::sched_param {
        sched_priority: priority.into(),
    };
    // SAFETY: the kernel reads `parameters` during the call only; 0 is the calling thread.
    check(unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) })
}

/// The last core that this process may use, if it may use several; interrupts gather on the first.
#[must_use]
pub fn last_core() -> Option<usize> {
    let cores = core_affinity::get_core_ids()?;
    (cores.len() > 1).then(|| cores.last().map(|core| core.id))?
}

/// Takes the core from the caller, never from `get_core_ids`: that lists the inherited mask, in
/// which isolated cores are missing. The mask is read back, since cpusets narrow it silently.
fn pin(core: usize) -> io::Result<()> {
    if core >= cores() {
        return Err(io::Error::from_raw_os_error(libc::ENOENT));
    }
    let wanted = core_affinity::CoreId { id: core };
    let set = core_affinity::set_for_current(wanted);
    if set && core_affinity::get_core_ids().is_some_and(|mask| mask == [wanted]) {
        Ok(())
    } else {
        Err(io::Error::from_raw_os_error(libc::EPERM))
    }
}

/// Locks what is mapped; what will be mapped as well only where no limit could then make an
/// allocation elsewhere in the process fail.
fn lock_memory() -> io::Result<()> {
    let mut limit = MaybeUninit::<libc::rlimit>::uninit();
    // SAFETY: the kernel fills `limit`, which is read only when it said so.
    let unlimited = unsafe {
        libc::getrlimit(libc::RLIMIT_MEMLOCK, limit.as_mut_ptr()) == 0
            && limit.assume_init().rlim_cur == libc::RLIM_INFINITY
    };
    let flags = if unlimited || has_capability(CAP_IPC_LOCK) {
        libc::MCL_CURRENT | libc::MCL_FUTURE
    } else {
        libc::MCL_CURRENT
    };
    // SAFETY: mlockall takes flags and touches no memory of ours.
    check(unsafe { libc::mlockall(flags) })
}

/// Bit of CAP_IPC_LOCK, capabilities(7).
const CAP_IPC_LOCK: u32 = 14;

/// Whether the process has a capability in effect.
fn has_capability(bit: u32) -> bool {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else {
        return false;
    };
    status
        .lines()
        .find_map(|line| line.strip_prefix("CapEff:"))
        .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .is_some_and(|mask| mask >> bit & 1 == 1)
}

/// Goes through the calling thread's stack once, so that nothing it does later needs a page that cannot be had any more.
#[inline(never)]
pub fn touch_stack() {
    let mut stack = [0_u8; STACK];
    for page in stack.chunks_mut(4096) {
        page[0] = 1;
    }
    std::hint::black_box(&stack);
}

/// Takes memory from the kernel that the calling thread goes on with where no more can be had; none is given back any more.
///
/// It matters for the main thread, the heap of which ends where the kernel was last asked to end it. Every other thread's
/// arena of glibc's allocator grows within the 64 MiB that it has mapped, and then into this one.
pub fn keep_memory() {
    let most = HEAP as libc::c_int;
    // The allocator no longer adapts either once one is set: allocations of their own pages begin where that ends.
    // SAFETY: mallopt takes two numbers; the allocator locks itself.
    unsafe {
        libc::mallopt(libc::M_TRIM_THRESHOLD, libc::c_int::MAX);
        libc::mallopt(libc::M_MMAP_THRESHOLD, most);
    }
    let blocks: Vec<Vec<u8>> = (0..HEAP / BLOCK).map(|_| vec![1; BLOCK]).collect();
    std::hint::black_box(&blocks);
}

/// The kernel keeps every processor's wake-up latency at what is written here while it is open.
fn stay_awake() -> io::Result<File> {
    let mut latency = OpenOptions::new()
        .write(true)
        .open("/dev/cpu_dma_latency")?;
    latency.write_all(&0_i32.to_ne_bytes())?;
    Ok(latency)
}

fn check(result: libc::c_int) -> io::Result<()> {
    if result == 0 {
        Ok(())
    } else {
        Err(io::Error::last_os_error())
    }
}

/// CLOCK_MONOTONIC now.
#[must_use]
pub fn now() -> Instant {
    read_clock(libc::CLOCK_MONOTONIC)
}

/// Sleeps until a socket or file has something to read, for `most` at most; a signal ends it early.
///
/// # Errors
/// The kernel's.
pub(crate) fn wait_readable(file: &impl AsRawFd, most: Duration) -> io::Result<()> {
    let mut wanted = libc::pollfd {
        fd: file.as_raw_fd(),
        events: libc::POLLIN,
        revents: 0,
    };
    let timeout = libc::timespec {
        tv_sec: most.as_secs() as libc::time_t,
        tv_nsec: most.subsec_nanos().into(),
    };
    // SAFETY: one pollfd and one timespec, both alive during the call; no signal mask.
    let ready = unsafe { libc::ppoll(&raw mut wanted, 1, &raw const timeout, std::ptr::null()) };
    match check(ready.min(0)) {
        Err(error) if error.kind() == io::ErrorKind::Interrupted => Ok(()),
        waited => waited,
    }
}

/// How far CLOCK_REALTIME is ahead of CLOCK_MONOTONIC, in nanoseconds.
///
/// One clock is read between two readings of the other; where these are far apart, somebody else
/// had the processor meanwhile, and it is tried again.
pub(crate) fn wall_clock_offset() -> u64 {
    const CLOSE: u64 = 1_000;
    let mut best = (u64::MAX, 0);
    for _ in 0..4 {
        let before = now().as_nanos();
        let wall = read_clock(libc::CLOCK_REALTIME).as_nanos();
        let apart = now().as_nanos() - before;
        best = best.min((apart, wall.wrapping_sub(before + apart / 2)));
        if apart < CLOSE {
            break;
        }
    }
    best.1
}

/// Processor time that the calling thread has used.
#[must_use]
pub fn thread_time() -> Duration {
    Duration::from_nanos(read_clock(libc::CLOCK_THREAD_CPUTIME_ID).as_nanos())
}

fn read_clock(clock: libc::clockid_t) -> Instant {
    let mut time = MaybeUninit::<libc::timespec>::uninit();
    // SAFETY: the kernel fills `time`; these clocks exist on every Linux, so the call succeeds.
    let time = unsafe {
        let result = libc::clock_gettime(clock, time.as_mut_ptr());
        assert_eq!(result, 0, "clock_gettime");
        time.assume_init()
    };
    Instant::from_nanos(time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64)
}

/// Sleeps until `instant` on CLOCK_MONOTONIC, the last `spin` of it awake: that trades one core
/// for the kernel's wake-up latency. Awake, it begins with `rehearse`, for caches that went cold
/// meanwhile. An instant that has passed returns at once.
pub fn sleep_until(instant: Instant, spin: Duration, rehearse: impl FnOnce()) {
    let wake = instant.as_nanos().saturating_sub(spin.as_nanos() as u64);
    let time = libc::timespec {
        tv_sec: (wake / 1_000_000_000) as libc::time_t,
        tv_nsec: (wake % 1_000_000_000) as libc::c_long,
    };
    // A signal ends the sleep early; the instant is absolute, so sleeping again is exact.
    // SAFETY: the kernel reads `time` during the call; a remainder is not asked for.
    while unsafe {
        libc::clock_nanosleep(
            libc::CLOCK_MONOTONIC,
            libc::TIMER_ABSTIME,
            &raw const time,
            std::ptr::null_mut(),
        )
    } == libc::EINTR
    {}
    if now() < instant {
        rehearse();
    }
    while now() < instant {
        std::hint::spin_loop();
    }
}

/// What the kernel has counted for the calling thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Usage {
    /// Page faults, minor and major.
    pub page_faults: u64,
    /// Times that it gave up the processor: sleeps, and waits for locks.
    pub voluntary_switches: u64,
    /// Times that the processor was taken from it.
    pub involuntary_switches: u64,
}

/// The calling thread's counts since it began.
#[must_use]
pub fn usage() -> Usage {
    let mut usage = MaybeUninit::<libc::rusage>::uninit();
    // SAFETY: the kernel fills `usage`; RUSAGE_THREAD with a valid pointer cannot fail.
    let usage = unsafe {
        let result = libc::getrusage(libc::RUSAGE_THREAD, usage.as_mut_ptr());
        assert_eq!(result, 0, "getrusage");
        usage.assume_init()
    };
    Usage {
        page_faults: (usage.ru_minflt + usage.ru_majflt) as u64,
        voluntary_switches: usage.ru_nvcsw as u64,
        involuntary_switches: usage.ru_nivcsw as u64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleeps_to_the_instant_with_and_without_spin() {
        for spin in [Duration::ZERO, Duration::from_micros(200)] {
            let instant = now() + Duration::from_millis(2);
            let mut rehearsed = false;
            sleep_until(instant, spin, || rehearsed = true);
            assert!(now() >= instant);
            assert!(!(rehearsed && spin.is_zero()));
        }
        sleep_until(Instant::ZERO, Duration::ZERO, || panic!("it has passed"));
    }

    #[test]
    fn a_refusal_names_what_grants_it() {
        std::thread::spawn(|| {
            let granted = enter(&Settings {
                core: Some(100_000),
                ..Settings::default()
            });
            assert!(!granted.complete());
            let core = &granted.requests()[1];
            assert_eq!(core.what, "core 100000");
            let told = granted.to_string();
            assert!(
                told.contains("core 100000 (not there: name a core"),
                "{told}"
            );
        })
        .join()
        .unwrap();
    }

    #[test]
    fn what_is_kept_needs_no_page_any_more() {
        keep_memory();
        let before = usage();
        let blocks: Vec<Vec<u8>> = (0..HEAP / 2 / BLOCK).map(|_| vec![1; BLOCK]).collect();
        std::hint::black_box(&blocks);
        drop(blocks);
        let again = vec![1_u8; HEAP / 2];
        std::hint::black_box(&again);
        // A page of code may be new; of memory each block would bring 16.
        assert!(usage().page_faults - before.page_faults < 16);
    }

    #[test]
    fn a_first_touch_is_counted() {
        let before = usage();
        // More than the allocator ever keeps of what others have given back.
        let pages = vec![1_u8; 64 << 20];
        std::hint::black_box(&pages);
        assert!(usage().page_faults > before.page_faults);
    }
}
