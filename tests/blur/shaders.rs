//! Every shader is valid, and the structs that it shares with Rust have equal layouts. Needs no adapter.
#![cfg(feature = "gpu")]
#![allow(missing_docs)]

use std::ffi::OsStr;
use std::mem::offset_of;
use std::path::{Path, PathBuf};

use bokehcam::bokeh::gpu::shaders::{ALL, Bin, CONSTANTS, Frame, Work};
use bokehcam::bokeh::plan::MAX_BINS;
use bokehcam::compute::device::Shader;
use bokehcam::depth::matting::gpu::shaders as matte;
use bokehcam::depth::refine::gpu::shaders as refine;
use bokehcam::depth::stereo::gpu::shaders as stereo;
use wgpu::naga;
use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};

fn parse(source: &str) -> naga::Module {
    naga::front::wgsl::parse_str(source).unwrap_or_else(|error| panic!("{}", error.emit_to_string(source)))
}

#[test]
fn every_shader_validates_and_is_named_like_its_file() {
    let blur = ALL.map(|shader| (shader, CONSTANTS.map(|(name, _)| name).to_vec()));
    let constants = stereo::matcher_constants((1, 1), 16, 0, false).map(|(name, _)| name);
    let matching = stereo::ALL.map(|shader| (shader, constants.to_vec()));
    let refine = refine::ALL.map(|shader| (shader, refine::constants(false).map(|(name, _)| name).to_vec()));
    let rectify = (stereo::RECTIFY, stereo::rectify_constants(4, 4, 1).map(|(name, _)| name).to_vec());
    let matte = matte::ALL.map(|shader| (shader, matte::constants(false).map(|(name, _)| name).to_vec()));
    for (shader, constants) in blur.into_iter().chain(matching).chain(refine).chain(matte).chain([rectify]) {
        let module = parse(shader.source);
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::SHADER_FLOAT16_IN_FLOAT32);
        if let Err(error) = validator.validate(&module) {
            panic!("{}: {}", shader.name, error.emit_to_string(shader.source));
        }
        let entries: Vec<_> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
        assert_eq!(entries, [shader.name]);
        let overrides: Vec<_> = module.overrides.iter().filter_map(|(_, o)| o.name.as_deref()).collect();
        assert_eq!(overrides, constants);
        assert_eq!(shared_booleans(&module), [""; 0], "{}", shader.name);
    }
}

/// Names of workgroup variables of booleans, whose values NVIDIA's driver 580 loses.
fn shared_booleans(module: &naga::Module) -> Vec<&str> {
    let holds_booleans = |mut ty| loop {
        match module.types[ty].inner {
            naga::TypeInner::Array { base, .. } => ty = base,
            naga::TypeInner::Scalar(scalar) => break scalar.kind == naga::ScalarKind::Bool,
            naga::TypeInner::Vector { scalar, .. } => break scalar.kind == naga::ScalarKind::Bool,
            _ => break false,
        }
    };
    let shared = module.global_variables.iter().map(|(_, variable)| variable);
    let shared =
        shared.filter(|variable| variable.space == naga::AddressSpace::WorkGroup && holds_booleans(variable.ty));
    shared.filter_map(|variable| variable.name.as_deref()).collect()
}

