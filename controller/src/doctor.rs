//! What a host has that helps or hurts a cycle, read from /proc and /sys.
//!
//! Each [`Finding`] says what was found, what it costs where it is not as it should be, and what
//! to type. Costs are orders of magnitude for common x86 hardware; `syncline bench cycle` measures
//! this host's.

use crate::realtime::{self, Settings};
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// How a finding weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Weight {
    /// As it should be.
    Good,
    /// Nothing to say: the host does not tell, or it does not apply.
    Unknown,
    /// Costs time now and then.
    Costly,
    /// No cycle of a few milliseconds is safe with this.
    Bad,
}

/// One thing about the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// What was looked at.
    pub what: &'static str,
    /// What was found.
    pub found: String,
    /// How it weighs.
    pub weight: Weight,
    /// What it costs and what mends it; empty where it is good.
    pub advice: String,
}

impl Finding {
    fn new(what: &'static str, weight: Weight, found: impl Into<String>, advice: &str) -> Self {
        Self {
            what,
            found: found.into(),
            weight,
            advice: if weight == Weight::Good {
                String::new()
            } else {
                advice.into()
            },
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = match self.weight {
            Weight::Good => "ok  ",
            Weight::Unknown => "?   ",
            Weight::Costly => "slow",
            Weight::Bad => "BAD ",
        };
        write!(f, "{mark} {:<17}{}", self.what, self.found)?;
        if !self.advice.is_empty() {
            write!(f, "\n     {:<17}{}", "", self.advice)?;
        }
        Ok(())
    }
}

/// Where the host is looked at: the root of its file system, another one in tests.
#[derive(Clone, Debug)]
pub struct Host {
    root: PathBuf,
    /// The core that the cycle is to run on.
    core: Option<usize>,
}

impl Host {
    /// This host.
    #[must_use]
    pub fn here(core: Option<usize>) -> Self {
        Self::at(Path::new("/"), core)
    }

    /// A host whose /proc and /sys lie below `root`.
    #[must_use]
    pub fn at(root: &Path, core: Option<usize>) -> Self {
        Self {
            root: root.into(),
            core,
        }
    }

    /// Everything that can be read, in the order of what it is worth.
    #[must_use]
    pub fn examine(&self) -> Vec<Finding> {
        let mut findings = vec![
            self.kernel(),
            self.virtual_machine(),
            self.throttling(),
            self.isolation(),
            self.governor(),
            self.sleep_states(),
            self.interrupts(),
            self.siblings(),
            self.clock_source(),
            self.swap(),
        ];
        findings.extend(self.interfaces());
        findings
    }

    fn read(&self, path: &str) -> Option<String> {
        let text = fs::read_to_string(self.root.join(path)).ok()?;
        Some(text.trim().to_owned())
    }

    /// Names in a folder that begin with `prefix` and a digit, sorted; none if it is not there.
    fn list(&self, path: &str, prefix: &str) -> Vec<String> {
        let Ok(entries) = fs::read_dir(self.root.join(path)) else {
            return Vec::new();
        };
        let mut names: Vec<String> = entries
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .filter(|name| {
                let rest = name.strip_prefix(prefix);
                rest.is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
            })
            .collect();
        names.sort();
        names
    }

    fn kernel(&self) -> Finding {
        let version = self.read("proc/version").unwrap_or_default();
        let real_time = self.read("sys/kernel/realtime").as_deref() == Some("1")
            || version.contains("PREEMPT_RT");
        let name = version
            .split_whitespace()
            .nth(2)
            .unwrap_or("unknown")
            .to_owned();
        let (weight, found) = if real_time {
            (Weight::Good, format!("{name}, PREEMPT_RT"))
        } else {
            (Weight::Costly, format!("{name}, not PREEMPT_RT"))
        };
        Finding::new(
            "kernel",
            weight,
            found,
            "wake-ups late by milliseconds under load: sudo apt install linux-image-rt-amd64, reboot",
        )
    }

