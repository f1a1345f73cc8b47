//! Every model has its twin, with the same data sheet.

use std::time::Duration;
use syncline_canopen::{NodeId, nmt};
use syncline_drives::model::{Assumed, MODELS, Model, Settings};
use syncline_drives::twin::{Config, Kind, TWINS};

#[test]
fn every_model_has_a_twin_with_the_same_data_sheet() {
    let mut models: Vec<&str> = MODELS.iter().map(|model| model.name).collect();
    let mut twins: Vec<&str> = TWINS.iter().map(|twin| twin.name).collect();
    models.sort_unstable();
    twins.sort_unstable();
    let missing = |of: &[&str], all: &[&str]| -> Vec<String> {
        let missing = all.iter().filter(|name| !of.contains(name));
        missing.map(|&name| name.to_owned()).collect()
    };
    assert_eq!(missing(&twins, &models), [""; 0], "models without a twin");
    assert_eq!(missing(&models, &twins), [""; 0], "twins without a model");
    assert_eq!(models, twins, "a name twice");
    for model in MODELS {
        let twin = Kind::by_name(model.name).expect(model.name);
        assert_eq!(
            (twin.title, twin.bitrates, twin.dictionary),
            (model.title, model.bitrates, model.dictionary)
        );
    }
}

#[test]
fn each_is_found_by_its_name_alone() {
    for twin in TWINS {
        assert!(Kind::by_name(twin.name).is_some_and(|found| std::ptr::eq(found, *twin)));
        assert!(Kind::by_name(&twin.name.to_uppercase()).is_none());
    }
    for model in MODELS {
        assert!(Model::by_name(model.name).is_some_and(|found| std::ptr::eq(found, *model)));
    }
}

#[test]
fn a_twin_is_made_as_it_was_asked_for() {
    for twin in TWINS {
        let node = NodeId::new(5).unwrap();
        let config = Config {
            position: -12.5,
            ..Config::new(node)
        };
        let mut device = (twin.make)(&config);
        let seen = device.observe();
        assert_eq!(device.node(), node);
        // What has no shaft stands nowhere.
        let position = device.shaft_mut().map_or(0.0, |_| -12.5);
        assert_eq!(
            (seen.position, seen.velocity, seen.torque),
            (position, 0.0, 0.0)
        );
        assert!(!seen.is_powered && seen.nmt_state == nmt::State::Initialising);
    }
}

/// Each by its own default, or as a machine file states it.
#[test]
fn each_answers_as_fast_as_its_model_says() {
    let settings = |assumed| Settings {
        assumed: Assumed(assumed),
        ..Settings::new(NodeId::new(5).unwrap(), Duration::from_millis(4))
    };
    for model in MODELS {
        let times = |settings: &Settings| {
            let spec = model.device(settings).spec().clone();
            [spec.t_pdo_response, spec.sdo_response].map(|time| time.as_micros() as u32)
        };
        let names = ["t_pdo_response_us", "sdo_response_us"];
        let defaults = names.map(|name| model.assumption(name).expect(name).default);
        assert_eq!(times(&settings(vec![])), defaults, "{}", model.name);
        let stated = vec![(names[0], 77), (names[1], 1234)];
        assert_eq!(times(&settings(stated)), [77, 1234], "{}", model.name);
    }
}
