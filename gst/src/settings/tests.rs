use super::*;

fn place(name: &str) -> usize {
    SETTINGS.iter().position(|setting| super::property_name(setting) == name).unwrap()
}

#[test]
fn values_make_the_look_that_the_command_line_makes_of_them() {
    let mut values = Values::default();
    assert_eq!(values.look(&Look::default()), Ok(Look::default()));
    let given =
        [("focus", "0.5,0.4"), ("aperture", "polygon:6"), ("rim", "0.1"), ("quality", "best"), ("max-coc", "9")];
    for (name, text) in given {
        values.set_text(place(name), Some(text.to_owned())).unwrap();
    }
    let look = Patch::parse(given).unwrap().apply_to(&Look::default()).unwrap();
    assert_eq!(values.look(&Look::default()), Ok(look.clone()));
    for (name, _) in given {
        values.set_text(place(name), None).unwrap();
    }
    assert_eq!(values.look(&look), Ok(Look::default()), "what is taken back is as it was");
}

#[test]
fn a_lens_takes_the_place_of_a_radius_and_the_other_way_round() {
    let mut values = Values::default();
    values.set_text(place("coc-at-infinity"), Some("12".into())).unwrap();
    for (name, number) in [("f-number", "2"), ("focal-length", "50"), ("sensor-width", "36")] {
        assert!(name == "f-number" || values.look(&Look::default()).is_err(), "a lens is not known yet");
        values.set_text(place(name), Some(number.into())).unwrap();
    }
    let lens = Patch::parse([("f-number", "2"), ("focal-length", "50"), ("sensor-width", "36")]).unwrap();
    let look = lens.apply_to(&Look::default()).unwrap();
    assert_eq!(values.look(&Look::default()), Ok(look.clone()));
    values.set_text(place("coc-at-infinity"), Some("3%".into())).unwrap();
    let percent = Patch::parse([("coc-at-infinity", "3%")]).unwrap().apply_to(&Look::default()).unwrap();
    assert_eq!(values.look(&look), Ok(percent));
}

#[test]
fn a_fault_is_kept_until_it_is_mended() {
    let mut values = Values::default();
    let refused = values.set_text(place("aperture"), Some("hexagon".into())).unwrap_err();
    assert!(refused.starts_with("aperture=hexagon: use disc"), "{refused}");
    assert_eq!(values.fault(), Some(refused.as_str()));
    values.set_text(place("aperture"), Some("heart".into())).unwrap();
    assert_eq!(values.fault(), None);
}