    fn virtual_machine(&self) -> Finding {
        let info = self.read("proc/cpuinfo").unwrap_or_default();
        let guest = info
            .lines()
            .find(|line| line.starts_with("flags"))
            .is_some_and(|flags| flags.split_whitespace().any(|flag| flag == "hypervisor"));
        Finding::new(
            "machine",
            if guest { Weight::Bad } else { Weight::Good },
            if guest { "virtual" } else { "physical" },
            "the host beneath takes the processor away for milliseconds: run on the bare machine",
        )
    }

    fn throttling(&self) -> Finding {
        let runtime = self.read("proc/sys/kernel/sched_rt_runtime_us");
        let (weight, found) = match runtime.as_deref() {
            Some("-1") => (Weight::Good, "off".to_owned()),
            Some(micros) => (
                Weight::Costly,
                format!("after {micros} us of a second's 1000000"),
            ),
            None => (Weight::Unknown, "not told".to_owned()),
        };
        Finding::new(
            "rt throttling",
            weight,
            found,
            "stops a spinning cycle for 50 ms in each second, a sleeping one never: sudo sysctl -w kernel.sched_rt_runtime_us=-1",
        )
    }

    /// The cores that this machine has; none if it does not tell.
    fn present(&self) -> Vec<usize> {
        let list = self.read("sys/devices/system/cpu/present");
        parse_cores(&list.unwrap_or_default())
    }

    /// The cycle's core, if the machine has it.
    fn named(&self) -> Option<usize> {
        let present = self.present();
        self.core
            .filter(|core| present.is_empty() || present.contains(core))
    }

    fn isolation(&self) -> Finding {
        let isolated = self
            .read("sys/devices/system/cpu/isolated")
            .unwrap_or_default();
        let tickless = self
            .read("sys/devices/system/cpu/nohz_full")
            .filter(|cores| cores != "(null)")
            .unwrap_or_default();
        let present = self.present();
        let core = self.named().or(present.last().copied()).unwrap_or(1);
        let advice = format!(
            "other work on the core costs 10…100 us a wake-up: boot with isolcpus={core} nohz_full={core} rcu_nocbs={core} and name it: --core {core}"
        );
        let (weight, found) = match self.core {
            Some(core) if self.named().is_none() => (
                Weight::Bad,
                format!("no core {core}: 0…{}", present.len() - 1),
            ),
            _ if isolated.is_empty() => (Weight::Costly, "none isolated".to_owned()),
            Some(core) if !parse_cores(&isolated).contains(&core) => (
                Weight::Costly,
                format!("{isolated} isolated, the cycle's core {core} is not"),
            ),
            _ if tickless.is_empty() => {
                (Weight::Costly, format!("{isolated} isolated, but ticking"))
            }
            _ => (
                Weight::Good,
                format!("{isolated} isolated, {tickless} without tick"),
            ),
        };
        Finding::new("cores", weight, found, &advice)
    }

    fn governor(&self) -> Finding {
        let cores = self.list("sys/devices/system/cpu", "cpu");
        let governors: Vec<String> = cores
            .iter()
            .filter_map(|core| {
                self.read(&format!(
                    "sys/devices/system/cpu/{core}/cpufreq/scaling_governor"
                ))
            })
            .collect();
        let slow = governors.iter().find(|governor| *governor != "performance");
        let (weight, found) = match (governors.first(), slow) {
            (None, _) => (Weight::Unknown, "not told".to_owned()),
            (_, Some(governor)) => (Weight::Costly, governor.clone()),
            (_, None) => (Weight::Good, "performance".to_owned()),
        };
        let advice = if weight == Weight::Unknown {
            ""
        } else {
            "a wake-up at low clock takes 2…5 times as long: sudo cpupower frequency-set -g performance"
        };
        Finding::new("governor", weight, found, advice)
    }

