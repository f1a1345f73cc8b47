//! Validates a program on a machine: the real controller on simulated drives, in virtual time.
//! `cargo run -p syncline-controller --example validate`

use std::error::Error;
use std::path::Path;
use syncline_controller::validate::Inputs;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/xyz");

    let inputs = Inputs::read(&folder.join("machine.toml"), &[], None)?;
    let program = inputs.programs.file(&folder.join("rosette.ngc"));
    let (summary, _) = inputs.validate(program, 0, false, |_| true)?;

    print!("{summary}");
    assert_eq!(summary.verdict, "pass");
    Ok(())
}
