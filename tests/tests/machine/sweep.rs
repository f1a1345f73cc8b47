//! Sweeps: each run is the validation that it says, and what a sweep comes to depends neither on who made its parts nor
//! on what interrupted it.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;
use syncline_tests::command::{Folder, ended, root, syncline};

const PROGRAM: &str = "F6000\nG1 X4\nG1 X8 Y3\nM2\n";

/// A key whose values are numbers and one whose are texts.
const VARY: &str = "method = \"latin_hypercube\"\n\
                    [[vary]]\nkey = \"axis.X.max_jerk\"\nfrom = 10_000.0\nto = 60_000.0\n\
                    [[vary]]\nkey = \"path.mode\"\nvalues = [\"G61\", \"G64\"]\n";

/// The files of a sweep, and the folder that they are in.
struct Files {
    folder: Folder,
    machine: PathBuf,
    program: PathBuf,
    vary: PathBuf,
}

impl Files {
    fn new(vary: &str) -> Self {
        let folder = Folder::new();
        Self {
            machine: folder.machine("xyz"),
            program: folder.file("part.ngc", PROGRAM),
            vary: folder.file("vary.toml", vary),
            folder,
        }
    }

    /// A sweep of this folder's files whose parts go to the folder `out`.
    fn sweep(&self, out: &str, more: &[&str]) -> Command {
        let mut command = syncline();
        command.arg("sweep").args([&self.machine, &self.program]);
        command.arg("--vary").arg(&self.vary);
        command.arg("--out").arg(self.folder.path(out)).args(more);
        command
    }

    /// What `merge` makes of folders: its exit code, the table, what it said.
    fn merge(&self, folders: &[&str]) -> (i32, String, String) {
        let folders = folders.iter().map(|it| self.folder.path(it));
        let mut command = syncline();
        command.arg("merge").args(folders).args(["--csv", "-"]);
        let output = command.output().unwrap();
        let (code, table, said) = ended(&output);
        (code, table.to_owned(), said.to_owned())
    }
}

/// The rows of a table, by the names of its columns.
fn rows(table: &str) -> Vec<BTreeMap<String, String>> {
    let mut csv = csv::Reader::from_reader(table.as_bytes());
    csv.deserialize().map(Result::unwrap).collect()
}

/// Each command that is printed makes the run again, frame for frame, and its numbers are those of the table.
#[test]
fn the_commands_that_are_told_repeat_the_runs() {
    let files = Files::new(VARY);
    let csv = files.folder.path("runs.csv");
    let output = files
        .sweep(
            "parts",
            &[
                "--runs", "5", "--seed", "3", "--jobs", "2", "--part", "2", "--csv",
            ],
        )
        .arg(&csv)
        .output()
        .unwrap();
    let (code, told, errors) = ended(&output);
    assert_eq!(code, 0, "{errors}");
    let rows = rows(&files.folder.read("runs.csv"));
    let numbers: Vec<_> = rows.iter().map(|row| row["run"].as_str()).collect();
    assert_eq!(numbers, ["0", "1", "2", "3", "4"]);
    let mut modes: Vec<_> = rows
        .iter()
        .map(|row| row["set.path.mode"].as_str())
        .collect();
    modes.sort_unstable();
    assert_eq!([modes[0], modes[4]], ["\"G61\"", "\"G64\""]);
    let path = syncline().get_program().to_str().unwrap().to_owned();
    let mut repeated = 0;
    for line in told.lines() {
        let Some((run, command)) = line.split_once("syncline validate ") else {
            continue;
        };
        let run = run.trim().strip_prefix("run ").expect("its number").trim();
        let command = format!("{path} validate {command} --json -");
        let output = Command::new("sh").args(["-c", &command]).output().unwrap();
        let (_, json, errors) = ended(&output);
        let json: serde_json::Value = serde_json::from_str(json).expect(errors);
        let row = &rows[run.parse::<usize>().unwrap()];
        assert_eq!(
            row["frames_sha256"],
            json["frames_sha256"].as_str().unwrap()
        );
        assert_eq!(row["verdict"], json["verdict"].as_str().unwrap());
        for (column, pointer) in [
            ("times.motion_s", "/times/motion_s"),
            ("path.max_contour_error_mm", "/path/max_contour_error_mm"),
            (
                "axis.X.max_following_error_mm",
                "/axes/1/max_following_error_mm",
            ),
            ("drive.up-down.torque_reserve", "/drives/2/torque_reserve"),
        ] {
            let number: f64 = row[column].parse().unwrap();
            assert_eq!(
                Some(number),
                json.pointer(pointer).unwrap().as_f64(),
                "{column}"
            );
        }
        repeated += 1;
    }
    assert!(repeated > 0, "{told}");
    let slowest = rows
        .iter()
        .map(|row| row["times.motion_s"].parse().unwrap());
    let slowest = slowest.fold(0.0, f64::max);
    assert!(
        told.contains(&format!("times.motion_s {slowest} in run")),
        "{told}"
    );
}