    /// The deepest sleep state that is not disabled, by its exit latency.
    fn sleep_states(&self) -> Finding {
        let cpu = format!(
            "sys/devices/system/cpu/cpu{}/cpuidle",
            self.named().unwrap_or(0)
        );
        let deepest = self
            .list(&cpu, "state")
            .iter()
            .filter(|state| self.read(&format!("{cpu}/{state}/disable")).as_deref() != Some("1"))
            .filter_map(|state| {
                let latency = self.read(&format!("{cpu}/{state}/latency"))?;
                let name = self.read(&format!("{cpu}/{state}/name"))?;
                Some((latency.parse::<u32>().ok()?, name))
            })
            .max();
        let (weight, found) = match deepest {
            None => (Weight::Unknown, "not told".to_owned()),
            Some((latency, name)) if latency <= 10 => {
                (Weight::Good, format!("{name}, {latency} us to wake"))
            }
            Some((latency, name)) => (Weight::Costly, format!("{name}, {latency} us to wake")),
        };
        let advice = if weight == Weight::Unknown {
            ""
        } else {
            "that much per wake-up unless /dev/cpu_dma_latency may be written (run asks for it): sudo chmod o+rw /dev/cpu_dma_latency"
        };
        Finding::new("deepest sleep", weight, found, advice)
    }

    fn interrupts(&self) -> Finding {
        let Some(core) = self.named() else {
            return Finding::new(
                "interrupts",
                Weight::Unknown,
                "no core named",
                "name the cycle's core to see which interrupts may land on it: --core N",
            );
        };
        let numbers = self.list("proc/irq", "");
        let on_core: Vec<&String> = numbers
            .iter()
            .filter(|number| {
                let cores = self.read(&format!("proc/irq/{number}/effective_affinity_list"));
                cores.is_some_and(|cores| parse_cores(&cores).contains(&core))
            })
            .collect();
        let advice = format!(
            "each costs 2…20 us when it comes: sudo systemctl stop irqbalance; for each N: echo 0 | sudo tee /proc/irq/N/smp_affinity_list (not core {core})"
        );
        if numbers.is_empty() {
            return Finding::new("interrupts", Weight::Unknown, "not told", "");
        }
        if on_core.is_empty() {
            return Finding::new(
                "interrupts",
                Weight::Good,
                format!("none on core {core}"),
                "",
            );
        }
        let shown: Vec<&str> = on_core.iter().map(|number| number.as_str()).collect();
        Finding::new(
            "interrupts",
            Weight::Costly,
            format!("{} on core {core}: {}", shown.len(), shown.join(" ")),
            &advice,
        )
    }

    fn siblings(&self) -> Finding {
        match self.read("sys/devices/system/cpu/smt/active").as_deref() {
            Some("1") => Finding::new(
                "hyper-threading",
                Weight::Costly,
                "on",
                "the sibling's work slows the cycle by up to half: echo off | sudo tee /sys/devices/system/cpu/smt/control",
            ),
            Some(_) => Finding::new("hyper-threading", Weight::Good, "off", ""),
            None => Finding::new("hyper-threading", Weight::Unknown, "not told", ""),
        }
    }

    fn clock_source(&self) -> Finding {
        let path = "sys/devices/system/clocksource/clocksource0/current_clocksource";
        let Some(source) = self.read(path) else {
            return Finding::new("clock source", Weight::Unknown, "not told", "");
        };
        let good = ["tsc", "arch_sys_counter", "kvm-clock"].contains(&source.as_str());
        Finding::new(
            "clock source",
            if good { Weight::Good } else { Weight::Costly },
            source,
            "each look at the clock is a system call or a slow bus read, 1…4 us: boot with tsc=reliable clocksource=tsc",
        )
    }

    fn swap(&self) -> Finding {
        let areas = self.read("proc/swaps").unwrap_or_default();
        let used = areas.lines().count() > 1;
        Finding::new(
            "swap",
            if used { Weight::Costly } else { Weight::Good },
            if used { "in use" } else { "none" },
            "harmless to the cycle once its memory is locked, milliseconds before: sudo swapoff -a",
        )
    }

