//! What computes the blur, and programs that this one uses.

use std::process::{Command, Stdio};

use super::super::config::Executor;
use super::super::values::Backend;
use super::findings::Finding;
use crate::bokeh::aperture::Aperture;
use crate::bokeh::{Effect, Method, Settings};
use crate::budget::Quality;

const BLUR: &str = "blur";
const PROGRAMS: &str = "programs";

/// What there is to say about the blur and about other programs.
pub fn look() -> Vec<Finding> {
    vec![blur(), ffmpeg()]
}

/// What `--backend auto` gives here.
fn blur() -> Finding {
    /// Any size will do.
    const SIZE: (u32, u32) = (64, 64);
    let settings = Settings {
        effect: Effect::Blur,
        method: Method::Layered,
        aperture: Aperture::default(),
        rim: 0.2,
        rank: None,
        highlights: 0.0,
        quality: Quality::default(),
        adaptive: false,
        far_max_px: 2.0,
        near_max_px: 0.0,
    };
    match Executor::new(Backend::Auto, None, None).create(&settings, SIZE) {
        Err(error) => Finding::note(BLUR, error.to_string(), "report this"),
        Ok(bokeh) => {
            let name = bokeh.describe();
            if name.starts_with("cpu") && cfg!(feature = "gpu") {
                let fix = "install a Vulkan driver if there is a GPU; `bokehcam bench` tells how fast the CPU is";
                Finding::note(BLUR, format!("no hardware GPU: {name}"), fix)
            } else {
                Finding::good(BLUR, name)
            }
        }
    }
}

fn ffmpeg() -> Finding {
    let output = Command::new("ffmpeg").arg("-version").stdin(Stdio::null()).stderr(Stdio::null()).output();
    let text = output.ok().filter(|output| output.status.success()).map(|output| output.stdout);
    let first = text.as_deref().and_then(|text| text.split(|byte| *byte == b'\n').next());
    match first {
        Some(line) => {
            let line = String::from_utf8_lossy(line);
            Finding::good(PROGRAMS, line.split(" Copyright").next().unwrap_or_default().to_owned())
        }
        None => Finding::note(PROGRAMS, "ffmpeg is not installed", "install it to write .mp4, .mkv and .webm"),
    }
}