/// The worst of a run's full circles has a column, whose worst is told; a program without any leaves it empty.
#[test]
fn the_worst_circle_of_a_run_has_a_column() {
    const COLUMN: &str = "path.max_circular_deviation_mm";
    let of = |program: &str| {
        let mut files = Files::new(VARY);
        files.program = files.folder.file("circles.ngc", program);
        let csv = files.folder.path("runs.csv");
        let mut sweep = files.sweep("parts", &["--runs", "3", "--csv"]);
        let output = sweep.arg(&csv).output().unwrap();
        let (code, told, errors) = ended(&output);
        assert_eq!(code, 0, "{errors}");
        let rows = rows(&files.folder.read("runs.csv"));
        (files, rows, told.to_owned())
    };
    let (files, with, told) = of("G17 F3000\nG1 X30\nG2 I-10\nG1 F600\nG3 I-10\nM2\n");
    let mut worst = 0.0_f64;
    for row in &with {
        let mut command = syncline();
        command
            .arg("validate")
            .args([&files.machine, &files.program]);
        command.args(["--json", "-", "--seed", &row["seed"]]);
        for key in ["axis.X.max_jerk", "path.mode"] {
            let value = &row[&format!("set.{key}")];
            command.arg("--set").arg(format!("{key}={value}"));
        }
        let output = command.output().unwrap();
        let (_, json, errors) = ended(&output);
        let json: serde_json::Value = serde_json::from_str(json).expect(errors);
        let circles = json["circles"].as_array().expect("two full circles");
        assert_eq!(circles.len(), 2);
        let deviations = circles
            .iter()
            .map(|it| it["circular_deviation_mm"].as_f64());
        let greatest = deviations.map(Option::unwrap).fold(0.0, f64::max);
        assert!(greatest > 0.0);
        assert_eq!(row[COLUMN].parse(), Ok(greatest));
        assert_eq!(json["path"]["max_circular_deviation_mm"], greatest);
        worst = worst.max(greatest);
    }
    let worst = (worst * 1e6).round() / 1e6;
    assert!(told.contains(&format!("{COLUMN} {worst} in run")), "{told}");
    let (_, without, told) = of(PROGRAM);
    assert!(without.iter().all(|row| row[COLUMN].is_empty()));
    assert!(!told.contains(COLUMN), "{told}");
}

/// Ctrl-C says what there is already, and how to go on from there.
#[test]
fn an_interrupted_sweep_says_what_is_kept() {
    let files = Files::new(VARY);
    let mut command = files.sweep("out", &["--runs", "400", "--part", "1", "--jobs", "1"]);
    let sweep = command.stderr(Stdio::piped()).spawn().unwrap();
    while !files.folder.path("out/part-000000.csv").exists() {
        sleep(Duration::from_millis(10));
    }
    let pid = sweep.id().to_string();
    let killed = Command::new("kill").args(["-INT", &pid]).status();
    assert!(killed.unwrap().success());
    let output = sweep.wait_with_output().unwrap();
    let (code, _, said) = ended(&output);
    assert_eq!(code, 130, "{said}");
    let parts = fs::read_dir(files.folder.path("out")).unwrap().count() - 1;
    let told = format!("interrupted: {parts} of 400 parts were made and are kept in ");
    assert!(said.contains(&told), "{told}: {said}");
}

