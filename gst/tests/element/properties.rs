//! Properties are the library's settings: their names, defaults and ranges; impossible values are refused.

use std::panic::{AssertUnwindSafe, catch_unwind};

use bokehcam::look::SETTINGS;
use gst::prelude::*;

use crate::common::*;

fn element() -> gst::Element {
    init();
    gst::ElementFactory::make("bokeh").build().unwrap()
}

#[test]
fn every_setting_is_a_property_with_its_default_and_its_choices() {
    let element = element();
    for setting in &SETTINGS {
        // Pipelines use a setting's alias where it has one.
        let name = setting.alias().unwrap_or(setting.name);
        let spec = element.find_property(name).unwrap_or_else(|| panic!("no property {name}"));
        let flags = spec.flags();
        assert!(flags.contains(gst::glib::ParamFlags::READWRITE | gst::PARAM_FLAG_MUTABLE_PLAYING), "{name}");
        let value = element.property_value(name);
        let shown = match gst::glib::EnumValue::from_value(&value) {
            Some((class, choice)) => {
                let names: Vec<&str> = class.values().iter().map(|value| value.nick()).collect();
                let choices = (setting.choices)();
                let present = choices.iter().map(|choice| choice.name);
                let former = choices.iter().flat_map(|choice| choice.former_names.iter().copied());
                assert_eq!(names, present.chain(former).collect::<Vec<_>>());
                choice.nick().to_owned()
            }
            None => match value.get::<f32>() {
                Ok(number) => {
                    assert!(flags.contains(gst::PARAM_FLAG_CONTROLLABLE), "{name} is a number");
                    number.to_string()
                }
                Err(_) => value.get::<String>().unwrap(),
            },
        };
        let computed = if (setting.range)().is_some() { "0" } else { "auto" };
        assert_eq!(shown, setting.default().unwrap_or_else(|| computed.to_owned()), "{name}");
        assert!(spec.blurb().is_some_and(|blurb| !blurb.contains("--")), "{name}");
    }
}

#[test]
fn a_former_name_sets_the_value_that_it_means_now() {
    let element = element();
    for (former, name) in [("fast", "draft"), ("high", "balanced")] {
        element.set_property_from_str("quality", former);
        let value = element.property_value("quality");
        let (_, choice) = gst::glib::EnumValue::from_value(&value).unwrap();
        assert_eq!(choice.nick(), name);
    }
}

#[test]
fn numbers_out_of_range_are_refused() {
    let element = element();
    for setting in &SETTINGS {
        let Some(range) = (setting.range)() else { continue };
        let before = element.property::<f32>(setting.name);
        for outside in [range.start().min(0.0).next_down(), range.end().next_up()] {
            let set = catch_unwind(AssertUnwindSafe(|| element.set_property(setting.name, outside)));
            assert!(set.is_err(), "{} takes {outside}", setting.name);
            assert_eq!(element.property::<f32>(setting.name), before);
        }
        let inside = range.start().max(range.end().min(0.5));
        element.set_property(setting.name, inside);
        assert_eq!(element.property::<f32>(setting.name), inside);
    }
}

#[test]
fn text_that_means_nothing_keeps_the_element_from_starting_and_says_why() {
    let element = element();
    let bus = gst::Bus::new();
    element.set_bus(Some(&bus));
    element.set_property("aperture", "hexagon");
    assert!(element.set_state(gst::State::Paused).is_err());
    let message = bus.timed_pop_filtered(gst::ClockTime::SECOND, &[gst::MessageType::Error]).unwrap();
    let gst::MessageView::Error(error) = message.view() else { panic!("{message:?}") };
    assert!(error.error().to_string().starts_with("aperture=hexagon: use disc"), "{}", error.error());
    element.set_state(gst::State::Null).unwrap();
    element.set_property("aperture", "polygon:6");
    assert!(element.set_state(gst::State::Paused).is_ok());
    element.set_state(gst::State::Null).unwrap();
    // Two numbers do not determine a lens.
    element.set_property("f-number", 2.0_f32);
    assert!(element.set_state(gst::State::Paused).is_err());
    element.set_state(gst::State::Null).unwrap();
}

#[test]
fn a_number_is_the_text_that_is_one() {
    let element = element();
    assert_eq!(element.property::<f32>("focus-m"), -1.0);
    element.set_property("focus-m", 1.5_f32);
    assert_eq!(element.property::<String>("focus"), "1.5");
    element.set_property("focus", "0.5,0.4");
    assert_eq!(element.property::<f32>("focus-m"), -1.0);
    element.set_property("focus-m", -1.0_f32);
    assert_eq!(element.property::<String>("focus"), "0.5,0.4", "it was no number before");
    element.set_property("coc-at-infinity", "12");
    assert_eq!(element.property::<f32>("coc-at-infinity-px"), 12.0);
    element.set_property("f-number", 2.0_f32);
    assert_eq!(element.property::<String>("coc-at-infinity"), "auto", "a lens takes its place");
}

#[test]
fn what_is_set_while_it_plays_holds_from_the_next_picture_and_what_is_wrong_changes_nothing() {
    let size = (64, 48);
    let mut harness = harness();
    let element = harness.element().unwrap();
    let bus = gst::Bus::new();
    element.set_bus(Some(&bus));
    element.set_property_from_str("effect", "blur");
    harness.set_src_caps(caps("RGB", size));
    let mut next = |index: u64| {
        harness.push(timed(stripes(size, 0), index, 1)).unwrap();
        bytes(&harness.pull().unwrap())
    };
    let usual = next(0);
    element.set_property("coc-at-infinity", "6");
    let stronger = next(1);
    assert!(usual != stronger);
    element.set_property("coc-at-infinity", "much");
    assert!(next(2) == stronger);
    let message = bus.timed_pop_filtered(gst::ClockTime::SECOND, &[gst::MessageType::Warning]).unwrap();
    let gst::MessageView::Warning(warning) = message.view() else { panic!("{message:?}") };
    assert!(warning.error().to_string().contains("coc-at-infinity=much: use pixels"), "{}", warning.error());
    element.set_property_from_str("effect", "none");
    assert!(next(3) == stripes(size, 0));
    element.set_property_from_str("effect", "blur");
    element.set_property("coc-at-infinity", "auto");
    assert!(next(4) == usual);
}
