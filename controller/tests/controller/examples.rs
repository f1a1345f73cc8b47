//! Every program under `examples/` is accepted on its machine.

use std::path::{Path, PathBuf};

use syncline_controller::machine::Machine;
use syncline_gcode::{Action, AxisSet, Interpreter, Setup, Tables};

fn setup(machine: &Path) -> Setup {
    let loaded = Machine::load(machine).unwrap();
    let axes = &loaded.axes;
    let mut setup = Setup::new(axes.iter().map(|axis| axis.letter).collect::<AxisSet>());
    setup.has_spindle_angle = loaded.spindle_drive().is_some();
    for axis in axes {
        setup.limits[axis.letter.index()] = Some(axis.limits.position);
    }
    setup.tables = Tables::load(&Tables::beside(machine)).unwrap();
    setup
}

fn programs(directory: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "ngc"))
        .collect();
    files.sort();
    files
}

#[test]
fn examples_are_accepted() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    let mut summary = String::new();
    let machines = std::fs::read_dir(examples).unwrap();
    let mut machines: Vec<PathBuf> = machines.map(|entry| entry.unwrap().path()).collect();
    machines.sort();
    for directory in machines {
        let machine = directory.file_name().unwrap().display();
        let setup = setup(&directory.join("machine.toml"));
        for file in programs(&directory) {
            let mut program = Interpreter::open(&file, setup.clone()).unwrap();
            let (mut lines, mut arcs, mut rapids) = (0, 0, 0);
            for command in program.by_ref() {
                match command.unwrap_or_else(|error| panic!("{error}")).action {
                    Action::Feed { .. } => lines += 1,
                    Action::Arc { .. } => arcs += 1,
                    Action::Rapid { .. } => rapids += 1,
                    _ => {}
                }
            }
            assert_eq!(
                program.tables(),
                &setup.tables,
                "{} sets tables",
                file.display()
            );
            let name = file.file_name().unwrap().display();
            summary += &format!(
                "{machine}/{name}: {} blocks, {rapids} rapids, {lines} lines, {arcs} arcs\n",
                program.executed()
            );
        }
    }
    insta::assert_snapshot!(summary);
}