    /// Each CAN interface: whether it is up and how deep its transmit queue is.
    fn interfaces(&self) -> Vec<Finding> {
        const ARPHRD_CAN: &str = "280";
        let Ok(entries) = fs::read_dir(self.root.join("sys/class/net")) else {
            return Vec::new();
        };
        let mut names: Vec<String> = entries
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .filter(|name| {
                let kind = self.read(&format!("sys/class/net/{name}/type"));
                kind.as_deref() == Some(ARPHRD_CAN)
            })
            .collect();
        names.sort();
        if names.is_empty() {
            return vec![Finding::new(
                "CAN interface",
                Weight::Unknown,
                "none",
                "is the adapter's driver loaded? without one only simulated buses can be used",
            )];
        }
        let finding = |name: &String| {
            let read = |what: &str| self.read(&format!("sys/class/net/{name}/{what}"));
            let state = read("operstate").unwrap_or_default();
            let queue = read("tx_queue_len").unwrap_or_default();
            let depth: u32 = queue.parse().unwrap_or(0);
            let found = format!("{name}: {state}, transmit queue {queue}");
            if state == "down" {
                let advice = format!(
                    "nothing can be sent: sudo ip link set {name} up type can bitrate 1000000"
                );
                return Finding::new("CAN interface", Weight::Bad, found, &advice);
            }
            let advice = format!(
                "a deep queue can hold setpoints back and send them late; run sizes it to one burst where it may (cap_net_admin): sudo ip link set {name} txqueuelen 10"
            );
            let weight = if depth > 64 && !name.starts_with('v') {
                Weight::Costly
            } else {
                Weight::Good
            };
            Finding::new("CAN interface", weight, found, &advice)
        };
        names.iter().map(finding).collect()
    }
}

/// What this process is granted when it asks for real time, tried out on a thread of its own.
#[must_use]
pub fn try_realtime(core: Option<usize>) -> Vec<Finding> {
    let settings = Settings {
        core,
        ..Settings::default()
    };
    let tried = std::thread::spawn(move || realtime::enter(&settings).requests().to_vec());
    let Ok(requests) = tried.join() else {
        return Vec::new();
    };
    requests
        .into_iter()
        .map(|request| match request.refused {
            None => Finding::new("granted", Weight::Good, request.what, ""),
            Some(refusal) => Finding::new(
                "refused",
                Weight::Bad,
                format!("{}: {}", request.what, refusal.reason),
                &refusal.grant,
            ),
        })
        .collect()
}

/// A list of cores as the kernel writes it: `0-3,7`.
fn parse_cores(list: &str) -> Vec<usize> {
    list.split(',')
        .filter_map(|range| {
            let (first, last) = range.split_once('-').unwrap_or((range, range));
            Some(first.trim().parse().ok()?..=last.trim().parse().ok()?)
        })
        .flat_map(|range: std::ops::RangeInclusive<usize>| range.take(4096))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    struct Fake(TempDir);

    impl Fake {
        fn new(files: &[(&str, &str)]) -> Self {
            let fake = Self(TempDir::new().unwrap());
            for (path, text) in files {
                let path = fake.0.path().join(path);
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                fs::write(path, text).unwrap();
            }
            fake
        }

        fn examine(&self, core: Option<usize>) -> Vec<Finding> {
            Host::at(self.0.path(), core).examine()
        }
    }

    fn weight_of(findings: &[Finding], what: &str) -> Weight {
        let found = findings.iter().find(|finding| finding.what == what);
        found
            .unwrap_or_else(|| panic!("{what}: {findings:?}"))
            .weight
    }

    #[test]
    fn a_tuned_host_is_good_throughout() {
        let host = Fake::new(&[
            (
                "proc/version",
                "Linux version 6.1.0-rt (x) #1 SMP PREEMPT_RT Debian",
            ),
            ("proc/cpuinfo", "flags : fpu tsc\n"),
            ("proc/sys/kernel/sched_rt_runtime_us", "-1\n"),
            ("sys/devices/system/cpu/isolated", "2-3\n"),
            ("sys/devices/system/cpu/nohz_full", "2-3\n"),
            (
                "sys/devices/system/cpu/cpu3/cpufreq/scaling_governor",
                "performance\n",
            ),
            ("sys/devices/system/cpu/cpu3/cpuidle/state0/name", "POLL\n"),
            ("sys/devices/system/cpu/cpu3/cpuidle/state0/latency", "0\n"),
            ("sys/devices/system/cpu/cpu3/cpuidle/state1/name", "C6\n"),
            (
                "sys/devices/system/cpu/cpu3/cpuidle/state1/latency",
                "133\n",
            ),
            ("sys/devices/system/cpu/cpu3/cpuidle/state1/disable", "1\n"),
            ("proc/irq/16/effective_affinity_list", "0-1\n"),
            ("sys/devices/system/cpu/smt/active", "0\n"),
            (
                "sys/devices/system/clocksource/clocksource0/current_clocksource",
                "tsc\n",
            ),
            ("proc/swaps", "Filename Type Size Used Priority\n"),
            ("sys/class/net/can0/type", "280\n"),
            ("sys/class/net/can0/operstate", "up\n"),
            ("sys/class/net/can0/tx_queue_len", "10\n"),
            ("sys/class/net/eth0/type", "1\n"),
        ]);
        for finding in host.examine(Some(3)) {
            assert_eq!(finding.weight, Weight::Good, "{finding}");
            assert_eq!(finding.advice, "");
        }
    }

    #[test]
    fn each_shortcoming_is_found_with_what_to_type() {
        let host = Fake::new(&[
            (
                "proc/version",
                "Linux version 6.1.0 (x) #1 SMP PREEMPT_DYNAMIC",
            ),
            ("proc/cpuinfo", "flags : fpu hypervisor tsc\n"),
            ("proc/sys/kernel/sched_rt_runtime_us", "950000\n"),
            ("sys/devices/system/cpu/isolated", "2\n"),
            (
                "sys/devices/system/cpu/cpu3/cpufreq/scaling_governor",
                "powersave\n",
            ),
            ("sys/devices/system/cpu/cpu3/cpuidle/state1/name", "C6\n"),
            (
                "sys/devices/system/cpu/cpu3/cpuidle/state1/latency",
                "133\n",
            ),
            ("proc/irq/16/effective_affinity_list", "0-3\n"),
            ("sys/devices/system/cpu/smt/active", "1\n"),
            (
                "sys/devices/system/clocksource/clocksource0/current_clocksource",
                "hpet\n",
            ),
            ("proc/swaps", "Filename Type\n/dev/sda2 partition\n"),
            ("sys/class/net/can0/type", "280\n"),
            ("sys/class/net/can0/operstate", "down\n"),
            ("sys/class/net/can0/tx_queue_len", "10\n"),
        ]);
        let findings = host.examine(Some(3));
        for finding in &findings {
            assert!(finding.weight >= Weight::Costly, "{finding}");
            assert!(!finding.advice.is_empty(), "{finding}");
        }
        assert_eq!(weight_of(&findings, "CAN interface"), Weight::Bad);
        assert_eq!(weight_of(&findings, "machine"), Weight::Bad);
    }

    #[test]
    fn a_core_that_is_not_there_is_told() {
        let host = Fake::new(&[
            ("sys/devices/system/cpu/present", "0-3\n"),
            ("sys/devices/system/cpu/isolated", "3\n"),
            ("sys/devices/system/cpu/nohz_full", "3\n"),
            ("proc/irq/16/effective_affinity_list", "0-3\n"),
        ]);
        let there = host.examine(Some(3));
        assert_eq!(weight_of(&there, "cores"), Weight::Good);
        assert_eq!(weight_of(&there, "interrupts"), Weight::Costly);
        let not_there = host.examine(Some(4));
        let cores = not_there.iter().find(|it| it.what == "cores").unwrap();
        assert_eq!(cores.found, "no core 4: 0…3");
        assert!(cores.advice.ends_with("--core 3"), "{}", cores.advice);
        assert_eq!(weight_of(&not_there, "interrupts"), Weight::Unknown);
    }

    #[test]
    fn a_silent_host_is_unknown_not_bad() {
        let findings = Fake::new(&[]).examine(None);
        for what in ["governor", "deepest sleep", "clock source", "interrupts"] {
            assert_eq!(weight_of(&findings, what), Weight::Unknown);
        }
    }

    #[test]
    fn core_lists_are_read_as_the_kernel_writes_them() {
        assert_eq!(parse_cores("0-2,5"), [0, 1, 2, 5]);
        assert_eq!(parse_cores(""), [] as [usize; 0]);
    }
}
