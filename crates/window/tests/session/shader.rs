//! The shader that draws the window.

use std::mem::offset_of;

use bokehcam_window::present::gpu::{PRESENT, WindowUniform};
use wgpu::naga;
use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};

#[test]
fn what_draws_the_window_validates_and_takes_what_rust_gives_it() {
    let module = naga::front::wgsl::parse_str(PRESENT.source).expect("WGSL");
    if let Err(error) = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module) {
        panic!("{}", error.emit_to_string(PRESENT.source));
    }
    let entries: Vec<_> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
    assert_eq!(entries, ["corner", PRESENT.name]);
    let kind = module.types.iter().map(|(_, kind)| kind).find(|kind| kind.name.as_deref() == Some("Window"));
    let Some(naga::TypeInner::Struct { members, span }) = kind.map(|kind| &kind.inner) else { panic!("a struct") };
    let theirs: Vec<_> = members.iter().map(|m| (m.name.as_deref().unwrap_or_default(), m.offset as usize)).collect();
    macro_rules! fields {
        ($($field:ident),*) => { [$((stringify!($field), offset_of!(WindowUniform, $field))),*] };
    }
    assert_eq!(theirs, fields!(area, size, split, mirror, stale, divider, visible_region, stripes, background));
    assert_eq!(*span as usize, size_of::<WindowUniform>());
}
