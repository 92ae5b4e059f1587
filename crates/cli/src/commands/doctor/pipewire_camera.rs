//! Cameras of PipeWire: the daemon, who connects readers, the desktop portal that browsers ask, and what these allow.

use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use super::finding::Finding;
use super::system::System;
use bokehcam::pipewire::PipeWireError;
use bokehcam::pipewire::graph::Graph;

pub const ABOUT: &str = "PipeWire";

/// Browsers by their programs, with the switch that makes them list cameras of PipeWire.
const BROWSERS: [(&[&str], &str, &str); 2] = [
    (
        &["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "brave-browser", "microsoft-edge"],
        "Chromium",
        "chrome://flags/#enable-webrtc-pipewire-camera (or --enable-features=WebRtcPipeWireCamera), then start it again",
    ),
    (&["firefox", "firefox-esr"], "Firefox", "about:config, media.webrtc.camera.allow-pipewire = true"),
];

/// What PipeWire is good for here.
pub struct Verdict {
    pub findings: Vec<Finding>,
    /// Whether other programs can be given a camera.
    pub takes_cameras: bool,
    /// Whether there is a camera to read from.
    pub has_cameras: bool,
}

/// Checks what a camera of PipeWire's needs, from the daemon to the browsers.
pub fn check(system: &System) -> Verdict {
    let graph = match Graph::look() {
        Ok(graph) => graph,
        Err(error) => {
            let findings = vec![unreachable(&error)];
            return Verdict { findings, takes_cameras: false, has_cameras: false };
        }
    };
    let all: Vec<_> = graph.sources.iter().filter(|source| source.is_camera).collect();
    let has_cameras = all.iter().any(|camera| !camera.process.is_some_and(is_bokehcam));
    let cameras: Vec<&str> = all.iter().map(|camera| camera.label.as_str()).collect();
    let there_are = if cameras.is_empty() { "no camera yet".to_owned() } else { cameras.join(", ") };
    let mut findings =
        vec![Finding::good(ABOUT, format!("it answers, and has {there_are}; --to pipewire gives it one"))];
    let has_manager = graph.has_session_manager();
    findings.push(if has_manager {
        Finding::good(ABOUT, "a session manager connects readers with cameras")
    } else {
        let fix = "install and start it: `sudo apt install wireplumber`, `systemctl --user start wireplumber`";
        Finding::missing(ABOUT, "no session manager: a reader would wait for ever", fix)
    });
    findings.push(if system.portal {
        Finding::good(ABOUT, "a desktop portal is there, which browsers ask for cameras")
    } else {
        let fix =
            "install xdg-desktop-portal and the part for this desktop (-gtk, -gnome, -kde, -wlr), and log in again";
        Finding::note(ABOUT, "no desktop portal: browsers list no camera of PipeWire's, other programs do", fix)
    });
    if system.portal && !cameras.is_empty() && portal_sees_a_camera() == Some(false) {
        let fix = "their order of start: `systemctl --user restart wireplumber xdg-desktop-portal`";
        findings.push(Finding::note(ABOUT, "the desktop portal sees no camera, although PipeWire has one", fix));
    }
    findings.extend(refusals());
    findings.extend(
        BROWSERS.iter().filter(|(programs, ..)| programs.iter().any(|name| is_installed(name))).map(
            |(_, name, switch)| Finding::note(ABOUT, format!("{name} lists its cameras only when told to"), *switch),
        ),
    );
    Verdict { findings, takes_cameras: has_manager, has_cameras: has_manager && has_cameras }
}

/// Whether a process is this program, run by somebody: what it gives is no camera to begin with.
fn is_bokehcam(process: u32) -> bool {
    std::fs::read_to_string(format!("/proc/{process}/comm")).is_ok_and(|name| name.trim_end() == "bokehcam")
}

fn unreachable(error: &PipeWireError) -> Finding {
    let fix = "it is needed for --to pipewire alone: `sudo apt install pipewire wireplumber`, then \
               `systemctl --user start pipewire wireplumber`";
    Finding::note(ABOUT, error.to_string(), fix)
}

/// Whether the portal would show a camera; `None` where it cannot be asked.
fn portal_sees_a_camera() -> Option<bool> {
    let camera = ["org.freedesktop.portal.Camera", "IsCameraPresent"];
    let place = ["get-property", "org.freedesktop.portal.Desktop", "/org/freedesktop/portal/desktop"];
    bus(&[&place[..], &camera].concat())?["data"].as_bool()
}

/// Programs that were refused the camera once, and never ask again.
fn refusals() -> Option<Finding> {
    let store = "org.freedesktop.impl.portal.PermissionStore";
    let place = ["call", store, "/org/freedesktop/impl/portal/PermissionStore", store, "Lookup", "ss"];
    let names = refused(&bus(&[&place[..], &["devices", "camera"]].concat())?);
    (!names.is_empty()).then(|| {
        let found = format!("the desktop refuses cameras to {}, as it was told once", names.join(", "));
        Finding::note(ABOUT, found, "`flatpak permission-remove devices camera`, and answer yes the next time")
    })
}

/// Names in the permission store's answer that were told "no"; programs outside of sandboxes have the empty name.
fn refused(answer: &Value) -> Vec<String> {
    let permissions = answer["data"][0].as_object().into_iter().flatten();
    let no = permissions.filter(|(_, told)| told.as_array().is_some_and(|told| told.iter().any(|word| word == "no")));
    no.map(|(name, _)| if name.is_empty() { "all programs outside of sandboxes".into() } else { name.clone() })
        .collect()
}

/// Asks somebody on the session's message bus who is there already; `None` where nobody can be asked.
fn bus(question: &[&str]) -> Option<Value> {
    let asked = Command::new("busctl")
        .args(["--user", "--auto-start=no", "--timeout=3", "--json=short"])
        .args(question)
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output();
    serde_json::from_slice(&asked.ok().filter(|answer| answer.status.success())?.stdout).ok()
}

fn is_installed(program: &str) -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&folders).any(|folder| Path::new(&folder).join(program).is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_was_refused_is_named() {
        let answer = r#"{"type":"a{sas}v","data":[{"":["no"],"org.a":["yes"],"org.b":["no"]},{"type":"y","data":0}]}"#;
        assert_eq!(refused(&serde_json::from_str(answer).unwrap()), ["all programs outside of sandboxes", "org.b"]);
        assert_eq!(refused(&serde_json::json!({ "data": [{}] })), Vec::<String>::new());
        assert_eq!(refused(&Value::Null), Vec::<String>::new());
    }
}