#[test]
fn every_file_is_a_pass_or_shared_and_short() {
    let entries = |folder: PathBuf| {
        let entries = std::fs::read_dir(folder).expect("a folder of shaders");
        entries.map(|entry| entry.expect("an entry").path())
    };
    let folders = entries(Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders"));
    for path in folders.flat_map(entries) {
        let part = |part: Option<&OsStr>| part.and_then(OsStr::to_str).unwrap_or_default().to_owned();
        let (folder, file) = (part(path.parent().and_then(Path::file_name)), part(path.file_stem()));
        let shared = match folder.as_str() {
            "blur" => {
                "base cells common covered filter list means meet mixed next node pyramid radii range show silhouette surfaces tent tiles todo \
                 work yuyv"
            }
            "stereo" => "common line path root row touch",
            "refine" => "common ends lanes select window",
            _ => "background claim common compare contrast enter light prior rank run sum surfaces weights",
        };
        let pass = if folder == "blur" { file.clone() } else { format!("{folder}_{file}") };
        let known = shared.split(' ').any(|shared| shared == file)
            || [&ALL[..], &stereo::ALL, &refine::ALL, &matte::ALL, &[stereo::RECTIFY]]
                .concat()
                .iter()
                .any(|shader| shader.name == pass);
        assert!(known, "{} belongs to no pass", path.display());
        let lines = std::fs::read_to_string(&path).expect("a text").lines().count();
        assert!(lines <= 150, "{} has {lines} lines", path.display());
    }
}

#[test]
fn structs_have_the_same_layout_in_rust_and_wgsl() {
    macro_rules! layout {
        ($type:ident { $($field:ident),* }) => {
            (stringify!($type), size_of::<$type>(), vec![$((stringify!($field), offset_of!($type, $field))),*])
        };
    }
    let expected = [
        layout!(Frame {
            size,
            depth_size,
            coc_kind,
            compositing,
            bins,
            near_bins,
            half_width,
            nodes,
            groups,
            max_px,
            coc,
            ramp,
            expansion,
            steps_per_px,
            mixed,
            symmetric,
            extent,
            term_stride,
            yuyv,
            front_px,
            has_reduced
        }),
        layout!(Bin {
            size,
            cells,
            scale,
            edges,
            decimation,
            whole,
            front,
            behind,
            max_radius_px,
            sigma_cells,
            radius_cells,
            pixels_at,
            rows_at,
            edges_at,
            cells_at,
            binned_at,
            half_width,
            filtered_at,
            active_at,
            has_overshoot
        }),
        layout!(Work { first, count, group, terms, last, nearest_px, visible_weight }),
    ];
    have_layouts(&ALL, expected);
    {
        use refine::{Frame, Wave};
        let frame = layout!(Frame { size, map_size, focus_m, rescale, max_hole_px, is_fresh });
        have_layouts(&refine::ALL, [frame, layout!(Wave { first, at, marks })]);
    }
    {
        use matte::{Frame, PassRun};
        let frame = layout!(Frame { size, max_entries, min_rounds, depth_step, surface_step });
        have_layouts(&matte::ALL, [frame, layout!(PassRun { index })]);
    }
    let matte = matte::ALL.map(|shader| parse(shader.source));
    for (name, size) in [("Entry", matte::ENTRY), ("Cell", matte::CELL), ("Color", matte::COLORS / 2)] {
        let types = matte.iter().flat_map(|module| module.types.iter());
        let spans: Vec<_> =
            types.filter(|(_, kind)| kind.name.as_deref() == Some(name)).map(|(_, kind)| &kind.inner).collect();
        let has_size =
            |kind: &&naga::TypeInner| matches!(kind, naga::TypeInner::Struct { span, .. } if *span as usize == size);
        assert!(!spans.is_empty() && spans.iter().all(has_size), "{name} has {size} bytes");
    }
}

#[test]
fn no_pass_of_the_matte_has_more_buffers_than_a_device_is_asked_for() {
    let is_storage = |space: &naga::AddressSpace| matches!(space, naga::AddressSpace::Storage { .. });
    let count = |shader: Shader| {
        parse(shader.source).global_variables.iter().filter(|(_, variable)| is_storage(&variable.space)).count()
    };
    assert_eq!(matte::ALL.map(count).into_iter().max(), Some(matte::MAX_BUFFERS as usize));
}

/// A struct's name, size, and the offsets of its fields.
type Layout = (&'static str, usize, Vec<(&'static str, usize)>);

fn have_layouts<const N: usize>(shaders: &[Shader], expected: [Layout; N]) {
    for (name, size, fields) in expected {
        let mut found = false;
        for shader in shaders {
            let module = parse(shader.source);
            for (_, kind) in module.types.iter().filter(|(_, kind)| kind.name.as_deref() == Some(name)) {
                let naga::TypeInner::Struct { members, span } = &kind.inner else { panic!("{name} is a struct") };
                let members: Vec<_> =
                    members.iter().map(|m| (m.name.as_deref().unwrap_or_default(), m.offset as usize)).collect();
                assert_eq!((members, *span as usize), (fields.clone(), size), "{name} in {}", shader.name);
                found = true;
            }
        }
        assert!(found, "{name} is in some shader");
    }
}

#[test]
fn the_array_of_bins_holds_as_many_as_a_plan_has() {
    for shader in ALL {
        let module = parse(shader.source);
        for (_, kind) in module.types.iter() {
            let naga::TypeInner::Array { base, size, .. } = kind.inner else { continue };
            if module.types[base].name.as_deref() == Some("Bin") {
                assert_eq!(size, naga::ArraySize::Constant((MAX_BINS as u32).try_into().expect("not zero")));
            }
        }
    }
}
