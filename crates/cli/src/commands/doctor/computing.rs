//! Checks of the blur's executor, the networks, and external programs.

use std::process::{Command, Stdio};

use super::finding::Finding;
use bokehcam::compute::Backend;
use bokehcam::computing::ComputeOptions;
use bokehcam::look::{Effect, Look};

const BLUR: &str = "blur";
const NETWORKS: &str = "networks";
const PROGRAMS: &str = "programs";

/// Checks the blur's executor, the networks, and external programs.
pub fn check_computing() -> Vec<Finding> {
    let mut findings = vec![check_blur()];
    #[cfg(feature = "networks")]
    findings.push(check_networks());
    findings.push(check_ffmpeg());
    findings
}

/// Checks whether a single camera can give a portrait.
#[cfg(feature = "networks")]
fn check_networks() -> Finding {
    use bokehcam_networks::network::Task;
    let installed = bokehcam_live::source::installed::installed_networks();
    let names: Vec<&str> = installed.iter().map(|(known, _)| known.file).collect();
    let persons = installed.iter().any(|(known, _)| known.task == Task::Matte);
    match persons {
        true => Finding::good(NETWORKS, format!("a single camera gives a portrait, by {}", names.join(", "))),
        false => Finding::note(
            NETWORKS,
            "none that finds persons, so a single camera gives no portrait",
            "`bokehcam models get` installs one (250 kB); --depth plate needs none",
        ),
    }
}

/// Reports the executor that `--backend auto` chooses here.
fn check_blur() -> Finding {
    /// Any size will do.
    const SIZE: (u32, u32) = (64, 64);
    let settings = Look::with_effect(Effect::Blur).blur_settings(SIZE, false);
    let computing = ComputeOptions::default();
    match settings.as_ref().map(|settings| computing.create_blur(settings, SIZE)).transpose() {
        Err(error) => Finding::note(BLUR, error.to_string(), "report this"),
        Ok(None) => Finding::note(BLUR, "nothing is blurred".to_string(), "report this"),
        Ok(Some(bokeh)) => {
            let name = bokeh.describe();
            if bokeh.backend() == Backend::Cpu && cfg!(feature = "gpu") {
                let fix = "install a Vulkan driver if there is a GPU (`sudo apt install mesa-vulkan-drivers`, or its \
                           maker's driver); `bokehcam bench` measures the CPU";
                Finding::note(BLUR, format!("no usable hardware GPU: {name}"), fix)
            } else {
                Finding::good(BLUR, name)
            }
        }
    }
}

/// Reports the version of ffmpeg, if installed.
fn check_ffmpeg() -> Finding {
    let output = Command::new("ffmpeg").arg("-version").stdin(Stdio::null()).stderr(Stdio::null()).output();
    let text = output.ok().filter(|output| output.status.success()).map(|output| output.stdout);
    let first_line = text.as_deref().and_then(|text| text.split(|byte| *byte == b'\n').next());
    match first_line {
        Some(line) => {
            let line = String::from_utf8_lossy(line);
            Finding::good(PROGRAMS, line.split(" Copyright").next().unwrap_or_default().to_owned())
        }
        None => Finding::note(
            PROGRAMS,
            "ffmpeg is not installed",
            "`sudo apt install ffmpeg`, to write .mp4, .mkv and .webm",
        ),
    }
}