/// Whatever processes make the parts, in one folder or in several, the table is the same to the byte.
#[test]
fn shards_come_to_what_one_process_comes_to() {
    let files = Files::new(VARY);
    let sweep = |out: &str, more: &[&str]| {
        let common = ["--runs", "7", "--part", "2"];
        let output = files
            .sweep(out, &[&common, more].concat())
            .output()
            .unwrap();
        assert_eq!(ended(&output).0, 0, "{output:?}");
    };
    sweep("whole", &["--jobs", "2"]);
    sweep("one", &["--shard", "1/3"]);
    sweep("together", &["--shard", "0/2"]);
    let (code, _, said) = files.merge(&["together"]);
    assert_eq!(code, 2);
    assert!(
        said.contains("runs 2 to 3 are missing, and another part: "),
        "{said}"
    );
    sweep("other", &["--shard", "2/3"]);
    sweep("together", &["--shard", "1/2"]);
    sweep("other", &["--shard", "0/3"]);
    let (code, whole, _) = files.merge(&["whole"]);
    assert_eq!((code, rows(&whole).len()), (0, 7));
    assert_eq!(files.merge(&["together"]).1, whole);
    assert_eq!(files.merge(&["one", "other"]).1, whole);
}

/// A table in place of a part would be a sweep that is damaged: neither command writes it, be the part there or not.
#[test]
fn no_table_is_written_over_a_sweeps_own_files() {
    let files = Files::new(VARY);
    let common = ["--runs", "3", "--part", "2"];
    let output = files.sweep("parts", &common).output().unwrap();
    assert_eq!(ended(&output).0, 0, "{output:?}");
    let later = files.folder.path("parts/part-000001.csv");
    let whole = files.merge(&["parts"]);
    for (file, is_there) in [
        ("sweep.json", true),
        ("part-000000.csv", true),
        ("part-000001.csv", false),
    ] {
        if !is_there {
            fs::remove_file(&later).unwrap();
        }
        let file = files.folder.path("parts").join(file);
        let before = fs::read(&file).ok();
        let mut sweep = files.sweep("parts", &common);
        let mut merge = syncline();
        merge.arg("merge").arg(files.folder.path("parts"));
        for command in [&mut sweep, &mut merge] {
            let output = command.arg("--csv").arg(&file).output().unwrap();
            let (code, _, errors) = ended(&output);
            assert_eq!(code, 2, "{errors}");
            let told = "a file of the sweep and --csv are both ";
            assert!(errors.contains(told), "{errors}");
            assert_eq!(fs::read(&file).ok(), before);
        }
    }
    let output = files.sweep("parts", &common).output().unwrap();
    assert_eq!(ended(&output).0, 0, "{output:?}");
    assert_eq!(files.merge(&["parts"]), whole);
}

