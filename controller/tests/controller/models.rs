//! What a machine file may say of a model, and may ask of its drives, by what their manuals have.

use super::outside::root;
use proptest::prelude::*;
use std::fs;
use syncline_controller::machine::Machine;
use syncline_drives::model::MODELS;

/// The mixed portal with this behind it, and its Y as fast as that, mm/s.
fn mixed(model: &str, velocity: f64) -> Result<Machine, String> {
    let file = root().join("examples/mixed/machine.toml");
    let text = fs::read_to_string(&file).unwrap();
    let fast = "max_velocity = 800.0";
    assert!(text.contains(fast));
    let text = text.replacen(fast, &format!("max_velocity = {velocity:?}"), 1);
    let loaded = Machine::parse(&file, &format!("{text}\n{model}"));
    loaded.map_err(|wrong| wrong.to_string())
}

proptest! {
    /// A TWK CRN has one of two discs.
    #[test]
    fn a_disc_that_no_encoder_has_is_refused(
        steps in prop_oneof![Just(4096u32), Just(8192), 4096..=8192u32, any::<u32>()],
    ) {
        let loaded = mixed(&format!("[model.twk_crn]\nsteps_per_turn = {steps}\n"), 800.0);
        match loaded {
            Ok(_) => prop_assert!([4096, 8192].contains(&steps), "{steps}"),
            Err(told) => {
                prop_assert!(![4096, 8192].contains(&steps), "{told}");
                let expected = format!("`steps_per_turn` is {steps}");
                prop_assert!(told.contains(&expected) && told.contains("allowed: 4096, 8192"), "{told}");
            }
        }
    }

    /// A TLC53x has no more than 12 000 units of velocity (607Fh), of which the loop has a sixth: with a finer unit its axis has
    /// to be slower. One that takes it moves as fast.
    #[test]
    fn an_axis_is_no_faster_than_its_drives_unit_of_velocity_holds(units in 1..=1000u32, velocity in 1.0..3000.0f64) {
        // 20 mm for each turn of the motor.
        let most = 10_000.0 / f64::from(units) / 60.0 * 20.0;
        prop_assume!((velocity - most).abs() > 0.01);
        let velocity = (velocity * 1000.0).round() / 1000.0;
        // The feeder goes at 400 mm/s by the same model.
        let feeder = most < 400.0;
        let loaded = mixed(&format!("[model.tlc5xx]\nunits_per_rpm = {units}\n"), velocity);
        match loaded {
            Ok(_) => prop_assert!(velocity < most && !feeder, "{velocity} of {most}"),
            Err(told) => {
                prop_assert!(velocity > most || feeder, "{told}");
                let of_y = format!("axis \"Y\": `max_velocity` is {velocity}, ");
                prop_assert_eq!(told.contains(&of_y), velocity > most, "{}", told);
                let numbers = format!("takes no more than {most:.3} mm/s");
                prop_assert!(told.contains(&numbers), "{numbers}: {told}");
            }
        }
    }
}

/// A page begins with how a machine file names what it is about.
#[test]
fn each_model_has_a_page_that_the_lists_of_devices_link_to() {
    let read = |file: &str| fs::read_to_string(root().join(file)).unwrap();
    let lists = [("README.md", "docs/"), ("docs/tools.md", "")]
        .map(|(file, folder)| (file, folder, read(file)));
    let pages: Vec<(String, String)> = fs::read_dir(root().join("docs"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".md") && name != "machine-file.md")
        .map(|name| {
            let text = read(&format!("docs/{name}"));
            let head = text.split("\n## ").next().unwrap_or_default().to_owned();
            (name, head)
        })
        .collect();
    for model in MODELS {
        let named = format!("`model = \"{}\"`", model.name);
        let of_model = || pages.iter().filter(|(_, head)| head.contains(&named));
        for (list, folder, text) in &lists {
            let linked = of_model().any(|(page, _)| text.contains(&format!("]({folder}{page})")));
            assert!(linked, "{list} links to no page that begins with {named}");
        }
    }
}