/// A sweep that was killed goes on with what is missing, and parts of another sweep are none of its own.
#[test]
fn an_interrupted_sweep_goes_on() {
    let files = Files::new(VARY);
    let common = ["--runs", "20", "--part", "1", "--jobs", "1"];
    let mut child = files
        .sweep("killed", &common)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let part = |number: usize| files.folder.path(&format!("killed/part-{number:06}.csv"));
    while !part(0).exists() {
        assert!(child.try_wait().unwrap().is_none(), "it makes parts");
        sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let made = fs::read(part(0)).unwrap();
    let when = part(0).metadata().unwrap().modified().unwrap();
    // However far it came.
    let _ = fs::remove_file(part(13));
    assert_eq!(files.merge(&["killed"]).0, 2);
    for out in ["killed", "whole"] {
        let output = files.sweep(out, &common).output().unwrap();
        assert_eq!(ended(&output).0, 0, "{output:?}");
    }
    assert_eq!(fs::read(part(0)).unwrap(), made);
    assert_eq!(part(0).metadata().unwrap().modified().unwrap(), when);
    assert_eq!(files.merge(&["killed"]), files.merge(&["whole"]));

    fs::write(&files.program, "F6000\nG1 X5\nM2\n").unwrap();
    let output = files.sweep("killed", &common).output().unwrap();
    let (code, _, errors) = ended(&output);
    assert!(code == 2 && errors.contains("another program"), "{errors}");
}

/// What describes the drives is part of the machine: a sweep does not go on with another description or data sheet, and a
/// result says which it had.
#[test]
fn descriptions_are_part_of_the_machine() {
    let folder = Folder::new();
    let of_example = |name: &str| fs::read_to_string(root().join("examples/described").join(name));
    for name in ["machine.toml", "servo.toml", "servo.eds"] {
        let _ = folder.file(name, &of_example(name).unwrap());
    }
    // That of no first value.
    let other = of_example("servo.toml").unwrap();
    let other = other.replace("Servo 20", "Servo 21");
    let _ = folder.file("other.toml", &other);
    let (machine, program) = (
        folder.path("machine.toml"),
        folder.file("part.ngc", PROGRAM),
    );
    let vary = folder.file(
        "vary.toml",
        "method = \"grid\"\n[[vary]]\nkey = \"axis.X.max_jerk\"\nvalues = [20_000.0, 40_000.0]\n\
         [[vary]]\nkey = \"drive.X.model\"\nvalues = [\"servo.toml\", \"other.toml\"]\n",
    );
    let sweep = || {
        let mut command = syncline();
        command.arg("sweep").args([&machine, &program]);
        command.arg("--vary").arg(&vary);
        let output = command
            .arg("--out")
            .arg(folder.path("parts"))
            .output()
            .unwrap();
        let (code, _, errors) = ended(&output);
        (code, errors.to_owned())
    };
    let provenance = || {
        let mut command = syncline();
        let command = command.args(["validate", "--json", "-"]);
        let output = command.args([&machine, &program]).output().unwrap();
        let (_, json, errors) = ended(&output);
        let json: serde_json::Value = serde_json::from_str(json).expect(errors);
        json["provenance"]["descriptions"].clone()
    };
    assert_eq!(sweep(), (0, String::new()));
    assert_eq!(sweep().0, 0);
    for name in ["servo.toml", "servo.eds"] {
        let before = provenance();
        let hash = |of: &serde_json::Value| {
            let all = of.as_array().unwrap().iter();
            let mut all = all.filter(|it| it["file"].as_str().unwrap().ends_with(name));
            all.next().unwrap()["sha256"].as_str().unwrap().to_owned()
        };
        let sum = Command::new("sha256sum").arg(folder.path(name)).output();
        let (_, sum, _) = ended(sum.as_ref().unwrap());
        assert_eq!(Some(&hash(&before)[..]), sum.split(' ').next(), "{before}");
        let comment = if name == "servo.eds" { ";" } else { "#" };
        let text = of_example(name).unwrap();
        let _ = folder.file(name, &format!("{comment} changed\n{text}"));
        let (code, errors) = sweep();
        assert!(
            code == 2 && errors.contains("another description of a device"),
            "{name}: {errors}"
        );
        let after = provenance();
        assert_eq!(after.as_array().unwrap().len(), 2, "{after}");
        assert_ne!(hash(&before), hash(&after));
        let _ = folder.file(name, &text);
        assert_eq!(sweep().0, 0);
    }
    let _ = folder.file("other.toml", &format!("# changed\n{other}"));
    let (code, errors) = sweep();
    let refused = code == 2 && errors.contains("another description of a device");
    assert!(refused, "{errors}");
}

/// Runs of files that are changed while the sweep is made are not kept.
#[test]
fn a_program_that_changes_meanwhile_is_told() {
    let files = Files::new(VARY);
    let common = ["--runs", "2000", "--part", "1", "--jobs", "1"];
    let mut sweep = files.sweep("parts", &common);
    let child = sweep.stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let mut child = child.unwrap();
    while !files.folder.path("parts/part-000000.csv").exists() {
        assert!(child.try_wait().unwrap().is_none(), "it makes parts");
        sleep(Duration::from_millis(1));
    }
    fs::write(&files.program, "F6000\nG1 X5\nM2\n").unwrap();
    let output = child.wait_with_output().unwrap();
    let (code, _, errors) = ended(&output);
    assert!(code == 1 && errors.contains("another program"), "{errors}");
}

/// A key that is none is told before anything is run; values that a machine cannot have are runs that are invalid.
#[test]
fn what_cannot_be_run_is_told() {
    let grid = |key: &str, values: &str| {
        let files = Files::new(&format!(
            "method = \"grid\"\n[[vary]]\nkey = \"{key}\"\nvalues = {values}\n"
        ));
        let output = files.sweep("parts", &[]).output().unwrap();
        let (code, told, errors) = ended(&output);
        (code, told.to_owned(), errors.to_owned(), files)
    };
    let (code, _, errors, files) = grid("axis.X.max_jrk", "[1.0]");
    assert!(
        code == 2 && errors.contains("nearest valid key: `max_jerk`"),
        "{errors}"
    );
    assert!(!files.folder.path("parts").exists());
    let (code, told, errors, files) = grid("axis.X.max_jerk", "[40_000.0, -1.0]");
    assert_eq!(code, 0, "{errors}");
    assert!(told.contains("2, of which 1 do not pass"), "{told}");
    let rows = rows(&files.merge(&["parts"]).1);
    assert_eq!(
        [&rows[0]["verdict"], &rows[1]["verdict"]],
        ["pass", "invalid"]
    );
    assert!(
        rows[1]["cause"].contains("`max_jerk` is -1.0"),
        "{}",
        rows[1]["cause"]
    );
    assert_eq!(rows[1]["times.motion_s"], "");
}

/// What the files for clusters run, with the variables that those set, comes to what one process comes to.
#[test]
fn the_files_for_clusters_make_shards() {
    let files = Files::new(VARY);
    let binary = PathBuf::from(syncline().get_program());
    let search = format!("{}:{}", binary.parent().unwrap().display(), env!("PATH"));
    let folder = files.folder.path("");
    for index in ["0", "1"] {
        let mut slurm = Command::new("bash");
        slurm.arg(root().join("deploy/slurm.sbatch"));
        slurm
            .args([&files.machine, &files.program])
            .arg("--vary")
            .arg(&files.vary);
        slurm
            .args(["--runs", "4", "--part", "1", "--out"])
            .arg(folder.join("slurm"));
        slurm.envs([
            ("SLURM_ARRAY_TASK_ID", index),
            ("SLURM_ARRAY_TASK_COUNT", "2"),
        ]);
        slurm.env("SLURM_CPUS_PER_TASK", "1").env("PATH", &search);
        let output = slurm.output().unwrap();
        assert_eq!(ended(&output).0, 0, "{output:?}");

        let job = kubernetes(&folder).replace("machine.toml", "xyz.toml");
        let mut pod = Command::new("sh");
        pod.args([
            "-eu",
            "-c",
            &job.replace("--runs 1000", "--runs 4 --part 1"),
        ]);
        pod.envs([
            ("JOB_COMPLETION_INDEX", index),
            ("SHARDS", "2"),
            ("PATH", &search),
        ]);
        let output = pod.output().unwrap();
        assert_eq!(ended(&output).0, 0, "{output:?}");
    }
    let output = files
        .sweep("whole", &["--runs", "4", "--part", "1"])
        .output()
        .unwrap();
    assert_eq!(ended(&output).0, 0, "{output:?}");
    let whole = files.merge(&["whole"]).1;
    assert_eq!(rows(&whole).len(), 4);
    assert_eq!(files.merge(&["slurm"]).1, whole);
    assert_eq!(files.merge(&["parts"]).1, whole);
}

/// What a pod of the indexed job runs, with its volume mounted at `folder`.
fn kubernetes(folder: &Path) -> String {
    let text = fs::read_to_string(root().join("deploy/kubernetes.yaml")).unwrap();
    let (_, block) = text.split_once("- |\n").expect("the pod's script");
    let indent = block.len() - block.trim_start().len();
    let lines = block
        .lines()
        .take_while(|line| line.len() - line.trim_start().len() >= indent);
    let script: Vec<_> = lines.map(str::trim).collect();
    let folder = folder.display().to_string();
    script
        .join("\n")
        .replace("/sweep/", &format!("{}/", folder.trim_end_matches('/')))
}
